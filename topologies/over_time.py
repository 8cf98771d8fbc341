"""The `topology:` mapping of a scenario, turned into a graph over time: schedules, spans of edges, proximity."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import BadInput
from ..units import Unit, check_above_zero
from .building import OVER_TIME, build, edge, edge_list
from .graphs import agents, edges, positions
from .naming import natural_key
from .presence import Edge, Span, TimedGraph, epochs, timed

Places = Callable[[int], Mapping[str, Sequence[float] | NDArray[np.float64]]]
"""Instant in nanoseconds → agent → (x, y) or (x, y, z) in metres."""

ALWAYS = "always"
_MOST_INSTANTS = 1_000_000
_NANOSECONDS, _METRES = Unit("ns"), Unit("m")


def build_over_time(spec: Mapping[str, Any], seed: int, until_ns: int, places: Places | None = None) -> TimedGraph:
    """The graph of a scenario's `topology:` mapping over the time [0, until_ns).

    - {schedule: [{from: 0 s, ring: 6}, {from: 5 s, line: 6}]}: each graph holds until the next begins. Epochs written
      as {from: …, edges: [1-2, …]} may have any edges, all others are graphs of the same agents. Positions are those
      of the first epoch.
    - {edges: {1-2: always, 2-3: [[0 s, 2 s], [5 s]]}}: the spans of each edge; one without an end lasts.
    - {proximity: {radius: 30 m, every: 100 ms, hysteresis: 2 m}}: agents that move, see `near`.
    - anything else: a graph that does not change, see `build`.

    Raises:
        BadInput: an unknown kind or parameter, times that do not ascend or lie outside of the run, a union of all edges
            that is not connected, or proximity without agents that move.
    """
    for kind in OVER_TIME:
        if kind in spec and len(spec) > 1:
            beside = ", ".join(str(key) for key in spec if key != kind)
            raise BadInput(f"topology: {beside} beside {kind}: remove it, or move it into {kind}")
    if "schedule" in spec:
        return _schedule(spec["schedule"], seed, until_ns)
    if "proximity" in spec:
        return _proximity(spec["proximity"], until_ns, places)
    if len(spec) == 1 and isinstance(spec.get("edges"), Mapping):
        return _edges(spec["edges"], until_ns)
    return TimedGraph(build(spec, seed))


# -- schedules ----------------------------------------------------------------------------------------------------


def _schedule(written: Any, seed: int, until_ns: int) -> TimedGraph:
    if not isinstance(written, list | tuple) or not written:
        raise BadInput("topology.schedule: write a list, as in [{from: 0 s, ring: 6}, {from: 5 s, line: 6}]")
    begins, graphs = [], []
    for index, entry in enumerate(written):
        place = f"topology.schedule.{index}"
        if not isinstance(entry, Mapping) or "from" not in entry:
            raise BadInput(f"{place}: from is missing: write {{from: 0 s, ring: 6}}")
        begins.append(_instant(entry["from"], f"{place}.from", until_ns))
        graphs.append(_epoch({key: value for key, value in entry.items() if key != "from"}, place, seed))
    if begins[0] != 0:
        raise BadInput("topology.schedule.0.from: the first graph begins at 0 s")
    for index, (before, after) in enumerate(pairwise(begins), start=1):
        if after <= before:
            raise BadInput(f"topology.schedule.{index}.from: begins must ascend, the one before is {_seconds(before)}")
    everyone = sorted({name for _, names, _ in graphs for name in names}, key=natural_key)
    for index, (entry, (_, names, _)) in enumerate(zip(written, graphs, strict=True)):
        missing = [name for name in everyone if name not in names]
        if missing and "edges" not in entry:
            raise BadInput(
                f"topology.schedule.{index}: agents {', '.join(missing)} of other epochs are not in this one: "
                "give all the same agents, or write its edges"
            )
    spans = epochs(list(zip(begins, (its for its, _, _ in graphs), strict=True)), until_ns)
    return _timed("topology.schedule", spans, until_ns, everyone, graphs[0][2])


def _epoch(spec: Mapping[str, Any], place: str, seed: int) -> tuple[list[Edge], list[str], dict[str, Any]]:
    """Edges, agents and positions of one graph of a schedule; written as edges it need not be connected."""
    if len(spec) == 1 and "edges" in spec:
        try:
            its = edge_list(spec["edges"])
        except BadInput as error:
            raise BadInput(f"{place}.edges: {error}") from error
        return its, list(dict.fromkeys(name for ends in its for name in ends)), {}
    try:
        graph = build(spec, seed)
    except BadInput as error:
        raise BadInput(re.sub("^topology", place, str(error))) from error
    return edges(graph), agents(graph), positions(graph)


# -- spans of edges -----------------------------------------------------------------------------------------------


def _edges(written: Mapping[str, Any], until_ns: int) -> TimedGraph:
    spans: dict[Edge, list[Span]] = {}
    for word, its in written.items():
        place = f"topology.edges.{word}"
        try:
            ends = edge(word)
        except BadInput as error:
            raise BadInput(f"topology.edges: {error}") from error
        for known in (ends, ends[::-1]):
            if known in spans:
                raise BadInput(f"topology.edges: {word!r} is written twice: keep one, it carries both directions")
        spans[ends] = [(0, until_ns)] if its == ALWAYS else _spans(its, place, until_ns)
    return _timed("topology.edges", spans, until_ns)


def _spans(written: Any, place: str, until_ns: int) -> list[Span]:
    if not isinstance(written, list | tuple) or not written:
        raise BadInput(f"{place}: {written!r} has no spans: write always, or as in [[0 s, 2 s], [5 s]]")
    found: list[Span] = []
    for span in written:
        if not isinstance(span, list | tuple) or len(span) not in {1, 2}:
            raise BadInput(f"{place}: {span!r} is not a span: write [from, until], or [from] to the end")
        start = _instant(span[0], place, until_ns)
        end = _time(span[1], place) if len(span) == 2 else until_ns
        if end <= start:
            raise BadInput(
                f"{place}: the span from {_seconds(start)} ends at {_seconds(end)}, and that is not after it"
            )
        for other in found:
            if start < other[1] and other[0] < end:
                raise BadInput(f"{place}: the spans from {_seconds(other[0])} and {_seconds(start)} overlap: join them")
        found.append((start, end))
    return found


# -- proximity ----------------------------------------------------------------------------------------------------


def near(
    places: Places, radius: float, every_ns: int, hysteresis: float, until_ns: int
) -> tuple[list[str], dict[Edge, list[Span]]]:
    """The agents, and edge → the spans in which two are near each other, looked at every so often.

    Two that are not near become it at a distance of `radius` or less, and stay it up to radius + hysteresis: without
    hysteresis, an edge flutters between agents that keep just that distance. What is found at an instant holds until
    the next.

    Args:
        places: where the agents are.
        radius: in metres.
        every_ns: between two looks.
        hysteresis: in metres.
        until_ns: the end of the time.
    """
    names = sorted(places(0), key=natural_key)
    firsts, seconds = np.triu_indices(len(names), k=1)
    linked = np.zeros(len(firsts), dtype=bool)
    since: dict[int, int] = {}
    found: dict[Edge, list[Span]] = {}
    for time_ns in range(0, until_ns, every_ns):
        here = places(time_ns)
        points = np.array([here[name] for name in names])
        apart = np.linalg.norm(points[firsts] - points[seconds], axis=1)
        now = apart <= np.where(linked, radius + hysteresis, radius)
        for pair in np.flatnonzero(now != linked).tolist():
            if now[pair]:
                since[pair] = time_ns
            else:
                ends = names[firsts[pair]], names[seconds[pair]]
                found.setdefault(ends, []).append((since.pop(pair), time_ns))
        linked = now
    for pair, start in since.items():
        found.setdefault((names[firsts[pair]], names[seconds[pair]]), []).append((start, until_ns))
    return names, found


def _proximity(written: Any, until_ns: int, places: Places | None) -> TimedGraph:
    place = "topology.proximity"
    spec = written if isinstance(written, Mapping) else {"radius": written}
    for key in spec:
        if key not in ("radius", "every", "hysteresis"):
            raise BadInput(f"{place}: unknown parameter {key!r}: it is one of radius, every, hysteresis")
    if "radius" not in spec:
        raise BadInput(f"{place}: radius missing: write for example radius: 30 m")
    if places is None:
        raise BadInput(f"{place}: nobody moves: add a world in which agents do, `world: {{kind: moving, …}}`")
    radius = _metres(spec["radius"], f"{place}.radius")
    hysteresis = _metres(spec.get("hysteresis", 0), f"{place}.hysteresis")
    every_ns = _time(spec.get("every", "100 ms"), f"{place}.every")
    check_above_zero(f"{place}.radius: it", radius, "m")
    if not hysteresis >= 0:
        raise BadInput(f"{place}.hysteresis: it is {hysteresis:g} m, it must be at least 0")
    if every_ns < 1 or until_ns > every_ns * _MOST_INSTANTS:
        raise BadInput(f"{place}.every: in {_seconds(until_ns)} this is more than a million looks: make it longer")
    names, spans = near(places, radius, every_ns, hysteresis, until_ns)
    return _timed(place, spans, until_ns, names)


# -- what they share ----------------------------------------------------------------------------------------------


def _timed(
    place: str,
    spans: Mapping[Edge, Sequence[Span]],
    until_ns: int,
    names: Sequence[str] = (),
    places: Mapping[str, Any] | None = None,
) -> TimedGraph:
    try:
        return timed(spans, until_ns, names, places)
    except BadInput as error:
        raise BadInput(f"{place}: over the whole run, {error}") from error


def _time(value: object, place: str) -> int:
    with suppress(BadInput):
        return int(_NANOSECONDS.read(value))
    raise BadInput(f"{place}: {value!r} is not a time: write it with a unit, as in 5 s")


def _instant(value: object, place: str, until_ns: int) -> int:
    time_ns = _time(value, place)
    if not 0 <= time_ns < until_ns:
        raise BadInput(f"{place}: {value} is not within the run, which lasts {_seconds(until_ns)}")
    return time_ns


def _metres(value: object, place: str) -> float:
    try:
        return float(_METRES.read(value))
    except BadInput as error:
        raise BadInput(f"{place}: {error}") from error


def _seconds(time_ns: int) -> str:
    return f"{time_ns / 1e9:g} s"
