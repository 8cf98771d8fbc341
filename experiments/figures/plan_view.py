"""A run in plan view: at each instant who is where, who believes whom to be where, and which links carry frames."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from ...agents.agent import View
from ...agents.plan import moving
from ...agents.registry import find
from ...errors import BadInput
from ...topologies import natural_key
from ...transport.faults import LinkName
from ...transport.links import DELIVERED, NANOSECONDS
from ..analysis.channels import LinkCourse
from ..record.frame_fates import IN_FLIGHT, FrameFate, frame_fates
from ..record.record import Life, Record, Series
from ..scenario.fault_labels import fault_label

Floats = NDArray[np.float64]

POSITIONS = "positions"
"""What a coupled world calls its truth of where all agents are: a row each, in natural order."""
_LEAST_LATELY_NS = NANOSECONDS // 2
_FRAMES_LATELY = 3
_LOOKS = 200


class Carries(Enum):
    """What a link did with the frames of late."""

    THROUGH = "frames get through"
    LOST = "cut, or all frames lost"
    QUIET = "no frames"


@dataclass(frozen=True)
class Picture:
    """One instant: `true` name → place (2,) [m]; `views` who believes → what; `links`, `down` and `faults` in force.

    `followed`: true places of what is no agent, as a target. All places are from `centre` (2,) [m]: the origin, or the
    middle of all agents where the view follows them.
    """

    time_ns: int
    centre: Floats
    true: Mapping[str, Floats]
    followed: Mapping[str, Floats]
    views: Mapping[str, View]
    links: Mapping[LinkName, Carries]
    down: frozenset[str]
    faults: tuple[str, ...]


class PlanView:
    """A record, to be looked at from above at any instant.

    Where the agents travel together, farther than they are ever apart, the view `follows` their centre.

    Raises:
        BadInput: its agents have no places.
    """

    def __init__(self, record: Record) -> None:
        self._record, self._plan = record, record.as_run
        self.last_ns = record.last_ns
        self.agents = tuple(sorted((agent.name for agent in self._plan.agents), key=natural_key))
        self._place = self._places()
        everywhere = self._positions(0, self.last_ns, _LOOKS)
        apart, travelled = np.ptp(everywhere, axis=1).max(), np.ptp(everywhere.mean(axis=1), axis=0).max()
        self.follows = bool(travelled > apart > 0.0)
        reports = {quantity: record.estimates(quantity) for quantity in record.quantities()}
        self._reports = {
            agent: {quantity: mine[agent] for quantity, mine in reports.items() if agent in mine}
            for agent in self.agents
        }
        self._deaths = dict(_deaths(record))
        outcomes = {link: sorted(_outcomes(mine)) for link, mine in frame_fates(record).items()}
        self.lately_ns = _lately(outcomes.values())
        self._links = {link: _LinkHistory(LinkCourse(record, link), mine) for link, mine in outcomes.items()}

    # -- where they are -------------------------------------------------------------------------------------------

    def _places(self) -> Callable[[int], Mapping[str, Floats]]:
        """Of all agents at an instant: as a world wrote down, as one tells that moves them, or as the topology has."""
        written, world = self._record.world_reports.get(POSITIONS), moving(self._plan.world)
        if written is not None:
            return lambda time_ns: _interpolated(written, self.agents, time_ns)
        if world is not None:
            return lambda time_ns: {agent: world.position(agent, time_ns)[:2] for agent in self.agents}
        fixed = {agent.name: np.array(agent.position[:2]) for agent in self._plan.agents if agent.position is not None}
        if len(fixed) < len(self.agents):
            raise BadInput(
                "the agents of this run have no places, so there is no plan view of it: "
                "take a topology with positions, or a world in which agents move"
            )
        return lambda _: fixed

    def _positions(self, from_ns: int, until_ns: int, count: int) -> Floats:
        """Of all agents, in natural order, at so many instants of a span, (count, N, 2) [m]."""
        times = np.linspace(from_ns, until_ns, count).astype(np.int64).tolist()
        return np.array([[places[agent] for agent in self.agents] for places in map(self._place, times)])

    def path(self, from_ns: int, until_ns: int, count: int = 20) -> Floats:
        """Where all agents were in a span, as it is seen in a picture, (count, N, 2) [m], in natural order."""
        everywhere = self._positions(max(0, from_ns), until_ns, count)
        return everywhere - everywhere.mean(axis=1, keepdims=True) if self.follows else everywhere

    def extent(self, from_ns: int, until_ns: int) -> tuple[Floats, Floats]:
        """The lowest and the highest (x, y) [m] at which anybody, or what is followed, is seen in a span."""
        times = np.linspace(from_ns, until_ns, _LOOKS).astype(np.int64).tolist()
        seen = self.path(from_ns, until_ns, _LOOKS).reshape(-1, 2)
        followed = [place for time_ns in times for place in self._followed(time_ns).values()]
        everything = np.concatenate([seen, np.array(followed).reshape(-1, 2)])
        return everything.min(axis=0), everything.max(axis=0)

    # -- what they believe ----------------------------------------------------------------------------------------

    def _latest(self, agent: str, time_ns: int) -> dict[str, tuple[int, Floats]]:
        """Quantity → the sample of an agent's latest report of it, and what it reported."""
        found = {}
        for quantity, series in self._reports[agent].items():
            row = int(np.searchsorted(series.time_ns, time_ns, side="right")) - 1
            if row >= 0:
                found[quantity] = int(series.sample[row]), series.value[row]
        return found

    def _view(self, agent: str, true: Mapping[str, Floats], centre: Floats, time_ns: int) -> View | None:
        """What an agent believes, from the centre, and shifted to fit what is true where it may be shifted."""
        latest = {quantity: value for quantity, (_, value) in self._latest(agent, time_ns).items()}
        view = find(self._plan.agent(agent).kind).view(self._plan, latest)
        if view is None:
            return None
        shift = -centre
        if view.relative:
            known = [true[name] - place[:2] for name, place in view.places.items() if name in true]
            shift = np.mean(known, axis=0) if known else shift
        places = {name: place[:2] + shift for name, place in view.places.items() if np.isfinite(place[:2]).all()}
        return View(places, {name: view.covariances[name] for name in places if name in view.covariances})

    def _followed(self, time_ns: int) -> Mapping[str, Floats]:
        """What is no agent, at its true place: where the truth of what the first agent reported has it."""
        kind, latest = find(self._plan.agent(self.agents[0]).kind), self._latest(self.agents[0], time_ns)
        truths = {
            quantity: truth
            for quantity, (sample, _) in latest.items()
            if (truth := kind.truth(self._plan, quantity, sample, time_ns)) is not None
        }
        view = kind.view(self._plan, truths)
        return {} if view is None else {n: place[:2] for n, place in view.places.items() if n not in self.agents}

    # -- all of it ------------------------------------------------------------------------------------------------

    def picture(self, time_ns: int) -> Picture:
        """What is to be seen at an instant [ns]."""
        places, down = self._place(time_ns), frozenset(self._down(time_ns))
        centre = np.mean(list(places.values()), axis=0) if self.follows else np.zeros(2)
        true = {agent: place - centre for agent, place in places.items()}
        views = {agent: self._view(agent, true, centre, time_ns) for agent in self.agents if agent not in down}
        return Picture(
            time_ns,
            centre,
            true,
            {name: place - centre for name, place in self._followed(time_ns).items()},
            {agent: view for agent, view in views.items() if view is not None},
            {
                link: history.carries(time_ns, self.lately_ns)
                for link, history in self._links.items()
                if self._plan.is_present(link, time_ns)
            },
            down,
            tuple(
                fault_label(fault, len(self._plan.links))
                for fault in self._record.faults_in_effect
                if fault.at_ns <= time_ns and (fault.until_ns is None or time_ns < fault.until_ns)
            ),
        )

    def _down(self, time_ns: int) -> Iterator[str]:
        """Who is dead at an instant."""
        for (agent, life), at_ns in self._deaths.items():
            back_ns = self._record.restart_ns(agent, life)
            if at_ns <= time_ns and (back_ns is None or time_ns < back_ns):
                yield agent


class _LinkHistory:
    """What became of the frames of one link, by the instants at which it was settled."""

    def __init__(self, course: LinkCourse, outcomes: Sequence[tuple[int, bool]]) -> None:
        self._course = course
        self._times = [time_ns for time_ns, _ in outcomes]
        self._through = np.cumsum([0, *(through for _, through in outcomes)]).tolist()

    def carries(self, time_ns: int, lately_ns: int) -> Carries:
        """Whether frames came through within `lately_ns` before an instant."""
        first, after = bisect_right(self._times, time_ns - lately_ns), bisect_right(self._times, time_ns)
        if self._course.at(time_ns).cut:
            return Carries.LOST
        if self._through[after] > self._through[first]:
            return Carries.THROUGH
        return Carries.LOST if after > first else Carries.QUIET


def _deaths(record: Record) -> Iterator[tuple[Life, int]]:
    """When each life that was ended ended [ns], from outside or by a fault."""
    for agent in record.plan.agents:
        yield from (((agent.name, life), kill.at_ns) for life, kill in enumerate(record.as_run.kills(agent.name)))
    names = {agent.name for agent in record.plan.agents}
    for event in record.events:
        if event["event"] == "died" and event["agent"] in names:
            yield (event["agent"], event["incarnation"]), event["time_ns"]


def _outcomes(frames: Iterable[FrameFate]) -> Iterator[tuple[int, bool]]:
    """When the fate of each frame was settled [ns], and whether it came through."""
    for frame in frames:
        times = (frame.handed_ns, frame.due_ns, frame.dropped_ns)
        settled_ns = next((each for each in times if each is not None), None)
        if settled_ns is not None and frame.fate != IN_FLIGHT:
            yield settled_ns, frame.fate == DELIVERED


def _lately(outcomes: Iterable[Sequence[tuple[int, bool]]]) -> int:
    """How far back `of late` reaches [ns]: some frames of a typical link, and long enough to be seen."""
    gaps = [np.diff([time_ns for time_ns, _ in of_link]) for of_link in outcomes if len(of_link) > 1]
    typical_ns = float(np.median(np.concatenate(gaps))) if gaps else 0.0
    return max(_LEAST_LATELY_NS, int(_FRAMES_LATELY * typical_ns))


def _interpolated(written: Series, agents: Sequence[str], time_ns: int) -> Mapping[str, Floats]:
    """Places between those that a world wrote down."""
    after = int(np.clip(np.searchsorted(written.time_ns, time_ns), 1, max(1, len(written.time_ns) - 1)))
    rows = written.value[[after - 1, min(after, len(written.value) - 1)]].reshape(2, len(agents), -1)[:, :, :2]
    begin_ns, end_ns = written.time_ns[after - 1], written.time_ns[min(after, len(written.time_ns) - 1)]
    share = float(np.clip((time_ns - begin_ns) / max(1, end_ns - begin_ns), 0.0, 1.0))
    return dict(zip(agents, rows[0] + share * (rows[1] - rows[0]), strict=True))
