"""A run in plan view: at each instant who is where, who believes whom to be where, and which links carry frames."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ...transport.faults import LinkName
from ...transport.links import DELIVERED, NANOSECONDS
from ..evaluation.evaluation import View
from ..evaluation.evaluation_result import Places
from ..record.channels import LinkCourse
from ..record.frame_fates import IN_FLIGHT, FrameFate, frame_fates
from ..record.record import Life, Record
from ..scenario.fault_labels import fault_label

Floats = NDArray[np.float64]

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
        if record.evaluated.places is None:
            raise BadInput(
                "the agents of this run have no places, so there is no plan view of it: "
                "take a topology with positions, or a world in which agents move"
            )
        self._record, self._plan = record, record.as_run
        self.last_ns = record.last_ns
        self._true, self.agents = record.evaluated.places, record.evaluated.places.names
        self._views, self._followed_places = record.evaluated.views, record.evaluated.followed
        everywhere = self._positions(0, self.last_ns, _LOOKS)
        spread, travelled = np.ptp(everywhere, axis=1).max(), np.ptp(everywhere.mean(axis=1), axis=0).max()
        self.follows = bool(travelled > spread > 0.0)
        self._deaths = dict(_deaths(record))
        outcomes = {link: sorted(_outcomes(frames)) for link, frames in frame_fates(record).items()}
        self.lately_ns = _lately(outcomes.values())
        self._links = {link: _LinkHistory(LinkCourse(record, link), frames) for link, frames in outcomes.items()}

    # -- where they are -------------------------------------------------------------------------------------------

    def _place(self, time_ns: int) -> Floats:
        """Of all agents, in natural order, (N, 2) [m]: on the straight line between the instants that are known."""
        times = self._true.time_ns
        after = int(np.clip(np.searchsorted(times, time_ns), 1, max(1, len(times) - 1)))
        first, last = after - 1, min(after, len(times) - 1)
        share = float(np.clip((time_ns - times[first]) / max(1, times[last] - times[first]), 0.0, 1.0))
        here, there = self._true.places[[first, last]]
        return np.asarray(here + share * (there - here))

    def _positions(self, from_ns: int, until_ns: int, count: int) -> Floats:
        """Of all agents, in natural order, at so many instants of a span, (count, N, 2) [m]."""
        times = np.linspace(from_ns, until_ns, count).astype(np.int64).tolist()
        return np.array([self._place(time_ns) for time_ns in times])

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

    def _view(self, agent: str, true: Mapping[str, Floats], centre: Floats, time_ns: int) -> View | None:
        """What an agent believes, from the centre, and shifted to fit what is true where it may be shifted."""
        if (of := self._views.get(agent)) is None or (row := of.row(time_ns)) < 0:
            return None
        believed = dict(_known(of, row))
        shift = -centre
        if of.relative[row]:
            known = [true[name] - place for name, place in believed.items() if name in true]
            shift = np.mean(known, axis=0) if known else shift
        covariances = {
            name: covariance
            for name, covariance in zip(of.names, of.covariances[row], strict=False)
            if name in believed and not np.isnan(covariance).all()
        }
        return View({name: place + shift for name, place in believed.items()}, covariances)

    def _followed(self, time_ns: int) -> Mapping[str, Floats]:
        """What is no agent, at its true place."""
        of = self._followed_places
        return {} if of is None or (row := of.row(time_ns)) < 0 else dict(_known(of, row))

    # -- all of it ------------------------------------------------------------------------------------------------

    def picture(self, time_ns: int) -> Picture:
        """What is to be seen at an instant [ns]."""
        places, down = self._place(time_ns), frozenset(self._down(time_ns))
        centre = np.mean(places, axis=0) if self.follows else np.zeros(2)
        true = dict(zip(self.agents, places - centre, strict=True))
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


def _known(of: Places, row: int) -> Iterator[tuple[str, Floats]]:
    """Names and places of a row, those that are known."""
    for name, place in zip(of.names, of.places[row], strict=True):
        if np.isfinite(place).all():
            yield name, place
