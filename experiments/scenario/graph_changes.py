"""Connectivity of a graph that changes during a run, for `volery validate`."""

from __future__ import annotations

from dataclasses import dataclass

from ... import topologies
from ...agents.plan import Plan
from ...topologies import Span, TimedGraph
from ...units import quantity


@dataclass(frozen=True)
class GraphChanges:
    """Changes of a graph over a run.

    instants: number of instants at which it changes.
    apart: spans in which it is not connected.
    mean_connectivity: λ₂ of the time average of its Laplacian.
    union_connectivity: λ₂ of the Laplacian of all its edges at once.
    """

    instants: int
    apart: tuple[Span, ...]
    mean_connectivity: float
    union_connectivity: float

    def __str__(self) -> str:
        """One line."""
        means = f"λ₂ is {self.mean_connectivity:.3g} for the time-averaged Laplacian"
        times = "once" if self.instants == 1 else f"{self.instants} times"
        return (
            f"the graph changes {times}; {self._gaps()}; "
            f"{means} and {self.union_connectivity:.3g} for all edges at once"
        )

    def _gaps(self) -> str:
        if not self.apart:
            return "it is connected all the time"
        total = sum(end - start for start, end in self.apart)
        start, end = max(self.apart, key=lambda span: span[1] - span[0])
        spans = f"{len(self.apart)} spans, the longest" if len(self.apart) > 1 else "one span,"
        return (
            f"it is not connected for {quantity(total, 'ns')} in {spans} "
            f"from {quantity(start, 'ns')} to {quantity(end, 'ns')}"
        )


def graph_changes(plan: Plan) -> GraphChanges | None:
    """The changes of a plan's graph; None if it never changes."""
    if not plan.presence:
        return None
    union = topologies.from_edges({topologies.ordered(*link) for link in plan.links})
    graph = TimedGraph(union, {link: its for link, its in plan.presence.items() if topologies.ordered(*link) == link})
    within = {time for its in plan.presence.values() for span in its for time in span if 0 < time < plan.duration_ns}
    return GraphChanges(
        len(within),
        topologies.disconnected(graph, plan.duration_ns),
        topologies.mean_connectivity(graph, plan.duration_ns),
        topologies.algebraic_connectivity(union),
    )
