"""Whether the parts of a plan fit together: frames and the MTU, slots and airtimes, time and causality."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence

from ...agents import registry
from ...agents.plan import Plan
from ...errors import BadInput
from ...names import first_of
from ...transport.faults import Fault, Kill, LinkFault, LinkName, effective
from ...transport.links import LinkSettings
from ...transport.loss_settings import Distance
from ...transport.media_settings import ACCESSES, EDGE_SLOTS, HalfDuplex, SlottedAloha, Tdma, on_air
from ...worlds.own_world import OwnWorld
from .expansion import entry_index
from .yaml_document import Loc, Problem

RADIO_FIELDS = {"medium", "rate", "overhead", "bits_per_byte", "mtu", "queue", "bucket"}
"""Fields that all links of one radio have in common."""


def inconsistencies(plan: Plan) -> Iterator[Problem]:
    """Parts of a plan that do not fit together, with the faults of its timeline included."""
    for kind in sorted({agent.kind for agent in plan.agents}):
        for text in registry.problems_of(kind, plan):
            yield Problem(("agents",), text)
    if isinstance(plan.world, OwnWorld):
        for text in plan.world.impurities():
            yield Problem(("world",), text)
    for fault in plan.faults:
        if (forgetting := forgets(plan, fault)) is not None:
            yield Problem(("faults", entry_index(fault), "keep_state"), forgetting)
    for loc, text, links in (*_link_problems(plan), *_radio_problems(plan)):
        yield Problem(loc, f"{text} (link {first_of(['>'.join(link) for link in links], 1)})")


def forgets(plan: Plan, fault: Fault) -> str | None:
    """Why a kill cannot keep the state of its agent; None if it can, or need not."""
    if not isinstance(fault, Kill) or not fault.keep_state:
        return None
    kind = plan.agent(fault.agent).kind
    if registry.find(kind).keeps_state():
        return None
    return f"agents of kind {kind} keep no state: their class does not override save and restore"


def settings_problems(
    settings: LinkSettings, payload_bytes: int | None, compute_ns: int, slots: int = EDGE_SLOTS
) -> Iterator[tuple[str, str]]:
    """Settings that are impossible for an agent: (field of the links, sentence with the remedy).

    Args:
        settings: settings of one directed link.
        payload_bytes: largest payload that its sender offers; None if unknown.
        compute_ns: time from an event to the frames that the sender sends because of it.
        slots: number of slots in a cycle of the medium.
    """
    if payload_bytes is not None and payload_bytes > settings.mtu:
        text = f"a payload of {payload_bytes} B is larger than the MTU of {settings.mtu} B: send less, or raise mtu"
        yield "mtu", text
    medium = settings.medium
    if on_air(medium) and settings.rate is None:
        yield "rate", "a radio that several neighbours hear needs a rate: without airtime nothing could collide"
    if isinstance(medium, HalfDuplex) and isinstance(medium.access, SlottedAloha | Tdma):
        airtime_ns, usable_ns = settings.airtime_ns(payload_bytes or 0), medium.access.usable_ns(slots)
        if airtime_ns > usable_ns:
            slot = (
                f"{ACCESSES.name_of(type(medium.access))} slot, of which {max(0, usable_ns) / 1e6:.3f} ms can be used"
            )
            text = (
                f"a frame of {airtime_ns / 1e6:.3f} ms airtime does not fit a {slot}: "
                "send less, raise rate, or make the slots longer"
            )
            yield "medium", text
    if settings.bucket is not None and settings.bucket.burst < (payload_bytes or 0) + settings.overhead:
        frame = (payload_bytes or 0) + settings.overhead
        text = f"a frame of {frame} B does not fit a bucket of {settings.bucket.burst} B: send less, or raise burst"
        yield "bucket", text
    if compute_ns + settings.lookahead_ns() < 1:
        text = "compute, airtime and shortest latency add up to 0: give one of them a value, or events chase each other"
        yield "latency", text


def placeless(plan: Plan, link: LinkName, settings: LinkSettings) -> Iterator[tuple[str, str]]:
    """Losses that depend on a distance which is unknown: (field of the links, sentence with the remedy)."""
    for field in ("loss", "corruption"):
        if any(isinstance(model, Distance) for model in getattr(settings, field)):
            try:
                plan.distance_m(*link, 0)
            except BadInput as error:
                yield field, str(error)


def _radio_problems(plan: Plan) -> Iterator[tuple[Loc, str, list[LinkName]]]:
    """Links of one radio that differ in fields which a radio has only once, at the start or by a fault."""
    for agent in plan.agents:
        shared = [(agent.name, other) for other in agent.neighbours if on_air(plan.links[agent.name, other].medium)]
        for field in RADIO_FIELDS if shared else ():
            if len({getattr(plan.links[link], field) for link in shared}) > 1:
                yield ("links", "only"), f"agent {agent.name} has one radio, and {field} differs on its links", shared
        for fault in plan.faults:
            if isinstance(fault, LinkFault) and (text := part_of_a_radio(fault, shared)):
                yield ("faults", entry_index(fault), "where"), text, shared


def part_of_a_radio(fault: LinkFault, shared: Sequence[LinkName]) -> str | None:
    """Why a fault cannot change only some of the links of a radio; None if it can.

    Args:
        fault: the fault.
        shared: all links of one radio.
    """
    fields, touched = sorted(RADIO_FIELDS & fault.changes.keys()), set(shared) & set(fault.links)
    if not fields or not touched or len(touched) == len(shared):
        return None
    source = shared[0][0]
    return (
        f"agent {source} has one radio, {', '.join(fields)} can change on all of its links only: "
        f"name {', '.join('>'.join(link) for link in shared)}"
    )


def _link_problems(plan: Plan) -> Iterator[tuple[Loc, str, list[LinkName]]]:
    """Place, problem, and its links; links with the same settings and faults are checked once."""
    touching: dict[LinkName, list[LinkFault]] = defaultdict(list)
    for fault in plan.faults:
        if isinstance(fault, LinkFault):
            for link in fault.links:
                touching[link].append(fault)
    senders = {agent.name: agent for agent in plan.agents}
    payloads = {agent.name: registry.offer_of(plan, agent.name).largest_payload for agent in plan.agents}
    alike: dict[tuple[LinkSettings, tuple[str, ...], int | None, int, int], list[LinkName]] = defaultdict(list)
    for link, settings in plan.links.items():
        ids = tuple(fault.id for fault in touching[link])
        alike[settings, ids, payloads[link[0]], senders[link[0]].compute_ns, slots_of(plan, link)].append(link)
    found: dict[tuple[Loc, str], list[LinkName]] = defaultdict(list)
    for (_settings, _ids, payload, compute_ns, _slots), links in alike.items():
        for loc, text in _over_time(plan, links[0], touching[links[0]], payload, compute_ns):
            found[loc, text].extend(links)
    for (loc, text), links in found.items():
        yield loc, text, links


def slots_of(plan: Plan, link: LinkName) -> int:
    """Number of slots in a cycle of a link's medium."""
    return plan.slots[link[0]][1] if on_air(plan.links[link].medium) else EDGE_SLOTS


def _over_time(
    plan: Plan, link: LinkName, faults: Sequence[LinkFault], payload: int | None, compute_ns: int
) -> list[tuple[Loc, str]]:
    """The problems of a link's own settings; if there are none, those caused by its faults, at the latest fault."""
    slots = slots_of(plan, link)

    def problems(settings: LinkSettings) -> list[tuple[str, str]]:
        return [*settings_problems(settings, payload, compute_ns, slots), *placeless(plan, link, settings)]

    base = plan.links[link]
    found: dict[str, Loc] = {text: ("links", field) for field, text in problems(base)}
    times = sorted({time for fault in faults for time in (fault.at_ns, fault.until_ns) if time is not None})
    for time in times if not found else ():
        latest = max((fault for fault in faults if fault.at_ns <= time), key=lambda fault: fault.at_ns)
        for field, text in problems(effective(base, link, faults, time)):
            found.setdefault(text, ("faults", entry_index(latest), "set", field))
    return [(loc, text) for text, loc in found.items()]
