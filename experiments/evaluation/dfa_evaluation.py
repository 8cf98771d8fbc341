"""The flying array as a whole: altitude, roll and pitch, and what a central computer makes of the same samples."""

from __future__ import annotations

import math
from collections.abc import Mapping

from numpy.typing import ArrayLike

from ...agents.agent import Sample
from ...agents.dfa.dfa_settings import DfaParameters
from ...agents.plan import Plan
from ...estimators.flying_array.least_squares import centralised_estimate, noncollinear
from ...estimators.flying_array.plane import exact_state
from ...quantities import Component, Floats, Quantity
from ...units import period_ns
from ...worlds.plane.plane_world import SENSOR, PlaneWorld
from .evaluation import Evaluation, Series

_DEGREE = 180 / math.pi
ATTITUDE = (Component("altitude", "m"), Component("roll", "deg", _DEGREE), Component("pitch", "deg", _DEGREE))
_ROUND = "estimate/round"


class DfaEvaluation(Evaluation):
    """Estimates belong to samples, whose centralised estimate is Kriegleder 2012, (12)."""

    quantities = (Quantity("estimate", ATTITUDE), Quantity(_ROUND, ATTITUDE))

    def __init__(self, plan: Plan, world_reports: Mapping[str, Series]) -> None:
        super().__init__(plan, world_reports)
        self._parameters: DfaParameters = plan.agents[0].parameters
        self._seen_ns = -1
        self._seen: dict[str, float] = {}
        self._central: Floats | None = None

    def instant(self, agent: str, quantity: str, index: int, time_ns: int) -> int:
        """That of the sample whose rounds the estimate ends."""
        if self._parameters.hold:
            return 0
        sample = (index - 1) // self._parameters.rounds if quantity == _ROUND else index
        return period_ns(self._parameters.rate, sample)

    def sampled(self, agent: str, sample: Sample) -> None:
        """Keep the distances of one instant."""
        if sample.time_ns > self._seen_ns:
            self._seen_ns, self._seen, self._central = sample.time_ns, {}, None
        if sample.value is not None and sample.sensor == SENSOR:
            self._seen[agent] = float(sample.value[0])

    def central_estimate(self, agent: str, quantity: str, index: int, time_ns: int) -> Floats | None:
        """The centralised estimate (z, γ, β) [m, rad, rad] from all sensors' samples of one instant.

        Kriegleder 2012, (12); made exact for a tilted plane where the modules' own estimate is.
        None where the sensors that saw something stand on a line.
        """
        if self._seen_ns != time_ns:
            return None
        if self._central is None:
            self._central = self._least_squares()
        return self._central

    def _least_squares(self) -> Floats | None:
        seen = [
            (each.position, self._seen[each.name])
            for each in self.plan.agents
            if each.position is not None and each.name in self._seen
        ]
        positions = [position for position, _ in seen]
        if not seen or not noncollinear(positions):
            return None
        state = centralised_estimate(positions, [value for _, value in seen])
        return exact_state(state) if self._parameters.model == "exact" else state

    def truth(self, agent: str, quantity: str, index: int, time_ns: int) -> ArrayLike | None:
        """Altitude, roll and pitch when the sample was taken."""
        world = self.plan.world
        return world.truth(time_ns) if isinstance(world, PlaneWorld) else super().truth(agent, quantity, index, time_ns)
