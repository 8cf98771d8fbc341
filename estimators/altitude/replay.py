"""Out-of-sequence measurements: a filter keeps a short history and replays it from where a late one belongs."""

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
    """A measurement: the time it was taken, its sensor, and its values (m,).

    `stamp_ns`: the sensor's own stamp, by which copies are recognised, where that is later than `time_ns` because the
    sensor's clock is ahead.
    """

    time_ns: int
    source: str
    values: NDArray[np.float64]
    stamp_ns: int | None = None

    @property
    def identity(self) -> tuple[int, str]:
        """Stamp and source; a source takes at most one measurement at an instant of its clock."""
        return (self.time_ns if self.stamp_ns is None else self.stamp_ns), self.source

    @property
    def key(self) -> tuple[int, str, int]:
        """Sort key of measurements."""
        return self.time_ns, self.source, self.identity[0]


class Replay(Generic[Belief]):
    """The belief after all measurements so far, used in the order of their time stamps.

    A late measurement is inserted where it belongs, and the later ones are applied again. As long as none is too old,
    the belief does not depend on the order of arrival, to the last bit.

    Args:
        start: the initial belief.
        start_ns: its instant; measurements taken before it are too old.
        step: maps a belief and a measurement to the next belief.
        window_ns: how long measurements are kept, counted back from the newest stamp; older ones are too old.
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
        self._known: set[tuple[int, str]] = set()

    @property
    def latest(self) -> Belief:
        """The belief after the measurement with the newest stamp."""
        return self._after[-1] if self._after else self._base

    def take(self, measurement: Stamped) -> Outcome:
        """Use a measurement, and return how it was used."""
        if measurement.time_ns < self._from_ns:
            return "too old"
        if measurement.identity in self._known:
            return "repeated"
        self._known.add(measurement.identity)
        place = bisect_left(self._kept, measurement.key, key=_key)
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
        count = bisect_left(self._kept, (before_ns, "", 0), key=_key)
        if count:
            self._base = self._after[count - 1]
            del self._kept[:count], self._after[:count]
            self._known = {(stamp_ns, source) for stamp_ns, source in self._known if stamp_ns >= before_ns}


def _key(measurement: Stamped) -> tuple[int, str, int]:
    return measurement.key
