"""Messages between vehicles of a formation, and propagation of old messages to now.

Their encoding is in `agents.mav`.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .filter import Observation
from .model import NANOSECOND, FormationModel


@dataclass(frozen=True)
class PairMessage:
    """The sender's estimate of the pair that its camera tracks.

    sender, seen: the vehicles; the values are p_sender − p_seen and its velocity.
    time_ns: the instant of the values [ns].
    values: shape (6,) [m, m/s], inertial frame.
    unseen_ns: time since the sender last saw the vehicle, at that instant [ns].
    attitude: the sender's, body → inertial, scalar first, shape (4,), or None.
    covariance: of the values, or an upper bound of it, shape (6, 6), or None.
    """

    sender: int
    seen: int
    time_ns: int
    values: NDArray[np.float64]
    unseen_ns: int = 0
    attitude: NDArray[np.float64] | None = None
    covariance: NDArray[np.float64] | None = None

    @cached_property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """The pair of the message."""
        return ((self.sender, self.seen),)

    def relative(self, vehicles: NDArray[np.float64]) -> NDArray[np.float64]:
        """Difference, shape (k, 3), for the pair of the message, of quantities of all vehicles, shape (k, N, 3)."""
        return vehicles[:, self.sender] - vehicles[:, self.seen]


@dataclass(frozen=True)
class FullMessage:
    """The sender's whole estimate.

    sender: the vehicle.
    time_ns: the instant of the estimate [ns].
    values: x̂ in the paper's order, shape (6(N−1),) [m, m/s].
    covariance: of the values, or an upper bound of it, or None.
    """

    sender: int
    time_ns: int
    values: NDArray[np.float64]
    covariance: NDArray[np.float64] | None = None
    unseen_ns: int = 0

    @cached_property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """The pairs of each vehicle and the next."""
        return tuple((i, i + 1) for i in range(len(self.values) // 6))

    def relative(self, vehicles: NDArray[np.float64]) -> NDArray[np.float64]:
        """Differences of the pairs, shape (k, 3(N−1)), of quantities of all vehicles, shape (k, N, 3)."""
        return (vehicles[:, :-1] - vehicles[:, 1:]).reshape(len(vehicles), -1)


Message = PairMessage | FullMessage


def bound_of(covariance: ArrayLike) -> tuple[float, float]:
    """Upper bound of a covariance by two numbers (σ_p, σ_v) [m, m/s]: P ≤ diag(σ_p² I₃, σ_v² I₃).

    With a, b the largest eigenvalues of the position and the velocity block, and c ≤ 2 the largest of P scaled by them,
    σ_p² = c a and σ_v² = c b.

    Args:
        covariance: of a relative position and velocity, positive definite, shape (6, 6).
    """
    matrix = np.asarray(covariance, dtype=np.float64)
    position, velocity = np.linalg.eigvalsh(matrix[:3, :3])[-1], np.linalg.eigvalsh(matrix[3:, 3:])[-1]
    scale = np.sqrt(np.repeat([position, velocity], 3))
    common = np.linalg.eigvalsh(matrix / np.outer(scale, scale))[-1]
    return float(np.sqrt(common * position)), float(np.sqrt(common * velocity))


class History:
    """History of the effects of known forces, for propagating messages to now.

    Args:
        model: the dynamics.
        time_ns: start of the history [ns].
        span_ns: least length of the history [ns].
    """

    def __init__(self, model: FormationModel, time_ns: int, span_ns: int) -> None:
        self._mass_kg, self._span_ns = model.mass_kg, span_ns
        self._times: deque[int] = deque([time_ns])
        # Of each instant, shape (3, N, 3): what forces had added to positions and velocities since the beginning,
        # and the accelerations from then to the next instant.
        self._added: deque[NDArray[np.float64]] = deque([np.zeros((3, model.vehicles, 3))])

    @property
    def now_ns(self) -> int:
        """End of the history [ns]."""
        return self._times[-1]

    @property
    def oldest_ns(self) -> int:
        """Start of the history [ns]."""
        return self._times[0]

    def record(self, time_ns: int, forces: NDArray[np.float64]) -> None:
        """Append forces, shape (N, 3) [N], that were constant from the last instant until this one."""
        last = self._added[-1]
        np.divide(forces, self._mass_kg, out=last[2])
        grown = np.dot(_held((time_ns - self._times[-1]) * NANOSECOND), last.reshape(3, -1))
        self._times.append(time_ns)
        self._added.append(grown.reshape(last.shape))
        while len(self._times) > 2 and self._times[1] <= time_ns - self._span_ns:
            self._times.popleft()
            self._added.popleft()

    def added(self, message: Message) -> NDArray[np.float64]:
        """Change of positions and velocities of a message's pairs by the forces since its stamp, (2, 3m) [m, m/s].

        Exact for forces that are constant between the instants of the history, which must include the stamp.
        """
        if message.time_ns >= self._times[-1]:
            return np.zeros((2, len(message.values) // 2))
        at = bisect_right(self._times, message.time_ns) - 1
        into_s = (message.time_ns - self._times[at]) * NANOSECOND
        age_s = (self._times[-1] - message.time_ns) * NANOSECOND
        then = np.dot(_held(into_s)[:2], message.relative(self._added[at]))
        now: NDArray[np.float64] = message.relative(self._added[-1])[:2] - then
        now[0] -= age_s * then[1]
        return now


@lru_cache(maxsize=256)
def _held(seconds: float) -> NDArray[np.float64]:
    """Map from (positions, velocities, accelerations) to those after so long, with accelerations 0 thereafter."""
    return np.array([[1.0, seconds, seconds**2 / 2], [0.0, 1.0, seconds], [0.0, 0.0, 0.0]])


def run_forward(
    model: FormationModel, history: History, message: Message, covariance: NDArray[np.float64]
) -> Observation:
    """Propagate a message to now, as an observation: by the known forces, with process noise added.

    t⁺ = Φ t + Σ Φ B u,  N⁺ = Φ N Φᵀ + Q(age + unseen), with Φ over the age for the values, and over the time since the
    sender last saw the vehicle for the covariance.

    The unknown accelerations have changed the own prediction as well. An update that assumes independent errors is
    therefore overconfident, the more the older the message is; covariance intersection is not.

    Args:
        model: dynamics and noise.
        history: the forces since the message's stamp.
        message: not older than the history.
        covariance: N, of the message's values at its stamp, shape (6m, 6m).
    """
    age_ns = history.now_ns - message.time_ns
    now = history.added(message)
    told = message.values.reshape(-1, 2, 3).swapaxes(0, 1).reshape(2, -1)
    now += told
    now[0] += age_ns * NANOSECOND * told[1]
    stale_s = (age_ns + message.unseen_ns) * NANOSECOND
    told_of = model if isinstance(message, FullMessage) else model.pair
    transition = told_of.transition(stale_s)
    noise = transition.dot(covariance).dot(transition.T)
    noise += told_of.process_noise(stale_s)
    return Observation(message.pairs, now.reshape(2, -1, 3).swapaxes(0, 1).ravel(), noise)
