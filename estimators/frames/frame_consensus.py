"""One agent's inertial frame: a local frame from its IMU, and a correction by consensus with its neighbours.

The filter of `inertial_frame` computes a new attitude with each reading of the IMU, many between two messages. The
result of consensus must persist, so consensus changes a correction C of the frame, q = C ⊙ q_local, instead of the
attitude; only `agree` changes C. A message is compared with the local attitude at the time at which it was taken. This
is the same as propagating the message by the rotation of the body since then, because Γ_ij ⊙ q_local,i* does not depend
on that rotation.

Noise on the relative orientations makes the common frame of all agents drift, as consensus does not fix it. An
`anchor` κ > 0 treats the local frame as one more neighbour, Γ = q_local, of weight κ/ε: the common frame then stays
near the mean of the local ones, and a part κ/(κ + ε λ) of their differences remains in the mode λ of the Laplacian.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ...rotations import (
    angle_between,
    conjugate,
    exp_quaternion,
    integrate,
    log_quaternion,
    normalised,
    quaternion_product,
)
from ..checks import as_array, check_neighbour
from .inertial_frame import (
    LONGEST_STEP_S,
    ImuEstimate,
    ImuModel,
    Reading,
    at_rest,
    check_upright,
    implied_attitude,
    predict,
    update,
)
from .so3_consensus import check_anchor, consensus_step, seen_attitude

Floats = NDArray[np.float64]

_SECOND_NS = 10**9
_STEP_NS = int(LONGEST_STEP_S * _SECOND_NS)
_SAME_FRAME = np.array([1.0, 0.0, 0.0, 0.0])


class FrameConsensus:
    """State machine of one agent: `predict` and `update` with the IMU, `receive` and `agree` with the neighbours.

    Args:
        name: name of the agent, for error messages.
        weights: neighbour → a_ij > 0, dimensionless.
        step: ε, dimensionless; checked against the own weights here, and against the whole graph by `check_step`.
        model: of the IMU.
        anchor: κ in [0, 1), fraction by which one step moves the frame back to the local one, dimensionless.
        upright: standard deviation of the initial tilt [rad], if the body starts upright, as on the ground; None for
            any initial attitude, when the first specific force is taken as up.
        memory_ns: how long attitudes are kept, the largest age of a message [ns].
    Raises:
        BadInput: a weight that is not positive or is that of the agent itself, a step that cannot converge, an
            `upright` that is not positive, or a memory that is not above 0.
    """

    def __init__(
        self,
        name: str,
        weights: Mapping[str, float],
        step: float,
        model: ImuModel,
        *,
        anchor: float = 0.0,
        upright: float | None = None,
        memory_ns: int = _SECOND_NS,
    ) -> None:
        check_anchor(anchor)
        if upright is not None:
            check_upright(upright)
        if memory_ns <= 0:
            raise BadInput(f"memory at {name} is {memory_ns} ns: must be above 0, and longer than messages take")
        self.name = name
        self.correction = _SAME_FRAME
        self._model, self._step, self._anchor, self._memory_ns = model, step, anchor, memory_ns
        self._upright = upright
        self._frames: dict[str, Floats] = {}
        self._weights: dict[str, float] = {}
        self.weigh(weights)
        self._estimate: ImuEstimate | None = None
        self._first: dict[str, Floats] = {}
        self._now_ns = 0
        self._times: list[int] = []
        self._states: list[Floats] = []
        self._known: list[Floats | None] = []
        self._newest: dict[str, int] = {}

    def weigh(self, weights: Mapping[str, float]) -> None:
        """Replace the weights of the neighbours, and discard messages of other agents.

        Raises:
            BadInput: as for a new `FrameConsensus`.
        """
        if self.name in weights or not all(weight > 0.0 for weight in weights.values()):
            raise BadInput(f"weights at {self.name} are {dict(weights)}: give positive ones, of neighbours only")
        most, step = sum(weights.values()), self._step
        if not step > 0.0 or not step * most < 2.0 - self._anchor:
            bound = (2.0 - self._anchor) / most if most else float("inf")
            raise BadInput(f"step at {self.name} is {step:g}: above 0 and, by its own weights alone, below {bound:.6g}")
        self._weights = {**weights, self.name: self._anchor / step}
        self._frames = {name: frame for name, frame in self._frames.items() if name in weights}

    # -- The local frame ------------------------------------------------------------------------------------------

    def predict(self, time_ns: int) -> None:
        """Predict to this instant [ns] in steps of at most LONGEST_STEP_S; do nothing for an earlier instant."""
        if self._estimate is not None:
            for from_ns in range(self._now_ns, time_ns, _STEP_NS):
                step_ns = min(_STEP_NS, time_ns - from_ns)
                self._estimate = predict(self._estimate, self._model, step_ns / _SECOND_NS)
        self._now_ns = max(self._now_ns, time_ns)

    def update(
        self,
        *,
        gyro: Reading | None = None,
        accelerometer: Reading | None = None,
        magnetometer: Reading | None = None,
    ) -> None:
        """Update with readings of this instant, as `inertial_frame.update`; the first directions start the filter."""
        if self._estimate is None:
            for what, reading in (("force", accelerometer), ("field", magnetometer)):
                if reading is not None:
                    self._first[what] = as_array(reading, (3,), what)
            if len(self._first) < 2:
                return
            self._estimate = at_rest(self._first["force"], self._first["field"], self._model, self._upright)
            accelerometer = magnetometer = None
        self._estimate = update(
            self._estimate, self._model, gyro=gyro, accelerometer=accelerometer, magnetometer=magnetometer
        )
        if not self._times or self._times[-1] < self._now_ns:
            self._times.append(self._now_ns)
            self._states.append(self._estimate.state)
            self._known.append(None)
            while self._times[0] < self._now_ns - self._memory_ns:
                del self._times[0], self._states[0], self._known[0]
        self._states[-1], self._known[-1] = self._estimate.state, None

    def _read(self, place: int) -> Floats:
        """Attitude implied by the state at one of the kept instants, computed once."""
        known = self._known[place]
        if known is None:
            self._known[place] = known = implied_attitude(self._states[place])
        return known

    def local_attitude(self, time_ns: int | None = None) -> Floats | None:
        """Attitude in the local frame (4,), now or at an instant [ns]; None if unknown.

        It is interpolated between readings along the shortest rotation, and extrapolated after the last one with the
        estimated rates, for at most LONGEST_STEP_S. It is unknown before the first reading or beyond the memory.
        """
        when_ns = self._now_ns if time_ns is None else time_ns
        after = bisect_right(self._times, when_ns)
        if after == 0:
            return None
        passed_ns = when_ns - self._times[after - 1]
        if passed_ns == 0:
            return self._read(after - 1)
        if after == len(self._times):
            if passed_ns > _STEP_NS:
                return None
            return integrate(self._read(after - 1), self._states[after - 1][:3], passed_ns / _SECOND_NS)
        before = self._read(after - 1)
        turn = log_quaternion(quaternion_product(conjugate(before), self._read(after)))
        share = passed_ns / (self._times[after] - self._times[after - 1])
        return quaternion_product(before, exp_quaternion(share * turn))

    # -- The common frame -----------------------------------------------------------------------------------------

    def attitude(self, time_ns: int | None = None) -> Floats | None:
        """Attitude in the common frame (4,), C ⊙ q_local, now or at an instant [ns]; None if unknown."""
        local = self.local_attitude(time_ns)
        return None if local is None else quaternion_product(self.correction, local)

    def message(self, neighbour: str, relative: Floats, taken_ns: int) -> Floats | None:
        """Message to a neighbour that was seen: Γ (4,), to be sent with its stamp; None if unknown.

        Args:
            neighbour: the neighbour seen.
            relative: its relative orientation ξ, its body → the own body, (4,).
            taken_ns: when it was seen [ns].
        Raises:
            BadInput: not a neighbour.
        """
        check_neighbour(neighbour, self._neighbours())
        attitude = self.attitude(taken_ns)
        return None if attitude is None else seen_attitude(attitude, relative)

    def receive(self, neighbour: str, attitude: Floats, taken_ns: int) -> bool:
        """Store a neighbour's message on the own attitude for the next `agree`; return whether it can be used.

        It cannot if it is not newer than the last one of this neighbour, or if the local attitude at its stamp is
        unknown.

        Args:
            neighbour: the sender.
            attitude: Γ (4,); normalised here, as the encoding may change its norm.
            taken_ns: when the neighbour saw this agent, the message's stamp [ns].
        Raises:
            BadInput: not a neighbour, or a zero quaternion.
        """
        check_neighbour(neighbour, self._neighbours())
        said = normalised(attitude)
        local = self.local_attitude(taken_ns)
        if local is None or taken_ns <= self._newest.get(neighbour, -1):
            return False
        self._newest[neighbour] = taken_ns
        self._frames[neighbour] = quaternion_product(said, conjugate(local))
        return True

    def agree(self) -> float | None:
        """One step of consensus with the messages received since the last step; each is used once.

        C⁺ = C exp(ε Σ_j a_ij log(Cᵀ E_j)) with E_j = Γ_ij q_local,i*: line 8 of Algorithm 2 for the frames

        Returns:
            Root mean square of the angles to the neighbours' frames [rad]; None, without a step, if no message came.
        """
        if not self._frames:
            return None
        frames, self._frames = self._frames, {}
        apart = [angle_between(self.correction, frame) for frame in frames.values()]
        if self._anchor > 0.0:
            frames[self.name] = _SAME_FRAME
        self.correction = consensus_step(self.correction, frames, self._weights, self._step)
        return math.hypot(*apart) / math.sqrt(len(apart))

    def _neighbours(self) -> list[str]:
        return [name for name in self._weights if name != self.name]
