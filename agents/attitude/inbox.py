"""Messages that a unit has received and not yet used: each is used at most once, and none that is too old."""

from __future__ import annotations

from collections.abc import Collection

from ..sample_counts import age
from .attitude_unit_settings import UnitMessage


class Inbox:
    """Messages that wait for a round.

    A round uses each neighbour's message of the previous sample, or else the newest that is at most `max_age` samples
    old. A message of the round's own sample, from a neighbour with an earlier phase, waits for the next round. One that
    is further ahead comes from a clock that is ahead, and is used.

    `used`, `late` and `ahead` count messages: used, too old, and used though ahead.
    """

    def __init__(self, max_age: int) -> None:
        self._max_age = max_age
        self._waiting: dict[str, dict[int, UnitMessage]] = {}
        self._last: dict[str, int] = {}
        self.used = self.late = self.ahead = 0

    def put(self, source: str, message: UnitMessage) -> None:
        """Keep a message; a second copy replaces the first."""
        self._waiting.setdefault(source, {})[message.count] = message

    def take(self, count: int, sources: Collection[str]) -> dict[str, UnitMessage]:
        """Messages for the round of a sample: neighbour → message, of the given neighbours only."""
        found = {}
        for source, waiting in self._waiting.items():
            ages = {tag: age(count, tag) for tag in waiting if self._is_news(source, tag, count)}
            usable = [tag for tag, behind in ages.items() if behind != 0 and behind <= self._max_age]
            if usable and source in sources:
                best = min(usable, key=lambda tag: abs(ages[tag] - 1))
                found[source] = waiting[best]
                self._last[source] = best
                self.used += 1
                self.ahead += ages[best] < 0
            self.late += sum(behind > self._max_age for behind in ages.values())
        self._waiting = {
            source: {tag: message for tag, message in waiting.items() if age(count, tag) == 0}
            for source, waiting in self._waiting.items()
        }
        return found

    def _is_news(self, source: str, tag: int, count: int) -> bool:
        """Whether a message is newer than the last one used, or that one came from a clock that was ahead."""
        last = self._last.get(source)
        return last is None or age(tag, last) > 0 or (tag != last and age(count, last) < 0)
