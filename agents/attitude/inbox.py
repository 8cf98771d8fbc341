"""What a unit's neighbours have told it and it has not yet used: each message at most once, none that is too old."""

from __future__ import annotations

from collections.abc import Collection

from .attitude_unit_settings import COUNTS, Told


class Inbox:
    """Messages that wait for a round.

    A round uses of each neighbour what it told after the sample before, or else the newest that is at most `max_age`
    samples old. What was told after the sample of the round itself, by a neighbour that is early in its period, waits
    for the next one. Counts that are further ahead come from a clock that is: they are used, as nobody knows better.

    `used`, `late` and `ahead` count the messages: used, too old when they came or left over, and used though ahead.
    """

    def __init__(self, max_age: int) -> None:
        self._max_age = max_age
        self._waiting: dict[str, dict[int, Told]] = {}
        self._last: dict[str, int] = {}
        self.used = self.late = self.ahead = 0

    def put(self, source: str, told: Told) -> None:
        """Keep a message; a second copy of it replaces the first."""
        self._waiting.setdefault(source, {})[told.count] = told

    def take(self, count: int, sources: Collection[str]) -> dict[str, Told]:
        """What is used in the round of a sample: neighbour → its message, of these neighbours only."""
        found = {}
        for source, waiting in self._waiting.items():
            ages = {tag: _age(count, tag) for tag in waiting if self._is_news(source, tag, count)}
            usable = [tag for tag, age in ages.items() if age != 0 and age <= self._max_age]
            if usable and source in sources:
                best = min(usable, key=lambda tag: abs(ages[tag] - 1))
                found[source] = waiting[best]
                self._last[source] = best
                self.used += 1
                self.ahead += ages[best] < 0
            self.late += sum(age > self._max_age for age in ages.values())
        self._waiting = {
            source: {tag: told for tag, told in waiting.items() if _age(count, tag) == 0}
            for source, waiting in self._waiting.items()
        }
        return found

    def _is_news(self, source: str, tag: int, count: int) -> bool:
        """Whether a message is newer than what was used last, or that came from a clock that was ahead."""
        last = self._last.get(source)
        return last is None or _age(tag, last) > 0 or (tag != last and _age(count, last) < 0)


def _age(count: int, tag: int) -> int:
    """How many samples a count is behind, negative if it is ahead; counts start again at COUNTS."""
    behind = (count - tag) % COUNTS
    return behind if behind < COUNTS // 2 else behind - COUNTS
