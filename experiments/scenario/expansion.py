"""Faults from entries of a timeline: one for each agent or sensor, one for each failure of a random process."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, get_args

from ...agents.plan import Coupled
from ...agents.sensor_samples import numbers
from ...errors import BadInput
from ...topologies import ordered
from ...transport.faults import ClockFault, Fault, Hog, Kill, LinkFault, Pause, SensorFault, SensorTrouble
from .explaining import read
from .fault_places import Places, changed_links, parse_agents, parse_links, parse_sensors
from .fault_processes import renewals
from .partitions import crossing
from .timeline import FaultEntry

_LOOKED_AT = 32
_WHOLE_SHARE = 1.0


def expand(entry: FaultEntry, fault_id: str, places: Places, end_ns: int) -> tuple[Fault, ...]:
    """The faults of an entry by time: a single one is called `fault_id`, several `fault_id`.1, `fault_id`.2 and so on.

    Args:
        entry: an entry of the timeline, or a live fault.
        fault_id: t3 for the third entry of a timeline, f2 for the second live fault.
        places: what the entry may name.
        end_ns: end of random processes without an `until`.
    Raises:
        BadInput: an unknown link, agent or sensor, or a partition that cuts nothing.
    """
    drafts = list(_drafts(entry, replace(places, fault_id=fault_id)))
    if entry.every is None:
        timed = [replace(draft, at_ns=entry.start_ns, until_ns=entry.until_ns) for draft in drafts]
    else:
        timed = _by_chance(entry, drafts, fault_id, places.seed, end_ns)
        timed.sort(key=lambda fault: fault.at_ns)
    if len(timed) == 1:
        return (replace(timed[0], id=fault_id),)
    return tuple(replace(fault, id=f"{fault_id}.{number}") for number, fault in enumerate(timed, start=1))


def entry_of(fault_id: str) -> str:
    """The id of a fault's entry: t3 for t3 and for t3.2."""
    return fault_id.partition(".")[0]


def entry_index(fault: Fault) -> int:
    """The index of a fault's entry in the timeline, from 0."""
    return int(entry_of(fault.id)[1:]) - 1


def _by_chance(entry: FaultEntry, drafts: list[Fault], fault_id: str, seed: int, end_ns: int) -> list[Fault]:
    """The random failures of each place separately, or of all together."""
    assert entry.every is not None
    until_ns = end_ns if entry.until is None else min(entry.until, end_ns)
    separate = not entry.every.together and entry.partition is None
    units = {_place(part): [part] for draft in drafts for part in _parts(draft)} if separate else {(): drafts}
    entry.every.check(sum(map(len, units.values())), entry.start_ns, until_ns)
    return [
        replace(draft, at_ns=at_ns, until_ns=repaired_ns)
        for place, parts in units.items()
        for at_ns, repaired_ns in renewals(entry.every, entry.start_ns, until_ns, seed, fault_id, *place)
        for draft in parts
    ]


def _parts(draft: Fault) -> Iterator[Fault]:
    """A fault of several links, split into one fault an edge."""
    if not isinstance(draft, LinkFault):
        yield draft
        return
    for edge in dict.fromkeys(ordered(*link) for link in draft.links):
        yield replace(draft, links=tuple(link for link in draft.links if ordered(*link) == edge))


def _place(draft: Fault) -> tuple[str, ...]:
    if isinstance(draft, LinkFault):
        return ordered(*draft.links[0])
    return (draft.agent, draft.sensor) if isinstance(draft, SensorFault) else (draft.agent,)


# -- one draft for each place ---------------------------------------------------------------------------------------

_DRAFT = ("", 0, None)


def _drafts(entry: FaultEntry, places: Places) -> Iterator[Fault]:
    """The faults of an entry without their times: one for all links, or one for each agent or sensor."""
    words = entry.given(entry.place)
    match entry.action:
        case "cut" | "hold" as state:
            yield LinkFault(*_DRAFT, parse_links(words, places), {state: True})
        case "partition":
            yield LinkFault(*_DRAFT, crossing(words, places), {"cut": True})
        case "set":
            changes = dict(entry.set_ or {})
            yield LinkFault(*_DRAFT, changed_links(words, changes, places), changes)
        case "sensor":
            yield from _of_sensors(entry, places)
        case _:
            for agent in parse_agents(words, places):
                yield _of_agent(entry, agent)


def _of_agent(entry: FaultEntry, agent: str) -> Fault:
    match entry.action:
        case "kill":
            return Kill(*_DRAFT, agent, bool(entry.keep_state))
        case "pause":
            return Pause(*_DRAFT, agent)
        case "hog":
            return Hog(*_DRAFT, agent, _WHOLE_SHARE if entry.share is None else entry.share)
        case _:
            return ClockFault(*_DRAFT, agent, entry.offset or 0, entry.drift or 0)


def _of_sensors(entry: FaultEntry, places: Places) -> Iterator[Fault]:
    (trouble,) = (name for name in get_args(SensorTrouble) if entry.given(name) is not None)
    size = entry.bias or entry.noise or (entry.spikes.size if entry.spikes else ())
    probability = entry.spikes.probability if entry.spikes else 1.0
    for agent, sensor in parse_sensors(entry.sensor or (), places):
        components = _components(places, agent, sensor)
        if size and components is not None and len(size) not in (1, components):
            text = f"{trouble} has {len(size)} numbers and a sample of {agent}.{sensor} has {components}"
            raise BadInput(f"{text}: write one for all components, or one for each")
        yield SensorFault(*_DRAFT, agent, sensor, trouble, size, probability)


def _components(places: Places, agent: str, sensor: str) -> int | None:
    """The number of components of a sample, or of a row of it; None where the first samples are empty.

    In a coupled world only the very first sample is known before the run.
    """
    world = places.world
    assert world is not None
    if isinstance(world, Coupled):
        samples = iter([world.begin().measure(agent, sensor, 0)])
    else:
        samples = (world.measure(agent, sensor, index) for index in range(_LOOKED_AT))
    return next((numbers(sample).shape[-1] for sample in samples if sample is not None), None)


# -- live -----------------------------------------------------------------------------------------------------------

_ABSOLUTE = {"at": "a live fault starts at once", "until": "write for: 2 s", "from": "a live process starts at once"}


def parse_fault(source: Mapping[str, Any], fault_id: str, places: Places, lasting_ns: int) -> tuple[Fault, ...]:
    """The faults of a live fault, given as an entry of the timeline without times: {"cut": "3-7", "for": "2s"}.

    Args:
        source: the entry.
        fault_id: id of the live fault.
        places: what it may name.
        lasting_ns: longest duration of a random process.
    Returns:
        The faults, with times relative to the instant at which they take effect.
    Raises:
        BadInput: all that is wrong with the entry.
    """
    for name, remedy in _ABSOLUTE.items():
        if name in source:
            raise BadInput(f"{name}: {remedy}")
    start = {"from": "0 s"} if "every" in source else {"at": "0 s"}
    lasting = {"until": source["for"]} if "every" in source and "for" in source else {}
    fields = {**source, **start, **lasting}
    if lasting:
        del fields["for"]
    return expand(read(FaultEntry, fields), fault_id, places, lasting_ns)
