"""Vehicles in formation: their relative places and velocities, and one filter that has every camera and every force."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

from ...agents.agent import Sample
from ...agents.mav.vehicle import ATTITUDE, COVARIANCE, FORCE, FORMATION
from ...agents.plan import Plan
from ...quantities import Component, Floats, Quantity
from . import mav_findings
from .attitude_evaluation import QUATERNION
from .evaluation import Evaluation, Finding, RunData, Series, View
from .formation_estimator import CentralisedFormation
from .formation_view import formation_view


class MavEvaluation(Evaluation):
    """The truth is what the world wrote down; the central estimator has all samples, and all commands as they act."""

    def __init__(self, plan: Plan, world_reports: Mapping[str, Series]) -> None:
        super().__init__(plan, world_reports)
        self._names = tuple(agent.name for agent in plan.agents)
        self.quantities = (
            Quantity(FORMATION, tuple(_relative(self._names))),
            Quantity(FORCE, tuple(Component(f"force {axis}", "N") for axis in "xyz"), "diagnostic", is_shared=False),
            Quantity(ATTITUDE, QUATERNION, role="diagnostic", is_shared=False),
            Quantity(COVARIANCE, role="diagnostic"),
        )
        self._central = CentralisedFormation(plan)

    def sampled(self, agent: str, sample: Sample) -> None:
        """To the central estimator."""
        self._central.sampled(agent, sample)

    def commanded(self, agent: str, command: str, value: Floats, time_ns: int) -> None:
        """To the central estimator."""
        self._central.commanded(agent, command, value, time_ns)

    def central_estimate(self, agent: str, quantity: str, index: int, time_ns: int) -> Floats | None:
        """The state of the formation."""
        return self._central.state(time_ns) if quantity == FORMATION else None

    def view(self, reports: Mapping[str, Floats]) -> View | None:
        """Where all are, about a centre that the estimate does not know."""
        if FORMATION not in reports:
            return None
        return formation_view(self._names, reports[FORMATION], reports.get(COVARIANCE))

    def findings(self, run: RunData) -> Sequence[Finding]:
        """Formation, spread, drift, sight, frames, consistency, and what became unobservable."""
        return mav_findings.findings(self.plan, run)


def _relative(names: Sequence[str]) -> list[Component]:
    """Place and velocity of each vehicle as seen from the next one."""
    parts = ((pair, *kind) for pair in pairwise(names) for kind in (("", "m"), ("velocity ", "m/s")))
    return [
        Component(f"{kind}{axis} of {one} from {other}", unit) for (one, other), kind, unit in parts for axis in "xyz"
    ]
