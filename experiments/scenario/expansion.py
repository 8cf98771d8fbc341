"""From entries of a timeline to the faults that they ask for: one for each agent, one for each failure of a process."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
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
    """The faults that an entry asks for, by time: one is named `fault_id`, several `fault_id`.1, `fault_id`.2 and on.

    Args:
        entry: what is written.
        fault_id: t3 is the third entry of a timeline, f2 the second live fault.
        places: what the entry may name.
        end_ns: when random processes end that do not say so themselves.
    Raises:
        BadInput: a link, agent or sensor that does not exist, or a partition that is none.
    """
    drafts = list(_DRAFTS[entry.action](entry, replace(places, fault_id=fault_id)))
    if entry.every is None:
        timed = [replace(draft, at_ns=entry.start_ns, until_ns=entry.until_ns) for draft in drafts]
    else:
        timed = _by_chance(entry, drafts, fault_id, places.seed, end_ns)
        timed.sort(key=lambda fault: fault.at_ns)
    if len(timed) == 1:
        return (replace(timed[0], id=fault_id),)
    return tuple(replace(fault, id=f"{fault_id}.{number}") for number, fault in enumerate(timed, start=1))


def entry_of(fault_id: str) -> str:
    """The id of the entry that a fault came from: t3 of t3 and of t3.2."""
    return fault_id.partition(".")[0]


def entry_index(fault: Fault) -> int:
    """The place, from 0, of the entry in its timeline that a fault came from."""
    return int(entry_of(fault.id)[1:]) - 1


def _by_chance(entry: FaultEntry, drafts: list[Fault], fault_id: str, seed: int, end_ns: int) -> list[Fault]:
    """The failures of each place by itself, or of all together."""
    assert entry.every is not None
    until_ns = end_ns if entry.until is None else min(entry.until, end_ns)
    alone = not entry.every.together and entry.partition is None
    units = {_place(part): [part] for draft in drafts for part in _parts(draft)} if alone else {(): drafts}
    entry.every.check(sum(map(len, units.values())), entry.start_ns, until_ns)
    return [
        replace(draft, at_ns=at_ns, until_ns=repaired_ns)
        for place, parts in units.items()
        for at_ns, repaired_ns in renewals(entry.every, entry.start_ns, until_ns, seed, fault_id, *place)
        for draft in parts
    ]


def _parts(draft: Fault) -> Iterator[Fault]:
    """A fault of many links as one of each edge."""
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


def _cut(entry: FaultEntry, places: Places) -> Iterator[Fault]:
    yield LinkFault(*_DRAFT, parse_links(entry.cut or (), places), {"cut": True})


def _hold(entry: FaultEntry, places: Places) -> Iterator[Fault]:
    yield LinkFault(*_DRAFT, parse_links(entry.hold or (), places), {"hold": True})


def _partition(entry: FaultEntry, places: Places) -> Iterator[Fault]:
    assert entry.partition is not None
    yield LinkFault(*_DRAFT, crossing(entry.partition, places), {"cut": True})


def _set(entry: FaultEntry, places: Places) -> Iterator[Fault]:
    changes: dict[str, Any] = dict(entry.set_ or {})
    yield LinkFault(*_DRAFT, changed_links(entry.where or (), changes, places), changes)


def _kill(entry: FaultEntry, places: Places) -> Iterator[Fault]:
    for agent in parse_agents(entry.kill or (), places):
        yield Kill(*_DRAFT, agent, bool(entry.keep_state))


def _pause(entry: FaultEntry, places: Places) -> Iterator[Fault]:
    for agent in parse_agents(entry.pause or (), places):
        yield Pause(*_DRAFT, agent)


def _hog(entry: FaultEntry, places: Places) -> Iterator[Fault]:
    for agent in parse_agents(entry.hog or (), places):
        yield Hog(*_DRAFT, agent, _WHOLE_SHARE if entry.share is None else entry.share)


def _clock(entry: FaultEntry, places: Places) -> Iterator[Fault]:
    for agent in parse_agents(entry.clock or (), places):
        yield ClockFault(*_DRAFT, agent, entry.offset or 0, entry.drift or 0)


def _sensor(entry: FaultEntry, places: Places) -> Iterator[Fault]:
    (trouble,) = (name for name in get_args(SensorTrouble) if entry.written(name) is not None)
    size = entry.bias or entry.noise or (entry.spikes.size if entry.spikes else ())
    probability = entry.spikes.probability if entry.spikes else 1.0
    for agent, sensor in parse_sensors(entry.sensor or (), places):
        components = _components(places, agent, sensor)
        if size and components is not None and len(size) not in (1, components):
            text = f"{trouble} has {len(size)} numbers and a sample of {agent}.{sensor} has {components}"
            raise BadInput(f"{text}: write one for all components, or one for each")
        yield SensorFault(*_DRAFT, agent, sensor, trouble, size, probability)


def _components(places: Places, agent: str, sensor: str) -> int | None:
    """How many numbers of a sample, or of a row of it, faults change, by the first that sees something; None if none.

    Of a coupled world only the first sample of all is known beforehand.
    """
    world = places.world
    assert world is not None
    if isinstance(world, Coupled):
        samples = iter([world.begin().measure(agent, sensor, 0)])
    else:
        samples = (world.measure(agent, sensor, index) for index in range(_LOOKED_AT))
    return next((numbers(sample).shape[-1] for sample in samples if sample is not None), None)


_DRAFTS: dict[str, Callable[[FaultEntry, Places], Iterator[Fault]]] = {
    "cut": _cut,
    "hold": _hold,
    "partition": _partition,
    "set": _set,
    "kill": _kill,
    "pause": _pause,
    "hog": _hog,
    "clock": _clock,
    "sensor": _sensor,
}


# -- live -----------------------------------------------------------------------------------------------------------

_ABSOLUTE = {"at": "a live fault starts at once", "until": "write for: 2 s", "from": "a live process starts at once"}


def parse_fault(written: Mapping[str, Any], fault_id: str, places: Places, lasting_ns: int) -> tuple[Fault, ...]:
    """A live fault, written as an entry of the timeline without times: {"cut": "3-7", "for": "2s"}.

    Args:
        written: the entry.
        fault_id: of the fault.
        places: what it may name.
        lasting_ns: how long a random process goes on, at most.
    Returns:
        The faults; their times are counted from the instant at which they will take effect.
    Raises:
        BadInput: what is wrong with it, all at once.
    """
    for name, remedy in _ABSOLUTE.items():
        if name in written:
            raise BadInput(f"{name}: {remedy}")
    start = {"from": "0 s"} if "every" in written else {"at": "0 s"}
    lasting = {"until": written["for"]} if "every" in written and "for" in written else {}
    fields = {**written, **start, **lasting}
    if lasting:
        del fields["for"]
    return expand(read(FaultEntry, fields), fault_id, places, lasting_ns)
