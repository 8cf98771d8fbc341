"""Worlds in which agents move."""

from __future__ import annotations

import math
import pickle
from typing import Any

import numpy as np
import pytest

from volery.errors import BadInput
from volery.worlds.moving.motions import Circle, MovingWorld, Paths, RandomWaypoint

from ...surroundings import build_world as build

S = 1_000_000_000
AREA = (100.0, 60.0)


def walkers(pause_ns: int = 0, count: int = 3, slowest: float = 1.0, fastest: float = 3.0) -> RandomWaypoint:
    """Agents between random waypoints."""
    return RandomWaypoint(tuple(str(number) for number in range(1, count + 1)), AREA, slowest, fastest, pause_ns)


def test_where_an_agent_is_depends_on_seed_and_time_alone() -> None:
    """Asked backwards, in another process's copy, or among more agents it is the same; another seed is another way."""
    times = [number * S // 3 for number in range(300)]
    world, more = MovingWorld(walkers(), 7), MovingWorld(walkers(count=9), 7)
    forth = [world.position("2", time) for time in times]
    copied = pickle.loads(pickle.dumps(world))  # noqa: S301 - made here
    back = [copied.position("2", time) for time in reversed(times)][::-1]
    np.testing.assert_array_equal(forth, back)
    np.testing.assert_array_equal(forth, [more.position("2", time) for time in times])
    assert not np.array_equal(forth[0], MovingWorld(walkers(), 8).position("2", 0))
    assert not np.array_equal(forth[0], world.position("1", 0))


def test_waypoints_lie_in_the_area_and_speeds_between_their_bounds() -> None:
    """Over 2,000 s, looked at every 10 ms: no step is longer than the largest speed allows, and straight ones are even.

    A step within one leg has that leg's speed; only a step over a waypoint can be shorter than the slowest allows.
    """
    step_ns = S // 100
    places = np.array([walkers().place("1", number * step_ns, 3) for number in range(200_000)])
    assert (places >= 0).all()
    assert (places <= AREA).all()
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) / 0.01
    assert speeds.max() <= 3.0 + 1e-9
    turns = np.abs(np.diff(speeds)) > 1e-6
    assert speeds[:-1][~turns].min() >= 1.0 - 1e-6
    assert 20 < turns.sum() < 400
    assert np.ptp(speeds[:-1][~turns]) > 1.0


def test_first_places_are_uniform_in_the_area() -> None:
    """Means of 4,000 agents within four standard errors of the middle; a uniform law has the deviation side / √12."""
    motion = walkers(count=4000)
    places = np.array([motion.place(agent, 0, 5) for agent in motion.agents])
    for axis, side in enumerate(AREA):
        assert places[:, axis].mean() == pytest.approx(side / 2, abs=4 * side / math.sqrt(12 * 4000))
        assert places[:, axis].std() == pytest.approx(side / math.sqrt(12), rel=0.05)


def test_an_agent_waits_at_each_waypoint() -> None:
    """With a pause of 5 s it stands still for 5 s, over and over, and moves in between."""
    step_ns = S // 10
    places = np.array([walkers(5 * S, slowest=3.0).place("1", number * step_ns, 3) for number in range(4000)])
    still = np.linalg.norm(np.diff(places, axis=0), axis=1) == 0
    changes = np.flatnonzero(np.diff(still.astype(int)))
    lengths = np.diff(changes)[0 if not still[0] else 1 :: 2]
    assert len(lengths) > 5
    assert set(lengths.tolist()) <= {49, 50}


def test_paths_are_straight_lines_between_their_points() -> None:
    """At even speed, and the last point is kept."""
    paths = Paths({"1": ((0, (0.0, 0.0)), (5 * S, (10.0, -5.0))), "2": ((0, (1.0, 2.0)),)})
    assert paths.place("1", 0, 0).tolist() == [0.0, 0.0]
    assert paths.place("1", 2 * S, 0).tolist() == [4.0, -2.0]
    assert paths.place("1", 99 * S, 0).tolist() == [10.0, -5.0]
    assert paths.place("2", 7 * S, 0).tolist() == [1.0, 2.0]


def test_a_formation_turns_about_its_centre() -> None:
    """A quarter turn later each of four agents is where the next one was; distances stay."""
    circle = Circle(("1", "2", "3", "4"), 20.0, 60 * S, (5.0, 0.0))
    np.testing.assert_allclose(circle.place("1", 0, 0), [25.0, 0.0])
    np.testing.assert_allclose(circle.place("1", 15 * S, 0), circle.place("2", 0, 0), atol=1e-12)
    backwards = Circle(("1", "2", "3", "4"), 20.0, -60 * S, (5.0, 0.0))
    np.testing.assert_allclose(backwards.place("2", 15 * S, 0), circle.place("1", 0, 0), atol=1e-12)
    apart = [np.linalg.norm(circle.place("1", t * S, 0) - circle.place("3", t * S, 0)) for t in range(60)]
    np.testing.assert_allclose(apart, 40.0)


def test_the_position_sensor_adds_normal_noise() -> None:
    """Mean and deviation of 4,000 samples within four standard errors; components and agents are independent."""
    world = MovingWorld(Paths({"1": ((0, (3.0, 4.0)),), "2": ((0, (3.0, 4.0)),)}), 1, rate=10.0, noise=0.5)
    assert world.sensors("1") == {"position": 10.0}
    samples = {agent: np.array([world.measure(agent, "position", index) for index in range(4000)]) for agent in "12"}
    for values in samples.values():
        np.testing.assert_allclose(values.mean(axis=0), [3.0, 4.0], atol=4 * 0.5 / math.sqrt(4000))
        np.testing.assert_allclose(values.std(axis=0), 0.5, rtol=4 / math.sqrt(2 * 4000))
    pairs = (samples["1"].T, (samples["1"][:, 0], samples["2"][:, 0]))
    assert all(abs(np.corrcoef(*pair)[0, 1]) < 4 / math.sqrt(4000) for pair in pairs)


def test_a_sample_shows_where_the_agent_is_when_it_is_taken() -> None:
    """Without noise the index-th sample is the place at index / rate."""
    world = MovingWorld(walkers(), 4, rate=8.0)
    seen = world.measure("3", "position", 20)
    assert seen is not None
    np.testing.assert_array_equal(seen, world.position("3", 2_500_000_000))
    np.testing.assert_array_equal(world.truth(S), np.concatenate([world.position(agent, S) for agent in "123"]))


def test_a_world_from_a_mapping() -> None:
    """Every way to move, with the names of the topology or a count of its own."""
    spec: dict[str, Any] = {
        "kind": "moving",
        "random-waypoint": {"area": ["100 m", 60], "speed": ["1 m/s", "10.8 km/h"], "pause": "2 s", "count": 2},
        "position": {"rate": "5 Hz", "noise": "20 cm"},
    }
    expected = MovingWorld(RandomWaypoint(("1", "2"), AREA, 1.0, 3.0, 2 * S), 9, 5.0, 0.2)
    assert build(spec, {}, 9) == expected
    assert build({"kind": "moving", "circle": {"radius": "20 m", "period": "60 s"}}, {}, 1, ["a", "b"]) == MovingWorld(
        Circle(("a", "b"), 20.0, 60 * S), 1
    )
    assert build(
        {"kind": "moving", "paths": {"10": {"5 s": [1, 2], "0 s": ["0 m", 0]}, "2": {"0 s": [0, 1]}}}, {}, 1
    ) == (MovingWorld(Paths({"2": ((0, (0.0, 1.0)),), "10": ((0, (0.0, 0.0)), (5 * S, (1.0, 2.0)))}), 1))
    steady = build({"kind": "moving", "random-waypoint": {"area": [1, 1, 1], "speed": "2 m/s", "count": 1}}, {}, 1)
    assert steady == MovingWorld(RandomWaypoint(("1",), (1.0, 1.0, 1.0), 2.0, 2.0), 1)
    assert steady.sensors("1") == {}


WAY = {"area": [10, 10], "speed": "1 m/s", "count": 2}


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ({}, "world: nobody moves: write one of random-waypoint, paths, circle"),
        ({"circle": {}, "paths": {}}, "world.circle.radius: is missing"),
        ({"random_waypoint": WAY}, r"world.random_waypoint: unknown field \(did you mean 'random-waypoint'\?\)"),
        ({"random-waypoint": 3}, "world.random-waypoint: should be a mapping of fields, not 3"),
        ({"random-waypoint": WAY | {"count": 0}}, "world.random-waypoint: count is 0, it must be at least 1"),
        ({"random-waypoint": {"area": [1, 1], "speed": "1 m/s"}}, "count is missing: the topology does not say"),
        ({"random-waypoint": WAY | {"speed": 0}}, "world.random-waypoint: speed is 0 to 0 m/s: it must be above 0"),
        ({"random-waypoint": WAY | {"speed": ["2 m/s", "1 m/s"]}}, "speed is 2 to 1 m/s"),
        ({"random-waypoint": WAY | {"speed": "1 m"}}, "world.random-waypoint.speed: '1 m' is not a quantity"),
        ({"random-waypoint": WAY | {"area": [0, 1]}}, r"area is \[0.0, 1.0\] m"),
        ({"random-waypoint": WAY | {"area": 5}}, "world.random-waypoint.area: should be a list, not 5"),
        ({"random-waypoint": WAY | {"pause": "-1 s"}}, "pause is -1000000000 ns"),
        ({"circle": {"radius": 0, "period": "1 s", "count": 2}}, "world.circle: radius is 0 m"),
        ({"circle": {"radius": "1 m", "period": 0, "count": 2}}, "world.circle: period is 0"),
        ({"circle": {"radius": "1 m", "period": "1 s", "count": 2, "centre": [0, 0, 0]}}, "world.circle: centre is"),
        ({"circle": {"period": "1 s", "count": 2}}, "world.circle.radius: is missing"),
        ({"paths": {}}, "world.paths: nobody moves"),
        ({"paths": {"1": {"1 s": [0, 0]}}}, r"world.paths: the path of agent 1 has the times \[1000000000\] ns"),
        ({"paths": {"1": {"0 s": [0, 0], "0 ms": [1, 0]}}}, "world.paths.1: one of 0 s, 0 ms occurs twice: keep one"),
        ({"paths": {"1": {"0 s": [0, 0]}, "2": {"0 s": [0, 0, 0]}}}, "places have 2 and 3 coordinates"),
        ({"paths": {"1": {"0 s": 7}}}, "world.paths.1.0 s: should be a list, not 7"),
        ({"random-waypoint": WAY, "position": {"rate": 0}}, "world.position.rate: rate is 0 Hz, it must be above 0"),
        ({"random-waypoint": WAY, "position": {"noise": "-1 m"}}, "world: position.noise is -1 m"),
        (
            {"random-waypoint": WAY, "position": {"sd": "1 m"}},
            r"world.position.sd: unknown field \(known: noise, rate\)",
        ),
    ],
)
def test_what_is_wrong_is_named_with_its_place_and_remedy(spec: dict[str, Any], message: str) -> None:
    """Ways to move, their parameters, the sensor."""
    with pytest.raises(BadInput, match=message):
        build({"kind": "moving"} | spec, {}, 1)


def test_a_world_moves_the_agents_of_the_topology() -> None:
    """Neither more nor fewer; an agent or a sensor that is not there is named."""
    with pytest.raises(BadInput, match="it moves agents 1, 2, the topology has 1, 2, 3: make them the same"):
        build({"kind": "moving", "random-waypoint": WAY}, {}, 1, ["1", "2", "3"])
    world = MovingWorld(walkers(), 1)
    with pytest.raises(BadInput, match="agent '9' is not in the world"):
        world.position("9", 0)
    with pytest.raises(BadInput, match="agent 1 has no sensor 'position'"):
        world.measure("1", "position", 0)
