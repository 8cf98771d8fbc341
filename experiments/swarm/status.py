"""State of a running swarm from the reports of its agents, for the progress display and `volery status`."""

from __future__ import annotations

import math
from collections import Counter
from functools import cached_property
from typing import Any

import numpy as np

from ...agents.journal import Batch, Estimate
from ...agents.plan import Plan
from ...transport.faults import LinkName
from ..evaluation.evaluation import Evaluation, distance_to_mean, evaluations
from ..record.frame_fates import FATES, FateClass, FateCounts, is_lost
from ..record.record import Record
from ..twin import RecordSink


class Status:
    """Present state of a run: fates of frames, late frames, newest estimates, and living agents.

    time_ns: nominal time.
    behind_s: how far the slowest agent was behind the wall clock lately, in exact pace.
    alive: agents with a living process, including the agent of a coupled world.
    faults: id → description of a fault in force.
    used: links on which a frame has been received.
    """

    def __init__(self, plan: Plan) -> None:
        self.time_ns = 0
        self.behind_s = 0.0
        self.alive: set[str] = set()
        self.faults: dict[str, str] = {}
        self.used: set[LinkName] = set()
        self._plan = plan
        self._late = 0
        self._fates = FateCounts()
        self._newest: dict[str, dict[str, Estimate]] = {}
        self._events: list[dict[str, Any]] = []

    def take(self, batch: Batch) -> None:
        """Add the entries of a batch."""
        self._fates.take(batch)
        self._late += len(batch.late)
        self.used.update((entry.source, batch.agent) for entry in batch.heard)
        for estimate in batch.estimates:
            self._newest.setdefault(estimate.quantity, {})[batch.agent] = estimate

    def event(self, event: dict[str, Any]) -> None:
        """Add an event of the run."""
        self._events.append(event)

    def fates(self) -> Counter[str]:
        """Fate → number of frames whose fate is known."""
        return self._fates.so_far(Record(self._plan, {}, self._events), self.time_ns)

    def disagreement(self) -> float | None:
        """Disagreement of living agents' newest estimates, of the first shared quantity that two of them report.

        None where a user's evaluation class fails: the evaluation at the end of the run says how.
        """
        try:
            return self._disagreement()
        except Exception:  # noqa: BLE001 - a display must not end the run
            return None

    def _disagreement(self) -> float | None:
        for quantity, reported in self._newest.items():
            living = [agent for agent in self._plan.agents if agent.name in self.alive and agent.name in reported]
            values = [reported[agent.name].value for agent in living]
            if len(values) > 1 and len({len(value) for value in values}) == 1:
                declared = self._evaluations[living[0].name].declared(quantity)
                if declared.role == "estimate" and declared.is_shared:
                    found = float(distance_to_mean(declared, np.array(values)))
                    return None if math.isnan(found) else found
        return None

    @cached_property
    def _evaluations(self) -> dict[str, Evaluation]:
        return evaluations(self._plan, {})

    def to_dict(self) -> dict[str, Any]:
        """The state as plain data for `volery status`."""
        fates = self.fates()
        return {
            "time_s": self.time_ns / 1e9,
            "duration_s": self._plan.duration_ns / 1e9,
            "agents": len(self._plan.agents),
            "alive": sorted(agent.name for agent in self._plan.agents if agent.name in self.alive),
            "frames": fates.total(),
            "lost": sum(count for fate, count in fates.items() if is_lost(fate)),
            "discarded": {fate: count for fate, count in fates.items() if FATES[fate] is FateClass.DISCARDED},
            "late": self._late,
            "behind_s": self.behind_s,
            "disagreement": self.disagreement(),
            "faults": self.faults,
        }


class WatchedSink:
    """Passes entries on to the sink of a run and to its status."""

    def __init__(self, sink: RecordSink, status: Status) -> None:
        self._sink = sink
        self._status = status

    def __call__(self, batch: Batch) -> None:
        """Add the entries of one agent."""
        self._status.take(batch)
        self._sink(batch)

    def event(self, event: dict[str, Any]) -> None:
        """Add an event of the run."""
        self._status.event(event)
        self._sink.event(event)
