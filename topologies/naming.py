"""Names of agents: allowed characters, and the natural order in which agents are listed everywhere."""

from __future__ import annotations

import re
from functools import lru_cache

from ..errors import BadInput
from ..names import check_length

LONGEST = 100
"""Bytes of an agent's name."""
_NAME = re.compile(r"[A-Za-z0-9_]+")
_NUMBER = re.compile(r"([0-9]+)")


@lru_cache(maxsize=16384)
def natural_key(name: str) -> tuple[tuple[str | int, ...], str]:
    """Sort key that puts "2" before "10": digits compare as numbers, the rest as text.

    Names that are otherwise equal ("2" and "02") are ordered as text.
    """
    parts = _NUMBER.split(name)
    return tuple(int(part) if index % 2 else part for index, part in enumerate(parts)), name


def check_name(name: object) -> str:
    """Return the name if it is allowed for an agent.

    Raises:
        BadInput: not text, other characters than ASCII letters, digits and underscores, or more than `LONGEST`.
    """
    if isinstance(name, str) and _NAME.fullmatch(name):
        return check_length(name, LONGEST, "the agent's name")
    raise BadInput(
        f"{name!r} cannot be an agent's name: use ASCII letters, digits and underscores, as in '7' or 'uav_2'"
    )
