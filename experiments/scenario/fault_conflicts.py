"""Faults that contradict each other or have no effect: errors where they are given, notes where they are random."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from ...agents import registry
from ...agents.plan import Plan
from ...names import first_of
from ...topologies import natural_key
from ...transport.faults import ClockFault, Fault, Hog, Kill, LinkFault, LinkName, Pause, SensorFault, effective
from ...transport.media_settings import on_air
from .expansion import entry_index, entry_of
from .timeline import FaultEntry
from .yaml_document import Problem

_NAMED = 3
_STATES = {"cut": "cut", "hold": "held"}


class Finding(NamedTuple):
    """What is wrong with a fault, and whether it is impossible or only without effect."""

    text: str
    impossible: bool = False


def conflicts(plan: Plan, entries: Sequence[FaultEntry]) -> Iterator[Problem]:
    """Faults of a timeline that are impossible or without effect, one problem an entry.

    A fault at a random instant may be without effect.

    Args:
        plan: plan with the faults of the timeline.
        entries: the timeline.
    """
    reported: set[int] = set()
    for fault, earlier in _with_earlier(plan.faults):
        found, index = finding(plan, fault, earlier), entry_index(fault)
        if found and index not in reported and (found.impossible or entries[index].every is None):
            reported.add(index)
            yield Problem(("faults", index, entries[index].action), found.text)


def ineffective_faults(plan: Plan) -> Iterator[str]:
    """Notes on faults of a timeline that have no effect, or none on some links: one sentence an entry."""
    noted: set[str] = set()
    for fault, earlier in _with_earlier(plan.faults):
        found, entry = finding(plan, fault, earlier), entry_of(fault.id)
        text = found.text if found else _idle(plan, fault) if isinstance(fault, LinkFault) else None
        if text and entry not in noted:
            noted.add(entry)
            yield f"fault {fault.id}: {text}"


def _with_earlier(faults: Iterable[Fault]) -> Iterator[tuple[Fault, list[Fault]]]:
    """Each fault with the faults in force at its places that began before it, or with it but earlier in the file."""
    holding: dict[str | LinkName, list[Fault]] = defaultdict(list)
    for fault in sorted(faults, key=lambda fault: (fault.at_ns, natural_key(fault.id))):
        places: Sequence[str | LinkName] = fault.links if isinstance(fault, LinkFault) else (fault.agent,)
        for place in places:
            holding[place] = [other for other in holding[place] if other.in_force(fault.at_ns)]
        yield fault, list({other.id: other for place in places for other in holding[place]}.values())
        for place in places:
            holding[place].append(fault)


def finding(plan: Plan, fault: Fault, earlier: Sequence[Fault]) -> Finding | None:
    """What is wrong with a fault.

    Args:
        plan: the plan of the run.
        fault: the fault that begins.
        earlier: other faults in force at that instant.
    """
    if isinstance(fault, LinkFault):
        before = [other for other in earlier if isinstance(other, LinkFault)]
        return _moved(plan, fault) or _contradicted(fault, before) or _unchanged(plan, fault, before)
    of_agent = (other for other in earlier if not isinstance(other, LinkFault) and other.agent == fault.agent)
    return next((found for other in of_agent if (found := _doubled(fault, other))), None)


# -- links --------------------------------------------------------------------------------------------------------


def _moved(plan: Plan, fault: LinkFault) -> Finding | None:
    """A fault that moves links between transceivers: these are fixed before the run."""
    medium = fault.changes.get("medium")
    if medium is None:
        return None
    moved = [link for link in fault.links if on_air(plan.links[link].medium) != on_air(medium)]
    if not moved:
        return None
    side = "edge" if on_air(medium) else "node"
    text = f"a fault cannot move {listed(moved)} between transceivers of edges and radios of nodes: per stays {side}"
    return Finding(text, impossible=True)


def _contradicted(fault: LinkFault, earlier: Iterable[LinkFault]) -> Finding | None:
    for other in earlier:
        shared = [link for link in fault.links if link in other.links] if other.at_ns == fault.at_ns else []
        for name in fault.changes if shared else ():
            if name in other.changes and other.changes[name] != fault.changes[name]:
                text = f"{name} of {listed(shared)} becomes something else by {other.id} at the same instant: drop one"
                return Finding(text, impossible=True)
    return None


def _unchanged(plan: Plan, fault: LinkFault, earlier: Sequence[LinkFault]) -> Finding | None:
    for link in fault.links:
        before = effective(plan.links[link], link, earlier, fault.at_ns)
        if any(getattr(before, name) != value for name, value in fault.changes.items()):
            return None
    state = next((_STATES[name] for name, value in fault.changes.items() if name in _STATES and value), None)
    what = f"already {state}" if state else f"already so, {', '.join(fault.changes)} unchanged"
    return Finding(f"{what}: {listed(fault.links)}; nothing would change")


def idle_links(plan: Plan, links: Iterable[LinkName]) -> list[LinkName]:
    """Links whose source never sends, as far as its kind declares it."""
    silent = {agent.name for agent in plan.agents if registry.find(agent.kind).is_silent(plan, agent.name)}
    return [link for link in links if link[0] in silent]


def _idle(plan: Plan, fault: LinkFault) -> str | None:
    """A note on links that carry nothing while the fault is in force."""
    if silent := idle_links(plan, fault.links):
        return f"{listed(silent)} {_carry(silent)} nothing: {silent[0][0]} never sends"
    absent = [link for link in fault.links if not _is_there(plan, link, fault)]
    return f"{listed(absent)} {_carry(absent)} nothing: the graph has no such edge then" if absent else None


def _carry(links: Sequence[LinkName]) -> str:
    return "carry" if len(links) > 1 else "carries"


def _is_there(plan: Plan, link: LinkName, fault: Fault) -> bool:
    end_ns = plan.duration_ns if fault.until_ns is None else fault.until_ns
    spans = plan.presence.get(link)
    return spans is None or any(start < end_ns and fault.at_ns < end for start, end in spans)


def listed(links: Sequence[LinkName]) -> str:
    """The first links by name, and how many more."""
    return first_of([">".join(link) for link in links], _NAMED)


# -- agents and sensors -------------------------------------------------------------------------------------------

_OfAgent = Kill | Pause | Hog | ClockFault | SensorFault


def _doubled(fault: _OfAgent, other: _OfAgent) -> Finding | None:
    """Why a fault has no effect during another fault of its agent."""
    if isinstance(other, Kill) and (isinstance(fault, Kill) or _outlasts(other, fault)):
        text = f"agent {fault.agent} is down then already, by fault {other.id}: let one end before the other starts"
        return Finding(text, impossible=isinstance(fault, Kill))
    for kind, state in ((Pause, "paused"), (Hog, "hogged")):
        if isinstance(fault, kind) and isinstance(other, kind):
            return Finding(f"agent {fault.agent} is {state} already, by fault {other.id}")
    if isinstance(fault, SensorFault) and isinstance(other, SensorFault) and _hides(other, fault):
        name = f"{fault.agent}.{fault.sensor}"
        return Finding(f"sensor {name} has {other.trouble} already, by fault {other.id}")
    return None


def _outlasts(other: Fault, fault: Fault) -> bool:
    return other.until_ns is None or (fault.until_ns is not None and fault.until_ns <= other.until_ns)


def _hides(other: SensorFault, fault: SensorFault) -> bool:
    """Whether one sensor fault hides another: a failed sensor gives nothing, a stuck one repeats its first value."""
    if other.sensor != fault.sensor or not _outlasts(other, fault):
        return False
    return other.trouble == "failed" or (other.trouble, fault.trouble) == ("stuck", "stuck")
