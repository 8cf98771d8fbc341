"""A run as data: reports of agents, entries about frames, and events of the run."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...agents.journal import ENTRIES, FACT_ROWS, FRAME_ROWS, NOTED, Batch, Estimate
from ...agents.plan import WORLD, Plan
from ...agents.plan_codec import decode_value
from ...errors import BadInput
from ...topologies import natural_key
from ...transport.faults import Fault, LinkName, kills_of
from ..evaluation.evaluation import Series
from ..evaluation.evaluation_result import EvaluationResult, load_evaluation
from .encoding import row_from_json, untag, vector_from_json
from .mcap_file import Entry, read
from .plan_file import read_plan
from .recorder import ESTIMATES, EVENTS, FACTS, FRAMES, RUN_EVENTS
from .run_files import EVALUATION_FILE, EVALUATION_PROBLEM, INFO_FILE

INJECTED = "injected"
"""The cause of a death that a fault brought about."""
Life = tuple[str, int]
"""An agent and its incarnation."""


@dataclass(frozen=True, eq=False)
class Record:
    """One run. `batches` holds one batch for each agent and incarnation; `info` is what run.json says.

    `recovered`: the record was cut off and mended, so what happened last may be missing from it. `evaluation`: how the
    run was judged; None if it was not yet, or could not be. `only_read`: users' classes are not imported.
    """

    plan: Plan
    batches: Mapping[Life, Batch]
    events: Sequence[Mapping[str, Any]] = ()
    info: Mapping[str, Any] = field(default_factory=dict)
    recovered: bool = False
    evaluation: EvaluationResult | None = None
    only_read: bool = False

    def __repr__(self) -> str:
        return f"Record of {self.plan!r}: {', '.join(self.quantities()) or 'no estimates'}"

    @cached_property
    def end_ns(self) -> int | None:
        """When the run ended, in nanoseconds; None for one that was broken off before it could say so."""
        return next((event["time_ns"] for event in reversed(self.events) if event["event"] == "finished"), None)

    @cached_property
    def last_ns(self) -> int:
        """The end of the run, or the latest instant of which anything was written down."""
        return (
            max((batch.last_ns for batch in self.batches.values()), default=0) if self.end_ns is None else self.end_ns
        )

    @cached_property
    def faults(self) -> tuple[Fault, ...]:
        """The faults of the scenario and the live ones, as they were cleared, in the order of their starts.

        A kill of an agent whose life had been ended from outside before never came about, nor did the return after it.
        """
        faults = {fault.id: fault for fault in self.plan.faults}
        for event in self.events:
            if event["event"] == "fault":
                fault = decode_value(event["fault"], only_read=self.only_read)
                faults[fault.id] = fault
            elif event["event"] == "cleared":
                faults[event["id"]] = replace(faults[event["id"]], until_ns=event["time_ns"])
        lives = self.broken_off if self.end_ns is not None else ()
        without_effect = [kill for agent, life in lives for kill in kills_of(faults.values(), agent)[life:]]
        faults_held = [fault for fault in faults.values() if fault not in without_effect]
        return tuple(sorted(faults_held, key=lambda fault: (fault.at_ns, fault.id)))

    @cached_property
    def faults_in_effect(self) -> tuple[Fault, ...]:
        """The same without those that were cleared, or the run stopped, before they began."""
        return tuple(
            fault
            for fault in self.faults
            if fault.at_ns <= self.last_ns and (fault.until_ns is None or fault.at_ns < fault.until_ns)
        )

    @cached_property
    def as_run(self) -> Plan:
        """The plan with the faults as they really were: samples follow from it."""
        return replace(self.plan, faults=self.faults)

    @cached_property
    def broken_off(self) -> frozenset[Life]:
        """Lives whose entries may stop before their end: not killed by a fault, or all if the run was broken off."""
        if self.end_ns is None:
            return frozenset(self.batches)
        return frozenset(
            (event["agent"], event["incarnation"])
            for event in self.events
            if event["event"] == "died" and event["cause"] != INJECTED
        )

    def restart_ns(self, agent: str, life: int) -> int | None:
        """When an agent came back after a life, in nanoseconds; None if it did not."""
        return next(
            (
                event["time_ns"]
                for event in self.events
                if event["event"] == "restarted" and event["agent"] == agent and event["incarnation"] > life
            ),
            None,
        )

    def links(self) -> tuple[LinkName, ...]:
        """The directed links, in natural order."""
        return tuple(sorted(self.plan.links, key=lambda link: (natural_key(link[0]), natural_key(link[1]))))

    @cached_property
    def of_agents(self) -> dict[Life, Batch]:
        """The batches of the agents in natural order, without those of world agents."""
        world_agents = {one.name for one in self.plan.world_agents}
        mine = (item for item in self.batches.items() if item[0][0] not in world_agents)
        return dict(sorted(mine, key=lambda item: (natural_key(item[0][0]), item[0][1])))

    def quantities(self) -> tuple[str, ...]:
        """What agents reported, in alphabetical order."""
        return tuple(sorted(self._reports))

    @cached_property
    def _reports(self) -> Mapping[str, Mapping[str, list[Estimate]]]:
        """Quantity → agent → its reports through all its lives, agents in natural order."""
        found: dict[str, dict[str, list[Estimate]]] = {}
        for (agent, _), batch in self.of_agents.items():
            for estimate in batch.estimates:
                found.setdefault(estimate.quantity, {}).setdefault(agent, []).append(estimate)
        return found

    @property
    def problems(self) -> tuple[str, ...]:
        """What went wrong, in the run or in its evaluation; empty for a run that is fine."""
        return (*self.info.get("problems", ()), *filter(None, [self.not_evaluated]))

    @property
    def not_evaluated(self) -> str:
        """Why there is no evaluation, and what to do; empty where there is one."""
        if self.evaluation is not None:
            return ""
        reason = self.info.get(EVALUATION_PROBLEM, "it was broken off before its end, or has been recovered")
        return f"this run is not evaluated, `volery evaluate RUN` does it: {reason}"

    @property
    def evaluated(self) -> EvaluationResult:
        """The evaluation.

        Raises:
            BadInput: there is none.
        """
        if self.evaluation is None:
            raise BadInput(self.not_evaluated)
        return self.evaluation

    def truth(self, quantity: str) -> Mapping[str, NDArray[np.float64]]:
        """Agent → what was true for each of its reports of a quantity, (n, k), NaN where that is not known."""
        return self.evaluated.quantity(quantity).truth

    def central(self, quantity: str) -> Mapping[str, NDArray[np.float64]]:
        """Agent → the central estimate for each of its reports, (n, k), NaN where there is none."""
        return self.evaluated.quantity(quantity).central

    def nees(self, quantity: str) -> Mapping[str, NDArray[np.float64]]:
        """Agent → NEES of each of its reports, or NIS of innovations, (n,), NaN where no covariance belongs to it."""
        return self.evaluated.quantity(quantity).nees

    def central_nees(self, quantity: str) -> Mapping[str, NDArray[np.float64]]:
        """The same for the central estimates, with their covariances."""
        return self.evaluated.quantity(quantity).central_nees

    @cached_property
    def world_reports(self) -> dict[str, Series]:
        """What a coupled world wrote down: quantity → its true values."""
        reports: dict[str, list[Estimate]] = {}
        for one in self.plan.world_agents:
            for estimate in self.batches.get((one.name, 0), Batch(one.name, 0)).estimates:
                reports.setdefault(estimate.quantity, []).append(estimate)
        return {name: _series(WORLD, mine, len(mine[0].value)) for name, mine in reports.items()}

    @cached_property
    def notes(self) -> tuple[Mapping[str, Any], ...]:
        """The notes of agents and world agents: {"agent": …, "what": …, "time_ns": …, …}, in order of time."""
        found = (
            {"agent": agent, **event}
            for (agent, _), batch in self.batches.items()
            for event in batch.events
            if event["event"] == NOTED
        )
        return tuple(sorted(found, key=lambda note: (note["time_ns"], natural_key(note["agent"]))))

    def estimates(self, quantity: str) -> dict[str, Series]:
        """Agent → what it reported of a quantity through all its lives; agents that never did are absent.

        Raises:
            BadInput: nobody reported it, or an agent's reports of it differ in length.
        """
        reports = self._reports.get(quantity)
        if reports is None:
            raise BadInput(
                f"nobody reported {quantity!r}; this run has {', '.join(self.quantities()) or 'no estimates'}"
            )
        width = len(next(iter(reports.values()))[0].value)
        return {agent: _series(agent, mine, width) for agent, mine in reports.items()}


def _series(agent: str, reports: list[Estimate], width: int) -> Series:
    odd = next((report for report in reports if len(report.value) != width), None)
    if odd is not None:
        raise BadInput(
            f"agent {agent} reported {odd.quantity!r} with {len(odd.value)} components at {odd.time_ns} ns, "
            f"others have {width}: report quantities of different length under different names"
        )
    return Series(
        np.array([report.time_ns for report in reports], dtype=np.int64),
        np.array([report.sample for report in reports], dtype=np.int64),
        np.array([report.value for report in reports], dtype=np.float64).reshape(len(reports), width),
    )


class Collector:
    """Sink of a run that keeps everything in memory."""

    def __init__(self) -> None:
        self.batches: dict[Life, Batch] = {}
        self.events: list[dict[str, Any]] = []

    def __call__(self, batch: Batch) -> None:
        """Take the entries of one agent, after those that came before."""
        life = (batch.agent, batch.incarnation)
        mine = self.batches.setdefault(life, Batch(*life))
        mine.events += batch.events
        for name in ENTRIES:
            getattr(mine, name).extend(getattr(batch, name))

    def event(self, event: dict[str, Any]) -> None:
        """Take an event of the run."""
        self.events.append(event)

    def record(self, plan: Plan, info: Mapping[str, Any] | None = None, *, recovered: bool = False) -> Record:
        """What was collected, as the record of a run of this plan."""
        return Record(plan, self.batches, tuple(self.events), info or {}, recovered)


def load(folder: Path, plan: Plan | None = None, *, evaluated: bool = True) -> Record:
    """The record of a run that was written to a folder.

    Args:
        folder: of the run.
        plan: where it is at hand; else that of the folder is read, and users' classes in it are not imported.
        evaluated: whether to read the evaluation too.

    Raises:
        BadInput: no run there, or a damaged file; the message says how to get at what is there.
    """
    collector, recovered = collect(folder)
    record = collector.record(plan or read_plan(folder, only_read=True), _info(folder), recovered=recovered)
    evaluation = load_evaluation(folder / EVALUATION_FILE) if evaluated else None
    return replace(record, evaluation=evaluation, only_read=plan is None)


def collect(folder: Path) -> tuple[Collector, bool]:
    """Everything in a run's record.mcap, and whether it was cut off and recovered.

    Raises:
        BadInput: no record, cut off or damaged.
    """
    entries, recovered = read(folder)
    collector = Collector()
    for entry in entries:
        if entry.topic == RUN_EVENTS:
            collector.event(untag(entry.data))
        else:
            collector(_batch(entry))
    return collector, recovered


def _batch(entry: Entry) -> Batch:
    _, _, agent, kind = entry.topic.split("/")
    data = entry.data
    batch = Batch(agent, data["incarnation"])
    if kind == ESTIMATES:
        value = vector_from_json(data["value"])
        batch.estimates.append(Estimate(entry.time_ns, data["quantity"], data["index"], value))
    elif kind == FACTS:
        for name, row in FACT_ROWS.items():
            getattr(batch, name).extend(row_from_json(row, fields) for fields in data[name])
    elif kind == FRAMES:
        for name, row in FRAME_ROWS.items():
            getattr(batch, name).extend(row(*fields) for fields in data[name])
    elif kind == EVENTS:
        batch.events.append(untag(data["event"]))
    return batch


def _info(folder: Path) -> dict[str, Any]:
    path = folder / INFO_FILE
    try:
        info: dict[str, Any] = json.loads(path.read_text("utf-8"))
    except FileNotFoundError:
        return {}
    except ValueError as error:
        raise BadInput(f"{path} is damaged ({error}): delete it, the record itself does not need it") from error
    return info
