"""Reports of all agents side by side: one row a sample, one column an agent, with what they should have been."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...quantities import Component, Floats, subtracted
from ..evaluation.evaluation_result import Whole
from .record import Record
from .side_by_side import take


@dataclass(frozen=True)
class Samples:
    """T samples of N agents with k components each; NaN where an agent has no estimate or a reference is not known.

    time_ns (T,) int64; index (T,) int64; estimate, oracle, truth (T, N, k) in the agents' units, each entry of oracle
    and truth belonging to the report beside it; the oracle is the central estimate. `oracle_difference` and
    `truth_difference` (T, N, m): by how much estimates are off. `disagreement` (T,): root mean square distance of the
    agents to their mean, as seen from the first that has an estimate; NaN where each has its own and nothing
    `is_shared`. `deviation` (T, N, m): standard deviations of the difference to the truth, as agents stated them.
    """

    quantity: str
    is_shared: bool
    agents: tuple[str, ...]
    components: tuple[Component, ...]
    difference_components: tuple[Component, ...]
    time_ns: Whole
    index: Whole
    estimate: Floats
    oracle: Floats
    truth: Floats
    oracle_difference: Floats
    truth_difference: Floats
    disagreement: Floats
    deviation: Floats

    @cached_property
    def oracle_error(self) -> Floats:
        """Two-norm of each agent's difference to the oracle, (T, N)."""
        return np.asarray(np.linalg.norm(self.oracle_difference, axis=-1))

    @cached_property
    def truth_error(self) -> Floats:
        """Two-norm of each agent's difference to the truth, (T, N)."""
        return np.asarray(np.linalg.norm(self.truth_difference, axis=-1))


def samples(record: Record, quantity: str) -> Samples:
    """The reports of a quantity side by side.

    Raises:
        BadInput: nobody reported it, or the run is not evaluated.
    """
    judged = record.evaluated.quantity(quantity)

    def beside(of: Mapping[str, Floats]) -> Floats:
        return np.stack([take(of[agent], rows) for agent, rows in judged.rows.items()], axis=1)

    def apart(differences: Mapping[str, Floats], reference: Floats) -> Floats:
        return beside(differences) if differences else subtracted(estimate, reference)

    estimate = beside({agent: mine.value for agent, mine in record.estimates(quantity).items()})
    oracle, truth = beside(judged.central), beside(judged.truth)
    unknown = np.full((max(map(len, judged.truth.values())), len(judged.difference_components)), np.nan)
    return Samples(
        quantity,
        judged.is_shared,
        tuple(judged.rows),
        judged.components,
        judged.difference_components,
        judged.time_ns,
        judged.index,
        estimate,
        oracle,
        truth,
        apart(judged.central_difference, oracle),
        apart(judged.truth_difference, truth),
        judged.disagreement,
        beside({agent: judged.deviation.get(agent, unknown) for agent in judged.rows}),
    )
