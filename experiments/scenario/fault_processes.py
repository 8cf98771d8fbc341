"""Random failures and repairs: alternating renewal processes, drawn from the seed before the run."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ...errors import BadInput
from ...randomness import stream
from ...units import Period, quantity

MOST, MOST_OF_A_PLACE = 10_000, 1_000
"""Largest numbers of faults of one entry, and of one of its places."""

Spans = list[tuple[int, int]]


@dataclass(frozen=True)
class Every:
    """Random failures and repairs.

    mtbf: mean time between a repair and the next failure.
    mttr: mean time to repair.
    together: whether all places fail together, instead of each separately.
    """

    mtbf: Period
    mttr: Period
    together: bool = False

    def __post_init__(self) -> None:
        """Check the bounds."""
        for name in ("mtbf", "mttr"):
            if getattr(self, name) <= 0:
                raise BadInput(f"{name} is {quantity(getattr(self, name), 'ns')}, a mean time is above 0")

    def check(self, places: int, from_ns: int, until_ns: int) -> None:
        """Check the expected number of faults of so many places in [from, until).

        Raises:
            BadInput: too many.
        """
        expected = max(0, until_ns - from_ns) / (self.mtbf + self.mttr)
        for count, most in ((expected * places, MOST), (expected, MOST_OF_A_PLACE)):
            if count > most:
                raise BadInput(f"about {count:,.0f} faults would come of this, {most:,} are the most: raise mtbf")


def renewals(every: Every, from_ns: int, until_ns: int, seed: int, fault_id: str, *place: str) -> Spans:
    """The spans within [from, until) in which one place is faulty; it is sound at the start.

    Times to failure and to repair are independent and exponential, T = −mean · ln u, rounded up; the 2k-th draw of the
    place's own stream is the k-th time to failure, the one after it the time to its repair (Cox 1962, Renewal Theory,
    section 7). In the long run a place is faulty for the fraction mttr / (mtbf + mttr).
    """
    draws = stream(seed, "fault-process", fault_id, *place)
    spans: Spans = []
    now_ns, index = from_ns, 0
    while True:
        begin_ns = now_ns + _exponential(every.mtbf, draws.uniform(index))
        now_ns = begin_ns + _exponential(every.mttr, draws.uniform(index + 1))
        if begin_ns >= until_ns:
            return spans
        spans.append((begin_ns, min(now_ns, until_ns)))
        index += 2


def _exponential(mean_ns: int, draw: float) -> int:
    return math.ceil(-mean_ns * math.log(draw))
