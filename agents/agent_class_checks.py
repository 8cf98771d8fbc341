"""Checks of an agent's class, before anything runs."""

from __future__ import annotations

from dataclasses import is_dataclass
from functools import cache

from ..errors import BadInput
from ..overrides import check_nothing_is_shared, check_overrides
from .agent import Agent


@cache
def check_agent_class(kind: type[Agent], what: str) -> None:
    """Check methods and class attributes of an agent's class.

    Raises:
        BadInput: see `check_overrides` and `check_nothing_is_shared`; `Parameters` that are no frozen dataclass; `save`
            without `restore`.
    """
    parameters = kind.Parameters
    if not (isinstance(parameters, type) and is_dataclass(parameters) and parameters.__dataclass_params__.frozen):  # type: ignore[attr-defined]
        raise BadInput(f"{what}: Parameters is {parameters!r}, and must be a class with @dataclass(frozen=True)")
    if not isinstance(kind.timers_only, bool):
        raise BadInput(f"{what}: timers_only is {kind.timers_only!r}, and must be True or False")
    if not isinstance(kind.evaluation, str | type):
        raise BadInput(f"{what}: evaluation is {kind.evaluation!r}, and must be a class or its import string")
    check_overrides(kind, Agent, what)
    check_nothing_is_shared(kind, Agent, what)
    if kind.keeps_state() and kind.restore is Agent.restore:
        raise BadInput(f"{what} overrides save and not restore, so that what it saves would be lost: write both")
