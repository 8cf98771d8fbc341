"""A plan as a key: for what is worked out once a run and looked up for every sample."""

from __future__ import annotations

from .plan import Plan


class PlanIdentity:
    """A plan as itself: equal to itself alone, so that a cache need not compare what is in it."""

    __slots__ = ("plan",)

    def __init__(self, plan: Plan) -> None:
        self.plan = plan

    def __eq__(self, other: object) -> bool:
        return isinstance(other, PlanIdentity) and other.plan is self.plan

    def __hash__(self) -> int:
        return id(self.plan)
