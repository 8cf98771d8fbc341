"""Disturbances of vehicles by the air, as accelerations [m/s²]: turbulence of each, and gusts common to all."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ...randomness import stream
from ...units import Duration, MetresPerSecondSquared, Period, Seconds, check_above_zero

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Turbulence:
    """An Ornstein–Uhlenbeck acceleration per vehicle and axis.

    ȧ = −a/T + √(2/T) σ ξ with white noise ξ: standard deviation σ, correlation e^(−t/T).

    Attributes:
        acceleration: σ on each horizontal axis [m/s²].
        correlation: T [s].
        vertical: fraction of σ that acts vertically; small, because such vehicles control their height with a
            sensor of their own.

    Raises:
        BadInput: σ or the share below 0, or T not above 0.
    """

    acceleration: MetresPerSecondSquared = 0.6
    correlation: Seconds = 0.5
    vertical: float = 0.1

    def __post_init__(self) -> None:
        """Check the bounds."""
        if not 0.0 <= self.acceleration < math.inf:
            raise BadInput(f"turbulence.acceleration is {self.acceleration:g} m/s², it must be at least 0")
        check_above_zero("turbulence.correlation", self.correlation, "s")
        if not 0.0 <= self.vertical < math.inf:
            raise BadInput(f"turbulence.vertical is {self.vertical:g}, it must be at least 0")


class Swirl:
    """State of the turbulence: exact discretisation on a time grid, starting from the stationary distribution."""

    def __init__(self, turbulence: Turbulence, seed: int, agents: Sequence[str]) -> None:
        self._turbulence = turbulence
        self._streams = [stream(seed, "turbulence", agent) for agent in agents]
        self._index = 0
        self._spread = turbulence.acceleration * np.array([[1.0], [1.0], [turbulence.vertical]])
        self.value: Floats = self._spread * self._normals()

    def advance(self, dt_ns: int) -> None:
        """Advance by a step: a⁺ = φ a + σ √(1 − φ²) n, with φ = e^(−dt/T) and n standard normal."""
        if self._turbulence.acceleration > 0.0:
            kept = math.exp(-dt_ns * 1e-9 / self._turbulence.correlation)
            self.value = kept * self.value + math.sqrt(1.0 - kept * kept) * self._spread * self._normals()

    def _normals(self) -> Floats:
        first = 3 * self._index
        self._index += 1
        return np.array([each.normals(first, 3) for each in self._streams]).T


@dataclass(frozen=True)
class Gust:
    """A temporary acceleration of all vehicles [m/s²].

    start: of the gust.
    duration: of the gust.
    acceleration: north, west and up.

    Raises:
        BadInput: a duration that is not above 0, or a start before 0.
    """

    start_ns: Duration
    duration_ns: Period
    acceleration: tuple[MetresPerSecondSquared, MetresPerSecondSquared, MetresPerSecondSquared]

    def __post_init__(self) -> None:
        """Check the bounds."""
        if self.start_ns < 0 or self.duration_ns <= 0:
            raise BadInput(
                f"a gust from {self.start_ns} ns for {self.duration_ns} ns: it starts at 0 or later and lasts a while"
            )


class Gusts(Protocol):
    """A sequence of gusts."""

    def all(self, seed: int) -> Iterator[Gust]:
        """All gusts in the order of their starts, possibly infinitely many."""


@dataclass(frozen=True)
class Scripted:
    """Given gusts."""

    gusts: tuple[Gust, ...] = ()

    def all(self, seed: int) -> Iterator[Gust]:
        """In the order of their starts."""
        return iter(sorted(self.gusts, key=lambda gust: gust.start_ns))


@dataclass(frozen=True)
class Random:
    """Random gusts: exponential times with mean `every_ns` between their starts, horizontal, in random directions.

    every: mean time between two starts.
    duration: of each.
    acceleration: of each.

    Raises:
        BadInput: a time that is not above 0, or an acceleration below 0.
    """

    every_ns: Period
    duration_ns: Period
    acceleration: MetresPerSecondSquared

    def __post_init__(self) -> None:
        """Check the bounds."""
        if self.every_ns <= 0 or self.duration_ns <= 0:
            raise BadInput(f"gusts every {self.every_ns} ns for {self.duration_ns} ns: both must be above 0")
        if not 0.0 <= self.acceleration < math.inf:
            raise BadInput(f"gusts.acceleration is {self.acceleration:g} m/s², it must be at least 0")

    def all(self, seed: int) -> Iterator[Gust]:
        """Infinitely many."""
        draws = stream(seed, "gusts")
        start_ns = 0
        for index in count():
            start_ns += 1 + round(-self.every_ns * math.log(draws.uniform(2 * index)))
            angle = 2.0 * math.pi * draws.uniform(2 * index + 1)
            level = (self.acceleration * math.cos(angle), self.acceleration * math.sin(angle), 0.0)
            yield Gust(start_ns, self.duration_ns, level)


class Weather:
    """Mean accelerations by gusts over spans of time whose starts never go back."""

    def __init__(self, gusts: Gusts, seed: int) -> None:
        self._coming = gusts.all(seed)
        self._next = next(self._coming, None)
        self._known: list[Gust] = []

    def mean(self, from_ns: int, until_ns: int) -> Floats:
        """Mean acceleration over a span, so that a gust's whole impulse arrives however time is cut, (3,) [m/s²].

        Of a span without length it is the value at that instant.
        """
        until_ns = max(until_ns, from_ns + 1)
        while self._next is not None and self._next.start_ns < until_ns:
            self._known.append(self._next)
            self._next = next(self._coming, None)
        total = np.zeros(3)
        for gust in self._known:
            shared = min(until_ns, gust.start_ns + gust.duration_ns) - max(from_ns, gust.start_ns)
            if shared > 0:
                total += np.array(gust.acceleration) * (shared / (until_ns - from_ns))
        return total

    def forget(self, before_ns: int) -> None:
        """Drop the gusts that ended before an instant, which are not needed again."""
        self._known = [gust for gust in self._known if gust.start_ns + gust.duration_ns > before_ns]
