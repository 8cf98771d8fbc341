"""One agent's inertial frame: its own from its IMU, and a correction on which it agrees with its neighbours.

The filter of `inertial_frame` gives a new attitude with each reading of the IMU, many in the time between two messages.
What consensus has found must outlast them, so it acts on a correction C of the frame, q = C ⊙ q_local, and not on the
attitude itself: C changes in `agree` only. As Γ_ij ⊙ q_local,i* is free of the body's own rotation, a message that is
old by its latency is compared with the local attitude at the time at which it was taken, which is the same as carrying
it forward by the rotation since then.

Noise on the relative orientations makes the common frame of all agents wander, as nothing in consensus holds it. An
`anchor` κ > 0 makes the own frame one more neighbour, Γ = q_local, of weight κ/ε: the common frame then stays near the
mean of the local ones, and of their differences a part κ/(κ + ε λ) remains in the mode λ of the Laplacian.
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
    """State machine of one agent: `predict` and `update` with the IMU, `heard` and `agree` with the neighbours.

    Args:
        name: of the agent, for messages of errors.
        weights: neighbour → a_ij > 0, dimensionless.
        step: ε, dimensionless; `check_step` holds it against the whole graph, here against the own weights only.
        model: of the IMU.
        anchor: κ in [0, 1), how far one step pulls the frame back to the local one, dimensionless.
        upright: standard deviation of the tilt [rad] with which it begins, if it is known to begin upright, as on the
            ground; None: in any attitude, and what force is read first is taken for up.
        memory_ns: how far back attitudes are remembered, and so how old a message may be [ns].
    Raises:
        BadInput: a weight that is not positive or the agent's own, a step that cannot converge, an `upright` that is
            not positive, or no memory.
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
        """Count these neighbours from now on; what was heard of others is forgotten.

        Raises:
            BadInput: as for a new one.
        """
        if self.name in weights or not all(weight > 0.0 for weight in weights.values()):
            raise BadInput(f"weights at {self.name} are {dict(weights)}: give positive ones, of neighbours only")
        most, step = sum(weights.values()), self._step
        if not step > 0.0 or not step * most < 2.0 - self._anchor:
            bound = (2.0 - self._anchor) / most if most else float("inf")
            raise BadInput(f"step at {self.name} is {step:g}: above 0 and, by its own weights alone, below {bound:.6g}")
        self._weights = {**weights, self.name: self._anchor / step}
        self._frames = {name: frame for name, frame in self._frames.items() if name in weights}

    # -- The own frame --------------------------------------------------------------------------------------------

    def predict(self, time_ns: int) -> None:
        """Carry the estimate forward to this instant [ns], in steps as short as they must be; never back."""
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
        """Take in readings of this instant, as `inertial_frame.update`; the first two directions start the filter."""
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
        """The attitude that the readings at one of the remembered instants imply, worked out once."""
        known = self._known[place]
        if known is None:
            self._known[place] = known = implied_attitude(self._states[place])
        return known

    def local_attitude(self, time_ns: int | None = None) -> Floats | None:
        """The attitude in the own frame (4,), now or at an instant [ns]; None where it is not known.

        Between two readings it is interpolated along the shortest rotation; after the last it follows the estimated
        rates, for at most LONGEST_STEP_S. Not known: before the first reading, or longer ago than the memory.
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

    # -- The frame of all -----------------------------------------------------------------------------------------

    def attitude(self, time_ns: int | None = None) -> Floats | None:
        """The attitude in the agreed frame (4,), C ⊙ q_local, now or at an instant [ns]; None where it is not known."""
        local = self.local_attitude(time_ns)
        return None if local is None else quaternion_product(self.correction, local)

    def message(self, neighbour: str, relative: Floats, taken_ns: int) -> Floats | None:
        """What to tell a neighbour that was seen: Γ (4,), to be sent with its stamp; None where it is not known.

        Args:
            neighbour: who was seen.
            relative: its orientation ξ, its body → the own body, (4,).
            taken_ns: when it was seen [ns].
        Raises:
            BadInput: it is not a neighbour.
        """
        check_neighbour(neighbour, self._neighbours())
        attitude = self.attitude(taken_ns)
        return None if attitude is None else seen_attitude(attitude, relative)

    def heard(self, neighbour: str, attitude: Floats, taken_ns: int) -> bool:
        """Keep what a neighbour says of the own attitude, for the next `agree`; whether it could be used.

        Not used: what was taken no later than what was heard of it before, or at a time that is not remembered.

        Args:
            neighbour: who says so.
            attitude: Γ (4,); lengths other than 1, as narrow payloads have them, are put right.
            taken_ns: when it saw, the message's stamp [ns].
        Raises:
            BadInput: it is not a neighbour, or the quaternion has no direction.
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
        """One step of consensus with those heard since the last one; each message counts once.

        C⁺ = C exp(ε Σ_j a_ij log(Cᵀ E_j)) with E_j = Γ_ij q_local,i*: line 8 of Algorithm 2, moved to the frames

        Returns:
            Root mean square of the angles to the neighbours' frames [rad]; None, and no step, if nobody was heard.
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
