"""Whether filters are as uncertain as they say: mean NEES of estimates, mean NIS of innovations, and their bounds.

Bar-Shalom, Li and Kirubarajan 2001, (5.4.2-1) and (5.4.2-6)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...estimators.error_measures import chi_square_bounds
from ...transport.links import NANOSECONDS
from ..record.record import Record

SETTLED_FRACTION = 0.25
"""The first part of a run says more of the start than of the filter."""
INDEPENDENT_NS = NANOSECONDS
"""Errors of one agent so far apart in time are taken as independent; innovations of a good filter all are."""


@dataclass(frozen=True)
class Consistency:
    """The mean normalised square of one quantity, over its degrees of freedom: 1 where the covariance is right.

    `test`: NEES of an estimate, NIS of an innovation. `reports`: how many it is of, after the first part of the run.
    `central`: that of the central estimator, NaN if it states no covariance. `low` and `high`: where it is for 95 % of
    consistent filters. `verdict`: consistent, overconfident above and cautious below.
    """

    test: Literal["NEES", "NIS"]
    reports: int
    mean: float
    central: float
    low: float
    high: float
    verdict: str


def consistency(record: Record) -> dict[str, Consistency]:
    """Of each quantity whose covariance was reported and whose error is known."""
    found = {quantity: _tested(record, quantity) for quantity in record.evaluated.tested()}
    return {quantity: one for quantity, one in found.items() if one is not None}


def _tested(record: Record, quantity: str) -> Consistency | None:
    judged = record.evaluated.quantity(quantity)
    from_ns = SETTLED_FRACTION * record.last_ns
    squares, central = [], []
    independent: set[tuple[str, int]] = set()
    for agent, values in judged.nees.items():
        times = record.estimates(quantity)[agent].time_ns
        counted = (times >= from_ns) & ~np.isnan(values)
        squares.append(values[counted])
        central.append(judged.central_nees[agent][counted])
        who = "" if judged.is_shared else agent
        independent.update((who, second) for second in (times[counted] // INDEPENDENT_NS).tolist())
    reports = sum(map(len, squares))
    if not reports:
        return None
    is_innovation, freedom = judged.role == "innovation", len(judged.difference_components)
    low, high = chi_square_bounds(freedom, reports if is_innovation else len(independent))
    mean, of_central = (float(np.mean(np.concatenate(each))) / freedom for each in (squares, central))
    verdict = "overconfident" if mean > high / freedom else "cautious" if mean < low / freedom else "consistent"
    test: Literal["NEES", "NIS"] = "NIS" if is_innovation else "NEES"
    return Consistency(test, reports, mean, of_central, low / freedom, high / freedom, verdict)


def departure(mean: float) -> float:
    """How far a mean normalised square is from 1, to which both too small and too large are worse: |ln|."""
    return abs(math.log(mean)) if mean > 0.0 else math.inf
