"""Options for a part of a run: a span of time, and names."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Annotated

from cyclopts import Parameter

from ...errors import BadInput
from ...names import did_you_mean
from ...units import parse, quantity
from ..record.record import Record

From = Annotated[str | None, Parameter("--from", help="Start of the window, e.g. 2s.")]
Until = Annotated[str | None, Parameter("--until", help="End of the window, e.g. 3s (excluded).")]


@Parameter(name="*")
@dataclass(frozen=True)
class SpanOptions:
    """A span of nominal time, by default the whole run."""

    from_: From = None
    until: Until = None

    def bounds(self, record: Record) -> tuple[int | None, int | None]:
        """The bounds of the span [ns], None where not given.

        Raises:
            BadInput: not an instant, after the end of the run, or the end before the start.
        """
        from_ns = None if self.from_ is None else instant("--from", self.from_)
        until_ns = None if self.until is None else instant("--until", self.until)
        if from_ns is not None and from_ns >= record.last_ns:
            raise BadInput(f"--from {self.from_}: the run ends at {quantity(record.last_ns, 'ns')}")
        if until_ns is not None and until_ns <= (from_ns or 0):
            raise BadInput(f"--until {self.until} is not after --from {self.from_ or '0 s'}")
        return from_ns, until_ns


WHOLE = SpanOptions()


def instant(option: str, text: str) -> int:
    """The instant of an option's text [ns].

    Raises:
        BadInput: not a time with a unit; the message names the option.
    """
    try:
        return int(parse(text, "ns"))
    except BadInput as error:
        raise BadInput(f"{option}: {error}") from error


def listed(words: Iterable[str]) -> list[str]:
    """The words of a repeatable option, each a list separated by commas."""
    return [part.strip() for word in words for part in word.split(",") if part.strip()]


def known(option: str, words: Sequence[str], names: Iterable[str]) -> list[str]:
    """The words of an option, checked to be among the names.

    Raises:
        BadInput: an unknown word; the message has the nearest name.
    """
    there = list(names)
    found = listed(words)
    for word in found:
        if word not in there:
            raise BadInput(f"{option} {word}: there is none{did_you_mean(word, there)}")
    return found
