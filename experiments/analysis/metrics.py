"""Metrics of a run: how well the agents estimated, how they came through the faults, what the links did.

Errors of a whole estimate are two-norms in the agents' own units; components are given apart, each in its unit. What is
not defined, such as the error to an oracle that does not exist, is NaN here and null in metrics.json.
"""

from __future__ import annotations

import json
import math
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...estimators import error_measures as measures
from ...topologies import natural_key
from ...transport.faults import Fault, Kill
from ...transport.links import NANOSECONDS
from ..evaluation.comparisons import Channel
from ..evaluation.evaluation import Finding
from ..evaluation.evaluation_result import EvaluationResult
from ..record.channels import channels
from ..record.encoding import defined
from ..record.record import Record
from ..record.samples import Samples, samples
from ..scenario.fault_labels import fault_label
from ..whole_files import write_whole
from .accounting import LinkAccount, account, airtime_utilisation
from .ages import AgeMetrics, age_courses, age_metrics
from .fidelity import Fidelity, judge
from .filter_consistency import Consistency, consistency

FILE_NAME = "metrics.json"
STEADY_FRACTION = 0.25
"""The last part of the run that counts as its steady state."""
CONVERGED_FACTOR = 2.0
"""An error has converged where it stays within this many times its steady-state rms, unless a threshold is given."""
RECOVERED_FACTOR = 3.0
"""An error has recovered where it stays within this many times its median of the second before the fault."""
ROUNDS = "/round"
"""Quantities whose name ends so hold the state after each round of one consensus: their contraction is measured."""
_OF_RECOVERY = ("error to oracle", "disagreement", "error to truth")
"""The first of these that is known is the one that has to recover."""
_ROUNDING = 1e-9
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Course:
    """An error through the run: rms and maximum over the agents for each sample, (T,); time_ns (T,) ascending."""

    time_ns: NDArray[np.int64]
    rms: Floats
    maximum: Floats


@dataclass(frozen=True)
class ErrorMetrics:
    """One error of one quantity, in the agents' units.

    `steady_rms`: over agents and samples of the steady state; `final`: largest of the last sample; `convergence_s`:
    when it comes to stay within `threshold`; `ise`: integral of the squared rms over time in seconds.
    """

    steady_rms: float
    final: float
    threshold: float
    convergence_s: float
    ise: float


@dataclass(frozen=True)
class ComponentMetrics:
    """Steady-state rms of one component, in its unit."""

    name: str
    unit: str
    oracle_rms: float
    truth_rms: float


@dataclass(frozen=True)
class Recovery:
    """How long after the end of a fault, or after its start if it never ends, an error came to stay within `threshold`.

    `of` says which error. NaN: it did not before the next fault or the end, or there was none in the second before.
    """

    fault: str
    label: str
    of: str
    threshold: float
    recovery_s: float


@dataclass(frozen=True)
class QuantityMetrics:
    """All about one reported quantity."""

    agents: int
    samples: int
    disagreement: ErrorMetrics
    oracle_error: ErrorMetrics
    truth_error: ErrorMetrics
    components: tuple[ComponentMetrics, ...]
    recoveries: tuple[Recovery, ...]
    contraction: float


@dataclass(frozen=True)
class ProcessMetrics:
    """What a process used, and how late its timers were: median, 99th percentile and largest; none in the twin."""

    cpu_s: float
    memory_kb: int
    lateness_ns: tuple[int, ...]


@dataclass(frozen=True)
class LinkMetrics:
    """One directed link."""

    account: LinkAccount
    closes: bool
    channel: Channel
    age: AgeMetrics


@dataclass(frozen=True, repr=False)
class Metrics:
    """All metrics of a run; links by name, "3>7".

    `wall_s`: how long it took by the clock, NaN where nobody wrote it down. `not_evaluated`: why quantities and
    findings are missing; empty where they are not. `airtime`: medium → its utilisation. `findings`: what evaluations
    have to say, and how often what was noted.
    """

    name: str
    seconds: float
    wall_s: float
    recovered: bool
    not_evaluated: str
    quantities: Mapping[str, QuantityMetrics]
    consistency: Mapping[str, Consistency]
    links: Mapping[str, LinkMetrics]
    airtime: Mapping[str, float]
    processes: Mapping[str, ProcessMetrics]
    findings: tuple[Finding, ...]
    fidelity: Fidelity

    def __repr__(self) -> str:
        found = ", ".join(self.quantities) or self.not_evaluated
        return f"Metrics of {self.name}, {self.seconds:g} s: {found}; {len(self.links)} links; {self.fidelity.verdict}"

    @property
    def times_real_time(self) -> float:
        """Nominal seconds in a second of the clock; NaN where that is not known."""
        return self.seconds / self.wall_s if self.wall_s > 0 else math.nan

    def to_json(self) -> str:
        """JSON, null for what is not defined, "inf" for what is infinite."""
        return json.dumps(defined(asdict(self)), indent=1, allow_nan=False)


def compute_metrics(record: Record, threshold: float | None = None) -> Metrics:
    """All metrics of a run.

    Args:
        record: the run.
        threshold: for the convergence time, in the agents' units; by default CONVERGED_FACTOR · steady-state rms.
    """
    of = record.evaluation or EvaluationResult({})
    channel_of, ages = channels(record), age_courses(record)
    links = {
        ">".join(link): LinkMetrics(one, one.closes, channel_of[link], age_metrics(ages[link]))
        for link, one in account(record).items()
    }
    return Metrics(
        name=record.plan.name,
        seconds=record.last_ns / NANOSECONDS,
        wall_s=record.info.get("wall_s", math.nan),
        recovered=record.recovered,
        not_evaluated=record.not_evaluated,
        quantities={quantity: _quantity(record, quantity, threshold) for quantity in of.compared()},
        consistency=consistency(record) if record.evaluation else {},
        links=links,
        airtime=airtime_utilisation(record),
        processes=_processes(record),
        findings=(*of.findings, *_notes(record)),
        fidelity=judge(
            record, [one.account for one in links.values()], {name: one.channel for name, one in links.items()}
        ),
    )


def write_metrics(record: Record, folder: Path, threshold: float | None = None) -> Metrics:
    """Compute the metrics of a run and leave them in its folder as metrics.json."""
    metrics = compute_metrics(record, threshold)
    write_whole(folder / FILE_NAME, metrics.to_json() + "\n")
    return metrics


def courses(seen: Samples) -> dict[str, Course]:
    """Name of an error → its course: "disagreement", "error to oracle", "error to truth"."""
    return {
        "disagreement": Course(seen.time_ns, seen.disagreement, seen.disagreement),
        "error to oracle": _course(seen.time_ns, seen.oracle_error),
        "error to truth": _course(seen.time_ns, seen.truth_error),
    }


def _course(time_ns: NDArray[np.int64], errors: Floats) -> Course:
    known = ~np.isnan(errors)
    some = known.any(axis=1)
    most = np.where(some, np.where(known, errors, -np.inf).max(axis=1), np.nan)
    return Course(time_ns, _rms(errors, axis=1), most)


def _rms(errors: Floats, axis: int | None = None) -> Floats:
    """Root mean square of what is known along an axis; NaN where nothing is."""
    known = ~np.isnan(errors)
    count = known.sum(axis=axis)
    mean = np.where(known, errors, 0.0) ** 2
    return np.where(count > 0, np.sqrt(mean.sum(axis=axis) / np.maximum(count, 1)), np.nan)


def _quantity(record: Record, quantity: str, threshold: float | None) -> QuantityMetrics:
    seen = samples(record, quantity)
    all_courses = courses(seen)
    steady = seen.time_ns >= (1.0 - STEADY_FRACTION) * record.last_ns
    metrics = {name: _error_metrics(course, steady, threshold) for name, course in all_courses.items()}
    return QuantityMetrics(
        agents=len(seen.agents),
        samples=len(seen.time_ns),
        disagreement=metrics["disagreement"],
        oracle_error=metrics["error to oracle"],
        truth_error=metrics["error to truth"],
        components=_components(seen, steady),
        recoveries=_recoveries(record, quantity, all_courses),
        contraction=contraction(seen) if quantity.endswith(ROUNDS) else math.nan,
    )


def _error_metrics(course: Course, steady: NDArray[np.bool_], threshold: float | None) -> ErrorMetrics:
    steady_rms = float(_rms(course.rms[steady]))
    bound = CONVERGED_FACTOR * steady_rms if threshold is None else threshold
    converged = None if math.isnan(bound) else measures.convergence_time(course.time_ns, course.rms, bound)
    known = ~np.isnan(course.rms)
    return ErrorMetrics(
        steady_rms=steady_rms,
        final=float(course.maximum[-1]),
        threshold=bound,
        convergence_s=_seconds(converged),
        ise=measures.integrated_square_error(course.time_ns[known], course.rms[known]) if known.any() else math.nan,
    )


def _components(seen: Samples, steady: NDArray[np.bool_]) -> tuple[ComponentMetrics, ...]:
    both = seen.oracle_difference[steady], seen.truth_difference[steady]
    return tuple(
        ComponentMetrics(name, unit, *(float(_rms(apart[:, :, number])) * factor for apart in both))
        for number, (name, unit, factor) in enumerate(seen.difference_components)
    )


def _recoveries(record: Record, quantity: str, all_courses: Mapping[str, Course]) -> tuple[Recovery, ...]:
    known = (name for name in _OF_RECOVERY if not np.isnan(all_courses[name].rms).all())
    of = next(known, "disagreement")
    course = all_courses[of]
    found = []
    starts = [fault.at_ns for fault in record.faults_in_effect]
    for fault in record.faults_in_effect:
        following = starts[bisect_right(starts, fault.at_ns) :][:1]
        threshold, recovery = _recovery(course, fault, following[0] if following else None)
        if isinstance(fault, Kill) and not _came_back(record, quantity, fault):
            recovery = None
        label = fault_label(fault, len(record.plan.links))
        found.append(Recovery(fault.id, label, of, threshold, _seconds(recovery)))
    return tuple(found)


def _came_back(record: Record, quantity: str, kill: Kill) -> bool:
    """Whether an agent that was to return has reported again, if it ever did."""
    mine = record.estimates(quantity).get(kill.agent)
    return mine is None or kill.until_ns is None or bool((mine.time_ns >= kill.until_ns).any())


def _recovery(course: Course, fault: Fault, next_ns: int | None) -> tuple[float, int | None]:
    """Threshold and recovery time in nanoseconds after one fault."""
    before = course.rms[(course.time_ns >= fault.at_ns - NANOSECONDS) & (course.time_ns < fault.at_ns)]
    before = before[~np.isnan(before)]
    if not len(before):
        return math.nan, None
    threshold = RECOVERED_FACTOR * float(np.median(before))
    after_ns = fault.at_ns if fault.until_ns is None else fault.until_ns
    before_ns = next_ns if next_ns is not None and next_ns > after_ns else None
    return threshold, measures.recovery_time(
        course.time_ns, course.rms, threshold, after_ns=after_ns, before_ns=before_ns
    )


def contraction(seen: Samples) -> float:
    """Factor by which a round shrinks the disagreement: the median over the consensuses that the samples belong to.

    A consensus lasts as long as its oracle stays the same; rounds from where rounding is the floor are left out. NaN if
    no consensus has two rounds.
    """
    oracle = seen.oracle.reshape(len(seen.index), -1)
    unknown = np.isnan(oracle[1:]) | np.isnan(oracle[:-1])
    again = np.flatnonzero(~((oracle[1:] == oracle[:-1]) | unknown).all(axis=1)) + 1
    factors = [_factor(stretch) for stretch in np.split(seen.disagreement, again)]
    known = [factor for factor in factors if not math.isnan(factor)]
    return float(np.median(known)) if known else math.nan


def _factor(disagreements: Floats) -> float:
    above = disagreements > _ROUNDING * disagreements[0]
    rounds = len(above) if above.all() else int(np.argmin(above))
    return measures.contraction(disagreements[:rounds]) if rounds > 1 else math.nan


def _seconds(time_ns: int | None) -> float:
    return math.nan if time_ns is None else time_ns / NANOSECONDS


def _processes(record: Record) -> dict[str, ProcessMetrics]:
    """Agent → what its last process wrote down about itself at its end."""
    return {
        agent: ProcessMetrics(event["cpu_s"], event["pss_kb"], tuple(event["lateness_ns"]))
        for (agent, _), batch in sorted(record.batches.items(), key=lambda item: (natural_key(item[0][0]), item[0][1]))
        for event in batch.events
        if event["event"] == "done"
    }


def _notes(record: Record) -> Iterator[Finding]:
    """How often what was noted, and by whom first."""
    for what, count in Counter(note["what"] for note in record.notes).items():
        first = next(note for note in record.notes if note["what"] == what)
        yield Finding(
            f"noted: {what}", count, "", f"first by {first['agent']} at {first['time_ns'] / NANOSECONDS:.3f} s"
        )
