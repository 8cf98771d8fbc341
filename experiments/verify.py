"""Certification: a recorded run is replayed in the twin, live faults and external kills included, and compared."""

from __future__ import annotations

import math
import struct
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

from ..agents.code_by_value import OtherPython
from ..agents.journal import LAST_HEARD, MISSED, Batch
from ..topologies import natural_key
from .record.machine import differences, libraries
from .record.plan_file import read_plan
from .record.record import Collector, Life, Record, load
from .twin import LastHeard, Twin

_TOLERANCE = 1e-9
_NAMED_CAUSES = _NAMED_AGENTS = 8


class Departure(NamedTuple):
    """An estimate, or a frame at one end of its link, that differs between record and replay.

    time_ns: nominal time.
    what: description.
    agent: the agent that recorded it.
    frame: source, target, incarnation, sequence number and copy; None for an estimate.
    """

    time_ns: int
    what: str
    agent: str
    frame: tuple[str, str, int, int, int] | None


@dataclass(frozen=True)
class Verdict:
    """The result of the comparison.

    certified: whether every recorded estimate and every frame's fate equals the replay, bit for bit.
    lines: description, to be printed.
    """

    certified: bool
    lines: tuple[str, ...]

    def __repr__(self) -> str:
        return "\n".join(self.lines)

    @property
    def exit_code(self) -> int:
        """0 if certified, else 3."""
        return 0 if self.certified else 3


def verify(folder: Path) -> Verdict:
    """Replay the run in a folder and compare.

    Raises:
        BadInput: no run there, or a damaged record.
    """
    try:
        plan = read_plan(folder)
    except OtherPython as error:
        return Verdict(certified=False, lines=(f"not comparable here: {error}",))
    record = load(folder, plan, evaluated=False)
    elsewhere = differences(record.info, record.plan)
    replayed = replay(record)
    departures = sorted(compare(record, replayed, 0.0 if not elsewhere else _TOLERANCE), key=itemgetter(slice(2)))
    return _verdict(record, departures, elsewhere)


def replay(record: Record) -> Mapping[Life, Batch]:
    """The journals of the same plan in the twin, with the faults as they really were."""
    plan = replace(record.as_run, duration_ns=_duration_ns(record))
    collector = Collector()
    Twin(plan, collector, last_heard(record)).run()
    return collector.batches


def _duration_ns(record: Record) -> int:
    return record.plan.duration_ns if record.end_ns is None else record.end_ns


def last_heard(record: Record) -> LastHeard:
    """What the neighbours of an externally killed agent had received from it."""
    return {
        ((event["source"], event["incarnation"]), life): event["sent"]
        for life, batch in record.batches.items()
        for event in batch.events
        if event["event"] == LAST_HEARD
    }


# -- comparison ---------------------------------------------------------------------------------------------------


_Entries = Mapping[tuple[Any, ...], tuple[int, Any]]
"""Name of an estimate or a frame → its nominal time and its content."""


def compare(record: Record, replayed: Mapping[Life, Batch], tolerance: float) -> Iterator[Departure]:
    """All differences; of an incarnation whose record broke off, only recorded entries are compared."""
    for life in sorted({*record.batches, *replayed}):
        mine, twin = record.batches.get(life, Batch(*life)), replayed.get(life, Batch(*life))
        broken_off = life in record.broken_off
        for key, recorded, expected in _unequal(_estimates(mine), _estimates(twin), tolerance, broken_off=broken_off):
            what = f"{_estimate_text(key, recorded)} recorded, {_estimate_text(key, expected)} in the twin"
            yield Departure(_first_ns(recorded, expected), f"agent {life[0]}: {what}", life[0], None)
        for key, recorded, expected in _unequal(_measured(mine), _measured(twin), tolerance, broken_off=broken_off):
            both = f"{_value_text(recorded)} recorded, {_value_text(expected)} in the twin"
            what = f"agent {life[0]} measured from frame {key[3]} from {key[0]}: {both}"
            yield Departure(_first_ns(recorded, expected), what, life[0], key)
        for did, to_or_from, entries in (("heard", "from", _heard), ("sent", "to", _sent)):
            for key, recorded, expected in _unequal(entries(mine), entries(twin), 0.0, broken_off=broken_off):
                peer = key[0] if did == "heard" else key[1]
                fates = f"{_fate_text(recorded)} recorded, {_fate_text(expected)} in the twin"
                what = f"agent {life[0]} {did} frame {key[3]} {to_or_from} {peer}: {fates}"
                yield Departure(_first_ns(recorded, expected), what, life[0], key)


def _unequal(
    mine: _Entries, twin: _Entries, tolerance: float, *, broken_off: bool
) -> Iterator[tuple[Any, tuple[int, Any] | None, tuple[int, Any] | None]]:
    """Entries that are not equal: name, entry of the record, entry of the twin."""
    for key in mine.keys() | twin.keys():
        recorded, expected = mine.get(key), twin.get(key)
        if not _same(recorded, expected, tolerance) and not (broken_off and recorded is None):
            yield key, recorded, expected


def _first_ns(*entries: tuple[int, Any] | None) -> int:
    return min(entry[0] for entry in entries if entry is not None)


def _estimates(batch: Batch) -> _Entries:
    """Estimates by quantity, sample, and number of earlier estimates of that sample."""
    counts: Counter[tuple[str, int]] = Counter()
    found: dict[tuple[Any, ...], tuple[int, Any]] = {}
    for time_ns, quantity, sample, value in batch.estimates:
        found[quantity, sample, counts[quantity, sample]] = (time_ns, value)
        counts[quantity, sample] += 1
    return found


def _measured(batch: Batch) -> _Entries:
    return {
        (one.source, batch.agent, one.incarnation, one.sequence, one.copy): (one.time_ns, one.value)
        for one in batch.measured
    }


def _heard(batch: Batch) -> _Entries:
    return {
        (heard.source, batch.agent, heard.incarnation, heard.sequence, heard.copy): (heard.due_ns, heard.fate)
        for heard in batch.heard
    }


def _sent(batch: Batch) -> _Entries:
    agent, life = batch.agent, batch.incarnation
    sent: dict[tuple[Any, ...], tuple[int, Any]] = {
        (agent, entry.target, life, entry.sequence, entry.copy): (entry.start_ns, entry[2:]) for entry in batch.sent
    }
    dropped = {(agent, one.target, life, one.sequence, 0): (one.time_ns, one.cause) for one in batch.dropped}
    return sent | dropped


def _same(recorded: tuple[int, Any] | None, expected: tuple[int, Any] | None, tolerance: float) -> bool:
    """Bit for bit, or within a tolerance; a NaN equals itself, and −0 is not 0."""
    if recorded is None or expected is None or not (isinstance(recorded[1], list) and isinstance(expected[1], list)):
        return recorded == expected
    (time_ns, value), (expected_ns, expected_value) = recorded, expected
    if time_ns != expected_ns or len(value) != len(expected_value):
        return False
    if tolerance:
        pairs = zip(value, expected_value, strict=True)
        return all(math.isclose(one, other, rel_tol=tolerance, abs_tol=tolerance) for one, other in pairs)
    return struct.pack(f"<{len(value)}d", *value) == struct.pack(f"<{len(value)}d", *expected_value)


def _estimate_text(key: tuple[Any, ...], entry: tuple[int, Any] | None) -> str:
    if entry is None:
        return "nothing"
    return f"{key[0]} of sample {key[1]} at {entry[0] / 1e9:.6f} s = {_value_text(entry)}"


def _value_text(entry: tuple[int, Any] | None) -> str:
    return "nothing" if entry is None or entry[1] is None else f"[{', '.join(map(repr, entry[1]))}]"


def _fate_text(entry: tuple[int, Any] | None) -> str:
    return "nothing" if entry is None else f"{entry[1]} at {entry[0] / 1e9:.6f} s"


# -- verdict ------------------------------------------------------------------------------------------------------


def _verdict(record: Record, departures: list[Departure], elsewhere: list[str]) -> Verdict:
    estimates = sum(len(batch.estimates) for batch in record.batches.values())
    frames = len({key for batch in record.batches.values() for entries in (_heard, _sent) for key in entries(batch)})
    compared = f"{estimates:,} estimates and {frames:,} frame fates of {len(record.plan.agents)} agents"
    causes = list(_causes(record))
    certified = not departures and not elsewhere
    lines = []
    if elsewhere:
        lines.append(f"not comparable bit for bit here: {'; '.join(elsewhere)}")
    if certified:
        beside = "".join(f", with {name} {number}" for name, number in libraries(record.plan).items())
        lines.append(f"certified: {compared} equal the twin's, bit for bit{beside}")
    elif not departures:
        lines.append(f"{compared} equal the twin's within {_TOLERANCE:g}")
    else:
        lines.append(f"not certified: {_departed(departures, estimates, frames)} depart from the twin")
        lines.append(f"first departure at {departures[0].time_ns / 1e9:.6f} s: {departures[0].what}")
    lines += causes[:_NAMED_CAUSES]
    if len(causes) > _NAMED_CAUSES:
        lines.append(f"… and {len(causes) - _NAMED_CAUSES:,} more")
    return Verdict(certified, tuple(lines))


def _departed(departures: Sequence[Departure], estimates: int, frames: int) -> str:
    """The number of departures and their agents: "12 of 360 frame fates and 5 of 80 estimates of agents 3, 7 and 9"."""
    of_frames = len({departure.frame for departure in departures if departure.frame is not None})
    of_estimates = sum(departure.frame is None for departure in departures)
    agents = sorted({departure.agent for departure in departures}, key=natural_key)
    named = (
        agents
        if len(agents) <= _NAMED_AGENTS
        else [*agents[: _NAMED_AGENTS - 1], f"{len(agents) - _NAMED_AGENTS + 1} more"]
    )
    *others, last = named
    who = f"agents {', '.join(others)} and {last}" if others else f"agent {last}"
    return f"{of_frames:,} of {frames:,} frame fates and {of_estimates:,} of {estimates:,} estimates of {who}"


def _causes(record: Record) -> Iterator[str]:
    """Possible causes of departures, in words."""
    for event in record.events:
        if event["event"] == "late-fault":
            yield f"fault {event['id']} reached an agent after its instant, {event['time_ns'] / 1e9:.3f} s"
        elif event["event"] == "died" and event["cause"] != "injected":
            yield f"agent {event['agent']} {event['cause']} at {event['time_ns'] / 1e9:.3f} s"
    if record.end_ns is None:
        yield "the record was broken off: what it holds was compared"
    for (agent, _), batch in record.batches.items():
        for event in batch.events:
            if event["event"] == MISSED:
                what = f"{event['count']} messages from {event['source']} to {agent}"
                yield f"{what} were lost by the middleware before {event['time_ns'] / 1e9:.3f} s"
    late = sorted((entry, life) for life, batch in record.batches.items() for entry in batch.late)
    if late:
        yield f"{len(late):,} late frames (a late frame need not be a departure):"
    for entry, (agent, _) in sorted(late, key=lambda found: found[0].due_ns):
        where = f"frame {entry.sequence} from {entry.source} to {agent}, due {entry.due_ns / 1e9:.6f} s"
        yield f"  {where}, {entry.behind_ns / 1e6:.3f} ms late"
