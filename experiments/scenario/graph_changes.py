"""What `volery validate` says of a graph that changes: when it falls apart, and how connected it is on average."""

from __future__ import annotations

from dataclasses import dataclass

from ... import topologies
from ...agents.plan import Plan
from ...topologies import Span, TimedGraph
from ...units import quantity


@dataclass(frozen=True)
class GraphChanges:
    """A changing graph over a run.

    `instants`: how often it changes; `apart`: when some agent cannot reach another; `mean_connectivity`: λ_2 of the
    time average of its Laplacian, and `union_connectivity` that of all edges at once, between which agreement lies.
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
    """The changes of a plan's graph; None where it never changes."""
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
