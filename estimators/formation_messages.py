"""What vehicles of a formation tell each other, and how a message that is old is run forward to now.

How a message looks on the air, and what it weighs there, is the business of `agents.mav_messages`.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .formation_filter import Observation
from .formation_model import NANOSECOND, FormationModel


@dataclass(frozen=True)
class PairMessage:
    """What the sender's filter says of the pair that its camera keeps in view.

    sender, seen: the vehicles; the values are p_sender − p_seen and its velocity.
    time_ns: the instant that the values hold for [ns].
    values: shape (6,) [m, m/s], inertial frame.
    unseen_ns: how long before that instant the sender last saw the vehicle [ns].
    attitude: the sender's, body→inertial, scalar first, shape (4,), or None.
    covariance: of the values, or a bound of it, shape (6, 6), or None.
    """

    sender: int
    seen: int
    time_ns: int
    values: NDArray[np.float64]
    unseen_ns: int = 0
    attitude: NDArray[np.float64] | None = None
    covariance: NDArray[np.float64] | None = None

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """The one pair that is told."""
        return ((self.sender, self.seen),)


@dataclass(frozen=True)
class FullMessage:
    """The sender's whole estimate.

    sender: the vehicle.
    time_ns: the instant that the estimate holds for [ns].
    values: x̂ in the paper's order, shape (6(N−1),) [m, m/s].
    covariance: of the values, or a bound of it, or None.
    """

    sender: int
    time_ns: int
    values: NDArray[np.float64]
    covariance: NDArray[np.float64] | None = None
    unseen_ns: int = 0

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """Every vehicle and the next."""
        return tuple((i, i + 1) for i in range(len(self.values) // 6))


Message = PairMessage | FullMessage


def bound_of(covariance: ArrayLike) -> tuple[float, float]:
    """A covariance in two numbers that is never too small: (σ_p, σ_v) [m, m/s], P ≤ diag(σ_p² I₃, σ_v² I₃).

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
    """What the known forces did of late: enough to run any message that is not older forward to now.

    Args:
        model: the dynamics.
        time_ns: the beginning [ns].
        span_ns: how far back it reaches, at least [ns].
    """

    def __init__(self, model: FormationModel, time_ns: int, span_ns: int) -> None:
        self._model, self._span_ns = model, span_ns
        self._times: deque[int] = deque([time_ns])
        nothing = np.zeros((model.vehicles, 3))
        self._accelerations: deque[NDArray[np.float64]] = deque()  # from each instant to the next
        self._velocities: deque[NDArray[np.float64]] = deque([nothing])  # what the forces added since the beginning
        self._places: deque[NDArray[np.float64]] = deque([nothing])

    @property
    def now_ns(self) -> int:
        """The instant up to which forces are known [ns]."""
        return self._times[-1]

    @property
    def oldest_ns(self) -> int:
        """The instant from which on they are [ns]."""
        return self._times[0]

    def record(self, time_ns: int, forces: NDArray[np.float64]) -> None:
        """Note that these forces, shape (N, 3) [N], were held since the last instant until this one."""
        held_s = (time_ns - self._times[-1]) * NANOSECOND
        acceleration = forces / self._model.mass_kg
        velocity, place = self._velocities[-1], self._places[-1]
        self._times.append(time_ns)
        self._accelerations.append(acceleration)
        self._velocities.append(velocity + held_s * acceleration)
        self._places.append(place + held_s * velocity + held_s**2 / 2 * acceleration)
        while len(self._times) > 2 and self._times[1] <= time_ns - self._span_ns:
            for held in (self._times, self._accelerations, self._velocities, self._places):
                held.popleft()

    def moved(self, since_ns: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """What the forces have added since an instant to positions and velocities, each shape (N, 3) [m], [m/s].

        Exact for forces that are held from each instant of the record to the next; `since_ns` lies within it.
        """
        if since_ns >= self._times[-1]:
            return np.zeros_like(self._places[-1]), np.zeros_like(self._places[-1])
        at = bisect_right(self._times, since_ns) - 1
        into_s = (since_ns - self._times[at]) * NANOSECOND
        acceleration = self._accelerations[at]
        velocity = self._velocities[at] + into_s * acceleration
        place = self._places[at] + into_s * self._velocities[at] + into_s**2 / 2 * acceleration
        age_s = (self._times[-1] - since_ns) * NANOSECOND
        return self._places[-1] - place - age_s * velocity, self._velocities[-1] - velocity


def run_forward(
    model: FormationModel, history: History, message: Message, covariance: NDArray[np.float64]
) -> Observation:
    """A message as an observation of now: moved by the known forces, and less certain by what nobody knows.

    t⁺ = Φ t + Σ Φ B u,  N⁺ = Φ N Φᵀ + Q(age + unseen), with Φ over the age for the values, and over the time since the
    sender last saw the vehicle for the covariance.

    Args:
        model: dynamics and noise.
        history: the forces since the message's instant.
        message: not older than the history.
        covariance: N, of the message's values at its instant, shape (6m, 6m).
    """
    age_ns = history.now_ns - message.time_ns
    places, velocities = history.moved(message.time_ns)
    told = message.values.reshape(-1, 2, 3)
    first, second = (list(side) for side in zip(*message.pairs, strict=True))
    now = np.empty_like(told)
    now[:, 0] = told[:, 0] + age_ns * NANOSECOND * told[:, 1] + places[first] - places[second]
    now[:, 1] = told[:, 1] + velocities[first] - velocities[second]
    stale_s = (age_ns + message.unseen_ns) * NANOSECOND
    spread = covariance.reshape(len(told), 2, 3, -1).copy()
    spread[:, 0] += stale_s * spread[:, 1]
    spread = spread.reshape(len(covariance), len(told), 2, 3)
    spread[:, :, 0] += stale_s * spread[:, :, 1]
    noise = spread.reshape(covariance.shape) + _unknown(model, len(told), stale_s)
    return Observation(message.pairs, now.ravel(), (noise + noise.T) / 2)


def _unknown(model: FormationModel, count: int, duration_s: float) -> NDArray[np.float64]:
    """Process noise of one pair, or of all of a chain."""
    if count == model.vehicles - 1:
        return model.process_noise(duration_s)
    position, cross, velocity = model.noise_of(duration_s)
    shared: NDArray[Any] = np.kron([[2 * position, 2 * cross], [2 * cross, 2 * velocity]], np.eye(3))
    return shared
