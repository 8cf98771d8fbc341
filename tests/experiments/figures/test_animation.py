"""Runs in plan view: who is where, who is believed to be where, what links carry, and the films made of it."""

from __future__ import annotations

import stat
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image
from PIL.GifImagePlugin import GifImageFile

from volery.agents.agent import Agent, Timer
from volery.agents.journal import Batch, Estimate
from volery.agents.plan import WORLD, AgentPlan
from volery.errors import BadInput
from volery.experiments.evaluation.evaluation import Evaluation, View
from volery.experiments.figures.animation import animate, draw_picture, still
from volery.experiments.figures.plan_view import Carries, PlanView
from volery.experiments.record.evaluation_pass import evaluated
from volery.experiments.record.record import Record
from volery.quantities import Quantity
from volery.transport.faults import Kill, LinkFault
from volery.worlds.moving.motions import MovingWorld, Paths

MS = 1_000_000
Floats = NDArray[np.float64]
Make = Callable[..., Any]


class Survey(Evaluation):
    """Two places, and the spread of one of them."""

    quantities = (Quantity("spread", role="diagnostic"),)
    relative = False

    def view(self, agent: str, reports: Mapping[str, Floats]) -> View | None:
        """What it says, the spread for itself only."""
        if "places" not in reports:
            return None
        here, there = reports["places"].reshape(2, 2)
        return View({"1": here, "2": there}, {"1": reports["spread"].reshape(2, 2)}, self.relative)


class RelativeSurvey(Survey):
    """The same, but it knows of no origin."""

    relative = True


class Surveyor(Agent):
    """Says each 100 ms that itself is at (t, 1) and the other at (t, 3), t in seconds, known to 0.2 m and 0.1 m."""

    evaluation: ClassVar[type] = Survey

    def start(self) -> None:
        """Begin at once."""
        self.context.set_timer(self.context.now_ns, index=self.context.now_ns // (100 * MS))

    def on_timer(self, timer: Timer) -> None:
        """Report both, and come back."""
        t = timer.time_ns / 1e9
        self.context.report("places", [t, 1.0, t, 3.0], timer.index)
        self.context.report("spread", [0.04, 0.0, 0.0, 0.01], timer.index)
        self.context.set_timer((timer.index + 1) * 100 * MS, index=timer.index + 1)


class Relative(Surveyor):
    """The same, but it knows of no origin."""

    evaluation = RelativeSurvey


PATHS = Paths({"1": ((0, (0.0, 0.0)), (1000 * MS, (10.0, 0.0))), "2": ((0, (0.0, 4.0)),)})


@pytest.fixture
def surveyed(plan_of: Make, twin_run: Make) -> Make:
    """`surveyed(kind, faults)`: the record of two surveyors for a second; 1 moves from (0, 0) to (10, 0), 2 stays."""

    def make(kind: type[Agent] = Surveyor, *faults: Any) -> Record:
        plan = plan_of([("1", "2")], kind=kind, faults=faults)
        record: Record = twin_run(replace(plan, world=MovingWorld(PATHS, 7)))
        return record

    return make


def near(found: Floats, expected: tuple[float, float]) -> bool:
    """To rounding."""
    return bool(np.allclose(found, expected, atol=1e-12))


def test_true_places_and_beliefs_of_an_instant(surveyed: Make) -> None:
    """At 0.55 s agent 1 is at (5.5, 0) and was last reported to be at (0.5, 1); agent 2 says the same."""
    picture = PlanView(surveyed()).picture(550 * MS)
    assert near(picture.true["1"], (5.5, 0.0))
    assert near(picture.true["2"], (0.0, 4.0))
    assert set(picture.views) == {"1", "2"}
    assert near(picture.views["2"].places["1"], (0.5, 1.0))
    np.testing.assert_array_equal(picture.views["1"].covariances["1"], [[0.04, 0.0], [0.0, 0.01]])


def test_relative_beliefs_are_shifted_to_fit(surveyed: Make) -> None:
    """Two places 2 m apart, whose middle is that of the true ones, (2.75, 2) at 0.55 s."""
    places = PlanView(surveyed(Relative)).picture(550 * MS).views["1"].places
    assert near(places["1"], (2.75, 1.0))
    assert near(places["2"], (2.75, 3.0))


class MarkEvaluation(Evaluation):
    """Of a place."""

    def truth(self, agent: str, quantity: str, index: int, time_ns: int) -> Floats:
        """Where it was at the report of this index."""
        return np.array([index / 10, 2.0])

    def view(self, agent: str, reports: Mapping[str, Floats]) -> View | None:
        """One place."""
        return View({"mark": reports["mark"]}, {"mark": np.eye(2)}) if "mark" in reports else None


class Lookout(Surveyor):
    """Reports as `mark` that a mark is at (t, 1) where it is at (t, 2), and at an infinite place from 0.5 s on."""

    evaluation = MarkEvaluation

    def on_timer(self, timer: Timer) -> None:
        """Report it, and come back."""
        t = timer.time_ns / 1e9
        self.context.report("mark", [t if t < 0.5 else np.inf, 1.0], timer.index)
        self.context.set_timer((timer.index + 1) * 100 * MS, index=timer.index + 1)


def test_what_agents_follow_is_seen_at_its_true_place(surveyed: Make) -> None:
    """By the truth of what they report; beliefs that are not finite are left out; the frame of the picture holds it."""
    view = PlanView(surveyed(Lookout))
    assert near(view.picture(450 * MS).followed["mark"], (0.4, 2.0))
    assert near(view.picture(450 * MS).views["2"].places["mark"], (0.4, 1.0))
    assert view.picture(550 * MS).views["2"].places == {} == view.picture(550 * MS).views["2"].covariances
    assert near(PlanView(surveyed()).extent(0, 1000 * MS)[1], (10.0, 4.0))
    low, high = view.extent(0, 0)
    assert near(low, (0.0, 0.0))
    assert near(high, (0.0, 4.0))
    figure = Figure()
    draw_picture(figure, view, view.picture(450 * MS))
    assert "mark" in {text.get_text() for text in figure.legends[0].get_texts()}


def test_agents_that_say_nothing_of_places_believe_nothing(plan_of: Make, twin_run: Make) -> None:
    """Averagers report estimates, and are drawn where they are."""
    record = twin_run(replace(plan_of([("1", "2")]), world=MovingWorld(PATHS, 7)))
    assert PlanView(record).picture(500 * MS).views == {}


def test_who_is_dead_is_down_and_believes_nothing_until_it_returns(surveyed: Make) -> None:
    """Killed at 0.3 s, back at 0.6 s; half-open as all intervals."""
    view = PlanView(surveyed(Surveyor, Kill(id="k", at_ns=300 * MS, until_ns=600 * MS, agent="2")))
    down = {ms: view.picture(ms * MS).down for ms in (299, 300, 599, 601)}
    assert down == {299: frozenset(), 300: {"2"}, 599: {"2"}, 601: frozenset()}
    assert set(view.picture(400 * MS).views) == {"1"}
    assert view.picture(400 * MS).faults == ("kill 2",)
    assert view.picture(700 * MS).faults == ()


def test_fixed_places_are_those_of_the_topology(placed: Record) -> None:
    """Where nothing moves, agents are where the plan has them."""
    assert near(PlanView(placed).picture(0).true["2"], (3.0, 4.0))


def test_places_in_a_coupled_world_are_those_that_it_wrote_down(placed: Record) -> None:
    """Rows of `positions`, in natural order, and between two of them on the straight line."""
    plan = replace(placed.plan, world_agents=(AgentPlan(WORLD, "coupled-world", None, (), {}),))
    written = [Estimate(ms * MS, "positions", ms, [ms, 0.0, 9.0, 5.0, 5.0, 9.0]) for ms in (100, 200)]
    view = PlanView(evaluated(Record(plan, {(WORLD, 0): Batch(WORLD, 0, estimates=written)}, placed.events)))
    for ms, x in ((0, 100.0), (125, 125.0), (200, 200.0), (900, 200.0)):
        assert near(view.picture(ms * MS).true["1"], (x, 0.0))
        assert near(view.picture(ms * MS).true["2"], (5.0, 5.0))


def test_a_world_that_died_is_no_agent_that_is_down(placed: Record) -> None:
    """It has no place in the picture."""
    died = {"event": "died", "agent": WORLD, "incarnation": 0, "time_ns": 300 * MS, "cause": "was killed from outside"}
    view = PlanView(replace(placed, events=(*placed.events, died)))
    assert view.picture(500 * MS).down == frozenset()


def test_agents_without_places_are_not_to_be_seen(record_of: Make) -> None:
    """The message says what would have some."""
    with pytest.raises(BadInput, match=r"no places, .* a topology with positions, or a world in which agents move"):
        PlanView(record_of())


def test_view_follows_agents_that_travel_together(plan_of: Make, twin_run: Make) -> None:
    """Side by side over 100 m: at half time they are 1 m to either side of their centre, and so are their beliefs."""
    paths = Paths({name: ((0, (0.0, y)), (1000 * MS, (100.0, y))) for name, y in (("1", 0.0), ("2", 2.0))})
    record = twin_run(replace(plan_of([("1", "2")], kind=Surveyor), world=MovingWorld(paths, 7)))
    view = PlanView(record)
    picture = view.picture(500 * MS)
    assert view.follows
    assert near(picture.centre, (50.0, 1.0))
    assert near(picture.true["1"], (0.0, -1.0))
    assert near(picture.views["2"].places["1"], (0.5 - 50.0, 1.0 - 1.0))
    low, high = view.extent(0, 1000 * MS)
    assert near(low, (0.0, -1.0))
    assert near(high, (0.0, 1.0))
    figure = Figure()
    draw_picture(figure, view, picture)
    assert figure.axes[0].get_xlabel() == "x from the centre (m)"
    assert figure.axes[0].get_title(loc="left") == "0.5 s, centre at (50.0, 1.0) m"


@pytest.fixture
def placed(record_of: Make, sent: Make, heard: Make) -> Record:
    """Agents 5 m apart; 1 → 2: delivered at 105 ms, lost at 605 ms; cut from 900 ms on."""
    cut = LinkFault(id="c", at_ns=900 * MS, until_ns=None, links=(("1", "2"),), changes={"cut": True})
    record: Record = record_of(
        Batch("1", 0, sent=[sent(0, 100), sent(1, 600, "loss")]), Batch("2", 0, heard=[heard(0, 100)]), faults=(cut,)
    )
    agents = tuple(
        replace(agent, position=place)
        for agent, place in zip(record.plan.agents, ((0.0, 0.0), (3.0, 4.0)), strict=True)
    )
    return evaluated(replace(record, plan=replace(record.plan, agents=agents)))


def test_links_by_what_became_of_their_frames_of_late(placed: Record) -> None:
    """Late is three gaps of 500 ms here: through while a delivery is that near, then lost, and cut while it is cut."""
    view = PlanView(placed)
    assert view.lately_ns == 1500 * MS
    view.lately_ns = 300 * MS
    seen = {ms: view.picture(ms * MS).links["1", "2"] for ms in (104, 105, 404, 405, 605, 905)}
    assert seen == {
        104: Carries.QUIET,
        105: Carries.THROUGH,
        404: Carries.THROUGH,
        405: Carries.QUIET,
        605: Carries.LOST,
        905: Carries.LOST,
    }
    assert view.picture(905 * MS).links["2", "1"] is Carries.QUIET
    assert view.picture(905 * MS).faults == ("cut 1→2",)


def test_links_that_the_graph_does_not_have_are_not_drawn(placed: Record) -> None:
    """Before and after the spans in which an edge is there."""
    view = PlanView(replace(placed, plan=replace(placed.plan, presence={("1", "2"): ((200 * MS, 300 * MS),)})))
    assert [("1", "2") in view.picture(ms * MS).links for ms in (199, 200, 299, 300)] == [False, True, True, False]


def test_picture_has_everything_in_its_place(surveyed: Make) -> None:
    """Dots where agents are, rings where they are believed, an ellipse of two deviations, the time and the fault."""
    fault = LinkFault(id="c", at_ns=0, until_ns=None, links=(("1", "2"), ("2", "1")), changes={"cut": True})
    view = PlanView(surveyed(Surveyor, fault))
    figure = Figure()
    draw_picture(figure, view, view.picture(500 * MS))
    (axes,) = figure.axes
    points = np.concatenate([np.asarray(found.get_offsets()) for found in axes.collections]).round(9).tolist()
    assert {(5.0, 0.0), (0.0, 4.0), (0.5, 1.0), (0.5, 3.0)} <= set(map(tuple, points))
    outlines = [np.asarray(path.vertices) for found in axes.collections for path in found.get_paths()]
    spans = [np.ptp(outline, axis=0) for outline in outlines if len(outline) > 20]
    assert any(np.allclose(span, [0.8, 0.4], atol=1e-9) for span in spans)
    assert {text.get_text() for text in axes.texts} == {"1", "2"}
    assert (axes.get_title(loc="left"), axes.get_title(loc="right")) == ("0.5 s", "cut all")
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [
        "true place",
        "as 1 has it",
        "as 2 has it",
        "two standard deviations",
        "frames get through",
        "cut, or all frames lost",
    ]


def test_film_has_a_picture_for_each_instant(surveyed: Make, tmp_path: Path) -> None:
    """From 0.2 s to 0.8 s, five a second and at half the speed: seven pictures of 200 ms, and each is told of."""
    told: list[tuple[int, int]] = []
    path = animate(
        surveyed(),
        tmp_path,
        (200 * MS, 800 * MS),
        per_second=5.0,
        speed=0.5,
        film="gif",
        progress=lambda *done: told.append(done),
    )
    assert told == [(number, 7) for number in range(1, 8)]
    assert path == tmp_path / "animation.gif"
    with Image.open(path) as film:
        assert isinstance(film, GifImageFile)
        assert film.n_frames == 7
        assert film.info["duration"] == 200


def test_mp4_is_made_by_ffmpeg_where_it_is_found(
    surveyed: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A stand-in for ffmpeg gets the pictures, 560 x 560 RGBA each; without one the film is a GIF, or refused."""
    monkeypatch.setenv("PATH", str(tmp_path))
    record, span = surveyed(), (0, 200 * MS)
    assert animate(record, tmp_path, span).name == "animation.gif"
    with pytest.raises(BadInput, match="needs ffmpeg"):
        animate(record, tmp_path, span, film="mp4")
    program = tmp_path / "ffmpeg"
    program.write_text('#!/bin/sh\nfor last; do :; done\n/bin/cat > "$last"\n', encoding="utf-8")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    path = animate(record, tmp_path, span)
    assert path == tmp_path / "animation.mp4"
    assert path.stat().st_size == 3 * 560 * 560 * 4


def test_stills(surveyed: Make, tmp_path: Path) -> None:
    """Named for their instants, in each format."""
    assert still(surveyed(), tmp_path, 250 * MS, ["png", "svg"]) == [
        tmp_path / "still-0.25s.png",
        tmp_path / "still-0.25s.svg",
    ]
    with Image.open(tmp_path / "still-0.25s.png") as picture:
        assert picture.size == (1120, 1120)


def test_no_such_film(surveyed: Make, tmp_path: Path) -> None:
    """Formats, speeds and lengths that cannot be, with the remedy."""
    record = surveyed()
    for asked, message in (
        ({"film": "avi"}, "format 'avi': one of mp4, gif"),
        ({"speed": 0.0}, "speed is 0, it must be above 0"),
        ({"per_second": 4000.0}, "4,001 pictures, more than 3,000: .* --speed"),
    ):
        with pytest.raises(BadInput, match=message):
            animate(record, tmp_path, **asked)
    with pytest.raises(BadInput, match="a still at 2 s: the run ends at 1 s"):
        still(record, tmp_path, 2000 * MS)
