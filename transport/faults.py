"""Faults as data: what changes, where, from when to when. Nothing in an agent or a link branches on a fault's name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from .links import LinkSettings

LinkName = tuple[str, str]


@dataclass(frozen=True)
class LinkFault:
    """Settings of some directed links that hold in [at, until); `until_ns` None: until cleared."""

    id: str
    at_ns: int
    until_ns: int | None
    links: tuple[LinkName, ...]
    changes: Mapping[str, Any]


@dataclass(frozen=True)
class Kill:
    """An agent handles everything before `at_ns`, then its process ends; a restart at `until_ns`, or none."""

    id: str
    at_ns: int
    until_ns: int | None
    agent: str


@dataclass(frozen=True)
class Pause:
    """An agent's processor stands still in [at, until): what comes meanwhile waits, in order."""

    id: str
    at_ns: int
    until_ns: int | None
    agent: str


Fault = LinkFault | Kill | Pause


def effective(base: LinkSettings, link: LinkName, faults: Iterable[LinkFault], now_ns: int) -> LinkSettings:
    """The settings of a link at an instant: its own, changed by the faults in force, the later start on top."""
    in_force = [
        fault
        for fault in faults
        if link in fault.links and fault.at_ns <= now_ns and (fault.until_ns is None or now_ns < fault.until_ns)
    ]
    changes: dict[str, Any] = {}
    for fault in sorted(in_force, key=lambda fault: (fault.at_ns, fault.id)):
        changes.update(fault.changes)
    return replace(base, **changes) if changes else base
