"""Checks of a live fault: errors, and notes on faults without effect."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from ...agents.plan import Plan
from ...agents.plan_codec import named_by_value
from ...agents.process import Pace
from ...agents.registry import offer_of
from ...errors import BadInput
from ...transport.faults import Fault, Kill, LinkFault, LinkName, effective
from ..scenario.consistency import forgets, placeless, settings_problems
from ..scenario.fault_conflicts import finding, idle_links, listed
from ..scenario.paces import check_pace


@dataclass(frozen=True)
class RunState:
    """State of the run when a live fault is injected.

    plan: the plan.
    pace: exact, lockstep or realtime.
    now_ns: nominal time.
    in_force: id → fault in force.
    alive: living agents.
    used: links that have carried a frame.
    """

    plan: Plan
    pace: Pace
    now_ns: int
    in_force: Mapping[str, Fault]
    alive: Collection[str]
    used: Collection[LinkName]


def refuse(drafted: Sequence[Fault], now: RunState) -> None:
    """Check live faults, with times relative to now; later faults of a random process are checked separately.

    Raises:
        BadInput: an impossible fault, or one without effect.
    """
    if not drafted:
        raise BadInput("no failure falls into what is left of the run: nothing was changed")
    check_pace((), drafted, realtime=now.pace == "realtime")
    for draft in drafted:
        _check_kind(draft, now)
        if isinstance(draft, LinkFault):
            _check_fit(draft, now)
        elif draft.agent not in now.alive:
            raise BadInput(f"agent {draft.agent} is not alive; `volery fault restart {draft.agent}` brings it back")
        until_ns = None if draft.until_ns is None else draft.until_ns + now.now_ns
        fault = replace(draft, at_ns=now.now_ns, until_ns=until_ns)
        found = finding(now.plan, fault, list(now.in_force.values()))
        if found and (found.impossible or draft.at_ns == 0):
            raise BadInput(found.text)


def _check_kind(draft: Fault, now: RunState) -> None:
    if isinstance(draft, Kill) and draft.at_ns > 0:
        raise BadInput("a random process of kills belongs into the scenario's faults; live, kill now")
    if (code := named_by_value(draft)) and not set(code) <= set(named_by_value(now.plan)):
        text = "is of this program alone, and the agents that run do not have it"
        raise BadInput(f"{', '.join(code)} {text}: put it into a module, or name it in the scenario too")
    if (forgetting := forgets(now.plan, draft)) is not None:
        raise BadInput(forgetting)


def _check_fit(fault: LinkFault, now: RunState) -> None:
    """Check that the frames of the agents still fit the links with their new settings."""
    plan = now.plan
    present = [other for other in now.in_force.values() if isinstance(other, LinkFault)]
    for link in fault.links:
        sender = plan.agent(link[0])
        payload = offer_of(plan, sender.name).largest_payload
        settings = replace(effective(plan.links[link], link, present, now.now_ns), **fault.changes)
        problems = [*settings_problems(settings, payload, sender.compute_ns), *placeless(plan, link, settings)]
        for field, text in problems:
            raise BadInput(f"{field} on {'>'.join(link)}: {text}")


def warnings(faults: Iterable[Fault], now: RunState) -> Iterator[str]:
    """Notes on links that carry nothing, so that a fault has no effect on them."""
    links = dict.fromkeys(link for fault in faults if isinstance(fault, LinkFault) for link in fault.links)
    silent = idle_links(now.plan, links)
    if silent:
        yield f"note: no effect on {listed(silent)}: {silent[0][0]} never sends"
    unused = [link for link in links if link not in now.used and link not in silent]
    if unused:
        yield f"note: no frame was seen on {listed(unused)} so far, so that this may have no effect"
