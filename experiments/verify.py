"""Certification: replay a recorded run in the twin, live faults and outside kills included, and compare bit for bit."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from ..agents.journal import LAST_HEARD, MISSED, Batch, Estimate
from .record.machine import differences, libraries
from .record.record import Collector, Life, Record, load
from .twin import LastHeard, Twin

_TOLERANCE = 1e-9
_NAMED_CAUSES = 8


class Departure(NamedTuple):
    """A place where record and replay differ."""

    time_ns: int
    what: str


@dataclass(frozen=True)
class Verdict:
    """What the comparison says, in lines to print.

    `certified`: every recorded estimate and every frame's fate equals the replay, bit for bit.
    """

    certified: bool
    lines: tuple[str, ...]

    @property
    def exit_code(self) -> int:
        """0 if certified, else 3."""
        return 0 if self.certified else 3


def verify(folder: Path) -> Verdict:
    """Replay the run in a folder and compare.

    Raises:
        BadInput: no run there, or a damaged record.
    """
    record = load(folder)
    elsewhere = differences(record.info, record.plan)
    replayed = replay(record)
    departures = sorted(compare(record, replayed, 0.0 if not elsewhere else _TOLERANCE))
    return _verdict(record, departures, elsewhere)


def replay(record: Record) -> Mapping[Life, Batch]:
    """What the twin makes of the same plan, with the faults as they really were."""
    plan = replace(record.as_run, duration_ns=_duration_ns(record))
    collector = Collector()
    Twin(plan, collector, last_heard(record)).run()
    return collector.batches


def _duration_ns(record: Record) -> int:
    return record.plan.duration_ns if record.end_ns is None else record.end_ns


def last_heard(record: Record) -> LastHeard:
    """What the neighbours of an agent killed from outside have noted of it when they were told, or at their end."""
    return {
        ((event["source"], event["incarnation"]), life): event["sent"]
        for life, batch in record.batches.items()
        for event in batch.events
        if event["event"] == LAST_HEARD
    }


# -- comparison ---------------------------------------------------------------------------------------------------


def compare(record: Record, replayed: Mapping[Life, Batch], tolerance: float) -> Iterator[Departure]:
    """Every place where the two differ; of a life that broke off, its beginning is compared."""
    for life in sorted({*record.batches, *replayed}):
        mine = record.batches.get(life, Batch(*life))
        twin = replayed.get(life, Batch(*life))
        prefix = life in record.broken_off
        yield from _compare_estimates(mine, twin, tolerance, prefix=prefix)
        yield from _compare_frames(f"agent {life[0]} heard", _heard(mine), _heard(twin), prefix=prefix)
        yield from _compare_frames(f"agent {life[0]} sent", _sent(mine), _sent(twin), prefix=prefix)


def _compare_estimates(mine: Batch, twin: Batch, tolerance: float, *, prefix: bool) -> Iterator[Departure]:
    for recorded, expected in zip(mine.estimates, twin.estimates, strict=False):
        if not _same(recorded, expected, tolerance):
            what = f"agent {mine.agent}: {_told(recorded)} recorded, {_told(expected)} in the twin"
            yield Departure(min(recorded.time_ns, expected.time_ns), what)
            return
    short = min(len(mine.estimates), len(twin.estimates))
    if len(mine.estimates) != len(twin.estimates) and not (prefix and len(mine.estimates) == short):
        longer, where = (mine, "recorded") if len(mine.estimates) > short else (twin, "in the twin")
        extra = longer.estimates[short]
        yield Departure(extra.time_ns, f"agent {mine.agent}: {_told(extra)} only {where}")


def _same(recorded: Estimate, expected: Estimate, tolerance: float) -> bool:
    if recorded[:3] != expected[:3] or len(recorded.value) != len(expected.value):
        return False
    if tolerance:
        pairs = zip(recorded.value, expected.value, strict=True)
        return all(math.isclose(one, other, rel_tol=tolerance, abs_tol=tolerance) for one, other in pairs)
    return _bits(recorded.value) == _bits(expected.value)


def _bits(value: list[float]) -> bytes:
    """The bits of a vector: a NaN equals itself, and −0 is not 0."""
    return struct.pack(f"<{len(value)}d", *value)


def _told(estimate: Estimate) -> str:
    numbers = ", ".join(repr(number) for number in estimate.value)
    return f"{estimate.quantity} of sample {estimate[2]} at {estimate.time_ns / 1e9:.6f} s = [{numbers}]"


FrameFate = tuple[int, Any]


def _heard(batch: Batch) -> dict[tuple[Any, ...], FrameFate]:
    return {
        (heard.source, heard.incarnation, heard.copy, heard.sequence): (heard.due_ns, heard.fate)
        for heard in batch.heard
    }


def _sent(batch: Batch) -> dict[tuple[Any, ...], FrameFate]:
    sent: dict[tuple[Any, ...], FrameFate] = {
        (entry.target, entry.copy, entry.sequence): (entry.start_ns, entry[2:]) for entry in batch.sent
    }
    dropped = {(entry.target, 0, entry.sequence): (entry.time_ns, entry.cause) for entry in batch.dropped}
    return sent | dropped


def _compare_frames(
    what: str, mine: dict[tuple[Any, ...], FrameFate], twin: dict[tuple[Any, ...], FrameFate], *, prefix: bool
) -> Iterator[Departure]:
    for key in mine.keys() | twin.keys():
        recorded, expected = mine.get(key), twin.get(key)
        if recorded == expected or (prefix and recorded is None):
            continue
        first_ns = min(story[0] for story in (recorded, expected) if story is not None)
        peer, number = key[0], key[-1]
        fates = f"{_fate(recorded)} recorded, {_fate(expected)} in the twin"
        yield Departure(first_ns, f"{what} frame {number} {'from' if what.endswith('heard') else 'to'} {peer}: {fates}")


def _fate(story: FrameFate | None) -> str:
    return "nothing" if story is None else f"{story[1]} at {story[0] / 1e9:.6f} s"


# -- verdict ------------------------------------------------------------------------------------------------------


def _verdict(record: Record, departures: list[Departure], elsewhere: list[str]) -> Verdict:
    estimates = sum(len(batch.estimates) for batch in record.batches.values())
    frames = sum(len(batch.heard) for batch in record.batches.values())
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
        lines.append(f"not certified: {len(departures):,} departures from the twin among {compared}")
        lines.append(f"first departure at {departures[0].time_ns / 1e9:.6f} s: {departures[0].what}")
    lines += causes[:_NAMED_CAUSES]
    if len(causes) > _NAMED_CAUSES:
        lines.append(f"… and {len(causes) - _NAMED_CAUSES:,} more")
    return Verdict(certified, tuple(lines))


def _causes(record: Record) -> Iterator[str]:
    """What may make a run depart from its twin, in words."""
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
