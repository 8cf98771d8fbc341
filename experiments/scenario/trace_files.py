"""Traces from CSV files: a column of times and one of recorded values, with units in the heading."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...errors import BadInput
from ...transport.latency_settings import LatencyTrace
from ...transport.loss_settings import LossTrace
from ...units import Nanoseconds, Period, parse

_IN_TIME = r"_(ns|us|[µμ]s|ms|s|min|h)"
_TRACE, _FILE = "trace", "file"


@dataclass(frozen=True)
class LossTraceText:
    """A trace of loss in a scenario: a file or, in a resolved scenario, its numbers.

    file: CSV file with columns such as `time_s` and `loss`.
    times: instants from which each of `losses` applies.
    losses: probabilities of loss.
    repeat: period after which the trace starts again.
    """

    file: str | None = None
    times: tuple[Nanoseconds, ...] | None = None
    losses: tuple[float, ...] | None = None
    repeat: Period | None = None

    def made(self) -> LossTrace:
        """The trace."""
        times, losses = _numbers(self.file, self.times, self.losses, "losses", "loss")
        return LossTrace(times, losses, self.repeat)


@dataclass(frozen=True)
class LatencyTraceText:
    """A trace of latency in a scenario: a file or, in a resolved scenario, its numbers.

    file: CSV file with columns such as `time_s` and `latency_ms`.
    times: instants from which each of `latencies` applies.
    latencies: latencies of frames whose airtime ends then.
    repeat: period after which the trace starts again.
    """

    file: str | None = None
    times: tuple[Nanoseconds, ...] | None = None
    latencies: tuple[Nanoseconds, ...] | None = None
    repeat: Period | None = None

    def made(self) -> LatencyTrace:
        """The trace."""
        times, latencies = _numbers(self.file, self.times, self.latencies, "latencies", "latency")
        return LatencyTrace(times, latencies, self.repeat)


STAND_INS: dict[type[Any], type[Any]] = {LossTrace: LossTraceText, LatencyTrace: LatencyTraceText}
"""Model → the settings from which it is read."""


def _numbers(
    file: str | None, times: tuple[int, ...] | None, values: Any, what: str, column: str
) -> tuple[tuple[int, ...], Any]:
    numbers = [name for name, given in (("times", times), (what, values)) if given is not None]
    if (file is not None) == bool(numbers):
        raise BadInput(f"write a file, or times and {what}: one of the two, not {'both' if numbers else 'neither'}")
    if file is not None:
        return read_trace(file, column)
    if times is None or values is None:
        raise BadInput(f"times and {what} belong together")
    return times, values


def read_trace(path: str, name: str) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """Times [ns] and values of a trace.

    Args:
        path: a CSV file with a heading: `time_s` or another unit, and `loss` or `latency_ms` or another unit; other
            columns are ignored.
        name: "loss" for probabilities, "latency" for durations [ns].
    Raises:
        BadInput: unreadable file, missing column, a cell that is no number, or descending times; with file and line.
    """
    try:
        with Path(path).open(encoding="utf-8-sig", newline="") as file:
            return _columns(csv.reader(file), path, name)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise BadInput(f"{path}: cannot be read as CSV: {getattr(error, 'strerror', None) or error}") from error


def _columns(rows: Any, path: str, name: str) -> tuple[tuple[int, ...], tuple[float, ...]]:
    heading = [cell.strip() for cell in next(rows, [])]
    (when, time_unit), (where, unit) = _column(path, heading, "time"), _column(path, heading, name)
    times: list[int] = []
    values: list[float] = []
    for row in rows:
        if not any(cell.strip() for cell in row):
            continue
        place = f"{path}:{rows.line_num}"
        if len(row) <= max(when, where):
            raise BadInput(f"{place}: {len(row)} cells, the heading has {len(heading)}")
        times.append(_later(place, row[when].strip(), time_unit, times))
        values.append(_duration(place, row[where], unit) if unit else _probability(place, row[where]))
    if not times:
        raise BadInput(f"{path}: no line after the heading")
    return tuple(times), tuple(values)


def _later(place: str, text: str, unit: str, before: Sequence[int]) -> int:
    """The time of a row, checked: the first is 0, each later than the one before."""
    time_ns = _duration(place, text, unit)
    if not before and time_ns:
        raise BadInput(f"{place}: the first time is {text} {unit}: start with 0, so that something holds before")
    if before and time_ns <= before[-1]:
        raise BadInput(
            f"{place}: time {text} {unit} is not after the one before, {before[-1] / 1e9:g} s: "
            "put the lines in order of time, each instant once"
        )
    return time_ns


def _column(path: str, heading: Sequence[str], name: str) -> tuple[int, str]:
    """Index and unit of a column; a probability has none."""
    pattern = re.compile("loss" if name == "loss" else f"{name}{_IN_TIME}")
    found = [(index, match) for index, cell in enumerate(heading) if (match := pattern.fullmatch(cell))]
    if len(found) != 1:
        wanted = "loss" if name == "loss" else f"{name}_s, {name}_ms or another unit of time"
        raise BadInput(f"{path}:1: one column should be {wanted}; the heading is {', '.join(heading) or 'empty'}")
    index, match = found[0]
    return index, match[1] if match.groups() else ""


def _duration(place: str, text: str, unit: str) -> int:
    try:
        duration = int(parse(f"{text} {unit}", "ns"))
    except BadInput as error:
        raise BadInput(f"{place}: {text.strip()!r} is no number") from error
    if duration < 0:
        raise BadInput(f"{place}: {text.strip()} {unit} is below 0")
    return duration


def _probability(place: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError as error:
        raise BadInput(f"{place}: {text.strip()!r} is no number") from error
    if not 0.0 <= value <= 1.0:
        raise BadInput(f"{place}: loss is {text.strip()}, a probability lies between 0 and 1")
    return value


def anchor(node: Any, folder: Callable[[tuple[str, ...]], Path], place: tuple[str, ...] = ()) -> list[Path]:
    """Make the paths of trace files in plain data absolute, in place.

    Args:
        node: a mapping or list.
        folder: the folder to which the path at a place is relative.
        place: place of the node.
    Returns:
        The paths.
    """
    files: list[Path] = []
    for key, child in _children(node):
        below = (*place, str(key))
        if isinstance(child, str) and (key == _TRACE or (key == _FILE and place[-1:] == (_TRACE,))):
            files.append(folder(below) / Path(child).expanduser())
            node[key] = str(files[-1])
        else:
            files += anchor(child, folder, below)
    return files


def _children(node: Any) -> Iterator[tuple[Any, Any]]:
    if isinstance(node, dict):
        yield from list(node.items())
    elif isinstance(node, list):
        yield from enumerate(node)
