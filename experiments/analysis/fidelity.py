"""The fidelity verdict: whether a run was what its scenario asked for, of the machine and of every link."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...topologies import natural_key
from ..evaluation.comparisons import FALSE_ALARM, Channel, Comparison
from ..record.record import Record
from .accounting import LinkAccount

_UNITS = {"latency": (1e-6, "ms"), "rate": (1e-3, "kbit/s"), "burst": (1.0, "bit")}
_PERCENT = (100.0, "%")
_NAMED = 5
BEHIND_S = 0.05
"""A machine that is less behind the wall clock keeps up."""
_IN_WORDS = {
    "within": "within the bounds",
    "outside": "outside the bounds",
    "too few": "with too few frames to tell",
    "not comparable": "not comparable, as order was kept or a model does not say what to expect",
}


@dataclass(frozen=True)
class Lateness:
    """How late something was [ns]: median, 99 % quantile and largest; NaN where nothing was late or timed."""

    p50_ns: float = math.nan
    p99_ns: float = math.nan
    max_ns: float = math.nan


@dataclass(frozen=True)
class Fidelity:
    """How far the run was what its scenario asked for.

    `late` frames came too late, `frames` says by how much; `timers`: how late the agents handled what was due, each
    the worst of all agents. `missing` frames were lost by the middleware, of `contradicted` ones two accounts cannot
    both be true. `late_faults` reached an agent after their instant, agents that `broken_off` names died unasked.
    `outside`: what of the links is outside its bounds, in words; `decisions`: quantity → how many of the links of which
    any was asked are within their bounds, outside, and so on. `verdict` says it all in words. `pace`, of a run in exact
    pace, says how well the machine kept up with the wall clock; the result does not depend on it.
    """

    late: int
    frames: Lateness
    timers: Lateness
    missing: int
    contradicted: int
    late_faults: int
    broken_off: tuple[str, ...]
    outside: tuple[str, ...]
    decisions: Mapping[str, Mapping[str, int]]
    verdict: str
    as_asked: bool
    pace: str = ""


def judge(record: Record, accounts: Sequence[LinkAccount], channels: Mapping[str, Channel]) -> Fidelity:
    """The verdict on a run.

    Args:
        record: the run.
        accounts: of its links.
        channels: link, as "3>7", → what was asked of it and what was got.
    """
    late = [(one.source, agent, one.behind_ns) for (agent, _), batch in record.batches.items() for one in batch.late]
    behind = [behind_ns for _, _, behind_ns in late]
    wired = sum((source, target) in record.plan.wires for source, target, _ in late)
    on_wires = f" ({wired} of them between agents and their world)" if wired else ""
    frames = Lateness(*np.quantile(behind, (0.5, 0.99, 1.0)).tolist()) if behind else Lateness()
    missing, contradicted = sum(one.missing for one in accounts), sum(one.contradicted for one in accounts)
    died = tuple(sorted({agent for agent, _ in record.broken_off}, key=natural_key))
    late_faults = sum(event["event"] == "late-fault" for event in record.events)
    outside = tuple(_outside(channels))
    flaws = [
        (record.end_ns is None, "the run was broken off"),
        (bool(behind), f"{len(behind)} late frames{on_wires}, by {frames.max_ns / 1e6:.1f} ms at most"),
        (missing > 0, f"{missing} frames lost by the middleware"),
        (contradicted > 0, f"{contradicted} frames with contradicting accounts"),
        (late_faults > 0, f"{late_faults} faults that reached an agent late"),
        (record.end_ns is not None and bool(died), f"died unasked: agent {', '.join(died)}"),
        (bool(outside), _shortened(outside)),
    ]
    found = [text for flawed, text in flaws if flawed]
    good = "as asked: no late frame, none lost by the middleware, no link outside its bounds"
    return Fidelity(
        late=len(behind),
        frames=frames,
        timers=_timers(record),
        missing=missing,
        contradicted=contradicted,
        late_faults=late_faults,
        broken_off=died,
        outside=outside,
        decisions=_decisions(channels),
        verdict="not as asked: " + "; ".join(found) if found else good,
        as_asked=not found,
        pace=_pace(record),
    )


def _pace(record: Record) -> str:
    """How well the machine kept up, from what the agents say at their end: the worst of them."""
    pace, speed = record.info.get("pace"), record.info.get("speed", 1.0)
    if pace == "lockstep":
        return "exact; as fast as the machine could"
    ended = [event for batch in record.batches.values() for event in batch.events if event["event"] == "done"]
    if pace != "exact" or not ended or record.end_ns is None:
        return ""
    most_s, end_s = (max(event[name] for event in ended) / 1e9 for name in ("behind_ns", "end_behind_ns"))
    if most_s < BEHIND_S:
        return f"exact; by the wall clock within {max(1, math.ceil(most_s * 1e3))} ms"
    seconds = record.end_ns / 1e9
    factor = seconds / (seconds / speed + end_s)
    advice = f" (try --speed {_slower(factor)})" if end_s >= BEHIND_S else ""
    return (
        f"exact; the machine was at most {most_s:.1f} s behind, {end_s:.1f} s at the end: "
        f"{factor:.2f} × real time{advice}"
    )


def _slower(factor: float) -> str:
    """A speed a little below a factor of real time, in tenths, or finer where it is small."""
    step = min(0.1, 10.0 ** math.floor(math.log10(factor)))
    return f"{math.floor(0.97 * factor / step) * step:.2g}"


def _timers(record: Record) -> Lateness:
    """The worst of all processes for each quantile."""
    ended = [event for batch in record.batches.values() for event in batch.events if event["event"] == "done"]
    lateness = [event["lateness_ns"] for event in ended if event["lateness_ns"]]
    return Lateness(*(float(max(one)) for one in zip(*lateness, strict=True)))


def _outside(channels: Mapping[str, Channel]) -> Iterator[str]:
    for link, channel in channels.items():
        for name, one in channel.comparisons().items():
            if one.decision == "outside":
                yield in_words(link, name, one)


def in_words(link: str, name: str, one: Comparison) -> str:
    """A comparison as "loss of 3→7: 30 % asked, 45 % got, 28 to 33 % allowed"."""
    factor, unit = _UNITS.get(name, _PERCENT)
    asked, got, low, high = (f"{factor * value:.4g}" for value in (one.asked, one.got, one.low, one.high))
    allowed = "exactly that" if low == high else f"{low} to {high} {unit}"
    return f"{name} of {link.replace('>', '→')}: {asked} {unit} asked, {got} {unit} got, {allowed} allowed"


def _shortened(outside: Sequence[str]) -> str:
    more = f" and {len(outside) - _NAMED} more" if len(outside) > _NAMED else ""
    return "; ".join(outside[:_NAMED]) + more


def _decisions(channels: Mapping[str, Channel]) -> dict[str, dict[str, int]]:
    counts: dict[str, Counter[str]] = {}
    for channel in channels.values():
        for name, one in channel.comparisons().items():
            if one.decision != "nothing" and (one.asked or one.decision == "outside"):
                counts.setdefault(name, Counter())[one.decision] += 1
    return {name: dict(count) for name, count in counts.items()}


def fidelity_lines(fidelity: Fidelity) -> Iterator[str]:
    """What the verdict rests on, a line each."""
    for name, decisions in fidelity.decisions.items():
        counts = ", ".join(f"{count} {_IN_WORDS[decision]}" for decision, count in decisions.items())
        yield f"{name} of the links, asked against got: {counts}"
    if fidelity.decisions:
        yield f"chance takes a sound run out of any of these bounds once in {1 / FALSE_ALARM:,.0f} runs (Bonferroni)"
    for name, late in (("late frames", fidelity.frames), ("timers, of the worst agent", fidelity.timers)):
        if not math.isnan(late.max_ns):
            times = ", ".join(f"{value / 1e6:,.1f} ms" for value in (late.p50_ns, late.p99_ns, late.max_ns))
            yield f"{name}: median, p99 and largest lateness {times}"
