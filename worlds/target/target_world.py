"""A target in the plane whose velocity is a random walk, and sensors that each measure one coordinate of it.

Letters: x = (p_x, p_y, v_x, v_y) position [m] and velocity [m/s]; Δ time between samples [s]; q density of the white
acceleration [m²/s³], the square of `manoeuvre`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ...randomness import Stream, stream
from ...units import check_above_zero, period_ns

COORDINATES = ("x", "y")
"""Names of the sensors, in the order of the coordinates."""
_SIZE = 4


@lru_cache(maxsize=64)
def transition(period_s: float) -> NDArray[np.float64]:
    """A, shape (4, 4): p⁺ = p + Δ v, v⁺ = v            Bar-Shalom, Li and Kirubarajan 2001, Sec. 6.2.2."""
    matrix = np.eye(_SIZE)
    matrix[0, 2] = matrix[1, 3] = period_s
    matrix.flags.writeable = False
    return matrix


@lru_cache(maxsize=64)
def process_noise(period_s: float, manoeuvre: float) -> NDArray[np.float64]:
    """Q, shape (4, 4): for each coordinate q [[Δ³/3, Δ²/2], [Δ²/2, Δ]], white acceleration through one period.

    Bar-Shalom, Li and Kirubarajan 2001, (6.2.2-12)

    Args:
        period_s: Δ.
        manoeuvre: √q, random walk of the velocity [m/s/√s].
    """
    one = [[period_s**3 / 3, period_s**2 / 2], [period_s**2 / 2, period_s]]
    matrix = np.asarray(manoeuvre**2 * np.kron(one, np.eye(2)), dtype=np.float64)
    matrix.flags.writeable = False
    return matrix


@dataclass(frozen=True)
class TargetModel:
    """What is known of a target beforehand; see `TargetWorld` for the fields."""

    rate: float
    manoeuvre: float
    noise: float
    position: float
    velocity: float


@dataclass(frozen=True)
class TargetWorld:
    """A target and its sensors; all is a pure function of seed and time.

    `sees`: agent → "x" or "y"; others see nothing. At the beginning position and velocity are normal about zero with
    standard deviations `position` [m] and `velocity` [m/s] in each coordinate. Between samples the target keeps the
    velocity that it had at the last one.

    Raises:
        BadInput: a rate or noise not above 0, another size below 0, or no sensor.
    """

    sees: Mapping[str, str]
    seed: int
    rate: float
    manoeuvre: float
    noise: float
    position: float
    velocity: float

    def __post_init__(self) -> None:
        """Check the bounds, and that there is a sensor."""
        check_above_zero("rate", self.rate, "Hz")
        if not self.noise > 0.0:
            raise BadInput(f"noise is {self.noise:g} m, it must be above 0: filters weigh measurements by it")
        for name in ("manoeuvre", "position", "velocity"):
            if getattr(self, name) < 0.0:
                raise BadInput(f"{name} is {getattr(self, name):g}, it must be at least 0")
        if not self.sees:
            raise BadInput("nobody sees anything of the target: let one agent at least see x or y")

    @property
    def period_s(self) -> float:
        """Δ, between samples [s]."""
        return 1.0 / self.rate

    @property
    def model(self) -> TargetModel:
        """What agents know of it beforehand."""
        return TargetModel(self.rate, self.manoeuvre, self.noise, self.position, self.velocity)

    def sensors(self, agent: str) -> Mapping[str, float]:
        """Coordinate that an agent measures, if any, and its rate [Hz]."""
        return {self.sees[agent]: self.rate} if agent in self.sees else {}

    def measure(self, agent: str, sensor: str, index: int) -> NDArray[np.float64] | None:
        """The coordinate at the index-th sample with noise, shape (1,) [m].

        Raises:
            BadInput: that agent has no such sensor.
        """
        if self.sees.get(agent) != sensor:
            raise BadInput(f"agent {agent} has no sensor {sensor!r}: it sees {self.sees.get(agent, 'nothing')}")
        coordinate = self.state(index)[COORDINATES.index(sensor)]
        return np.array([coordinate + self.noise * _noise(self.seed, agent).normal(index)])

    def state(self, index: int) -> NDArray[np.float64]:
        """The true (p_x, p_y, v_x, v_y) at a sample, shape (4,)."""
        return _path(self.seed, self.period_s, self.manoeuvre, self.position, self.velocity).state(index)

    def truth(self, time_ns: int) -> NDArray[np.float64]:
        """The true state at an instant, shape (4,)."""
        index = int(time_ns * self.rate / 1e9)
        while period_ns(self.rate, index + 1) <= time_ns:
            index += 1
        while index > 0 and period_ns(self.rate, index) > time_ns:
            index -= 1
        since_s = (time_ns - period_ns(self.rate, index)) * 1e-9
        moved: NDArray[np.float64] = transition(since_s) @ self.state(index) if since_s else self.state(index)
        return moved


class _Path:
    """States at the samples, each computed from the one before on demand."""

    def __init__(self, seed: int, period_s: float, manoeuvre: float, spread: tuple[float, float]) -> None:
        self._draws = stream(seed, "target")
        self._A = transition(period_s)
        Q = process_noise(period_s, manoeuvre)
        self._factor = np.linalg.cholesky(Q) if manoeuvre else Q
        self._states = [np.repeat(spread, 2) * self._normal(0)]

    def state(self, index: int) -> NDArray[np.float64]:
        while len(self._states) <= index:
            noise = self._factor @ self._normal(len(self._states))
            self._states.append(self._A @ self._states[-1] + noise)
        return self._states[index].copy()

    def _normal(self, index: int) -> NDArray[np.float64]:
        return np.array([self._draws.normal(_SIZE * index + component) for component in range(_SIZE)])


@lru_cache(maxsize=8)
def _path(seed: int, period_s: float, manoeuvre: float, position: float, velocity: float) -> _Path:
    """Path of a world; cached because each state follows from the one before."""
    return _Path(seed, period_s, manoeuvre, (position, velocity))


@lru_cache(maxsize=4096)
def _noise(seed: int, agent: str) -> Stream:
    return stream(seed, "target noise", agent)
