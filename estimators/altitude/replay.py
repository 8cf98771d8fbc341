"""A filter that takes measurements in whatever order they come: a short history that is replayed."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput

Belief = TypeVar("Belief")
Outcome = Literal["in order", "replayed", "repeated", "too old"]


@dataclass(frozen=True, slots=True)
class Stamped:
    """A measurement: when it was taken, by what, and its values (m,)."""

    time_ns: int
    source: str
    values: NDArray[np.float64]

    @property
    def key(self) -> tuple[int, str]:
        """The order in which measurements are used; there is one of a source at an instant."""
        return self.time_ns, self.source


class Replay(Generic[Belief]):
    """What is believed after all measurements so far, used in the order of their stamps.

    A measurement that comes after later ones is put where it belongs, and the later ones are used again. As long as
    none is too old, what is believed does not depend on the order in which they came, to the last bit.

    Args:
        start: what is believed at first.
        start_ns: of what instant that is; what was taken before it comes too late.
        step: what is believed after a measurement.
        window_ns: how far back measurements are kept, counted from the newest stamp; what is older comes too late.
    Raises:
        BadInput: a window below 0.
    """

    def __init__(self, start: Belief, start_ns: int, step: Callable[[Belief, Stamped], Belief], window_ns: int) -> None:
        if window_ns < 0:
            raise BadInput(f"a history of {window_ns} ns is kept: it must be at least 0")
        self._step = step
        self._window_ns = window_ns
        self._base = start
        self._from_ns = start_ns
        self._kept: list[Stamped] = []
        self._after: list[Belief] = []

    @property
    def latest(self) -> Belief:
        """After the measurement with the newest stamp."""
        return self._after[-1] if self._after else self._base

    def take(self, measurement: Stamped) -> Outcome:
        """Use a measurement; what became of it."""
        if measurement.time_ns < self._from_ns:
            return "too old"
        place = bisect_left(self._kept, measurement.key, key=_key)
        if place < len(self._kept) and self._kept[place].key == measurement.key:
            return "repeated"
        self._kept.insert(place, measurement)
        belief = self._after[place - 1] if place else self._base
        del self._after[place:]
        for later in self._kept[place:]:
            belief = self._step(belief, later)
            self._after.append(belief)
        in_order = place == len(self._kept) - 1
        self._forget(self._kept[-1].time_ns - self._window_ns)
        return "in order" if in_order else "replayed"

    def _forget(self, before_ns: int) -> None:
        self._from_ns = max(self._from_ns, before_ns)
        count = bisect_left(self._kept, (before_ns, ""), key=_key)
        if count:
            self._base = self._after[count - 1]
            del self._kept[:count], self._after[:count]


def _key(measurement: Stamped) -> tuple[int, str]:
    return measurement.key
