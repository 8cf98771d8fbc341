"""A formation as it flies: commands, sensors, truth, contacts, and that nothing hangs on when one looks."""

from __future__ import annotations

import math
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from volery.errors import BadInput
from volery.rotations import angle_between, integrate, rotate, to_matrix
from volery.topologies import Formation
from volery.units import period_ns
from volery.worlds.formation.air import Gust, Scripted, Turbulence
from volery.worlds.formation.camera import Camera
from volery.worlds.formation.formation_flight import RunningFormation
from volery.worlds.formation.formation_world import FormationWorld
from volery.worlds.formation.imu import Imu
from volery.worlds.formation.vehicles import GRAVITY, Vehicle

Floats = NDArray[np.float64]
MS, SECOND = 1_000_000, 1_000_000_000
UP = np.array([0.0, 0.0, 1.0])


def world(count: int = 3, spacing: float = 0.9, **change: Any) -> FormationWorld:
    """Vehicles on a line along x that all look north."""
    places = Formation(line=spacing).of(count)
    rows = tuple((x, y, z) for x, y, z in places.tolist())
    agents = tuple(str(number) for number in range(1, count + 1))
    return FormationWorld(**{"agents": agents, "places": rows, "headings": (0.0,) * count, "seed": 1, **change})


def exact(count: int = 3, **change: Any) -> FormationWorld:
    """The same, undisturbed."""
    return world(count, **change).undisturbed()


def trace(running: RunningFormation, extra: tuple[int, ...] = ()) -> list[list[float]]:
    """What is measured and true at 30 Hz under commands 11 ms later, for half a second, and at extra instants between.

    `extra` are offsets [ns] after each frame at which the world is advanced and looked at besides, for nothing.
    """
    found: list[list[float]] = []
    for frame in range(15):
        instant = period_ns(30.0, frame)
        running.advance(instant)
        for agent in ("1", "2", "3"):
            seen = running.measure(agent, "camera", frame)
            felt = running.measure(agent, "imu", frame)
            assert felt is not None
            found.append([*felt.tolist(), *(() if seen is None else seen.ravel().tolist())])
        found.extend(value.tolist() for value in running.truth().values())
        for offset in extra:
            running.advance(instant + offset)
            running.truth()
            running.measure("2", "imu", 1000 + frame)
            running.measure("2", "camera", 1000 + frame)
        running.advance(instant + 11 * MS)
        for number, agent in enumerate(("1", "2", "3")):
            running.act(agent, "thrust", np.array([0.5 * math.sin(frame), 0.2, 0.1 * number]))
            running.act(agent, "yaw-rate", np.array([0.3 * number]))
    return found


def test_results_do_not_hang_on_when_one_looks() -> None:
    """The same commands and samples are the same to the last bit, whatever is advanced and asked for in between."""
    gusty = world(gusts=Scripted((Gust(123_456_789, 100 * MS, (1.0, 0.0, 0.0)),)))
    plain = trace(gusty.begin())
    assert trace(gusty.begin()) == plain
    assert trace(gusty.begin(), extra=(1, 1_234_567, 5 * MS, 10_999_999)) == plain
    assert trace(pickle.loads(pickle.dumps(gusty)).begin(), extra=(7 * MS,)) == plain  # noqa: S301 - its own
    assert trace(replace(gusty, seed=2).begin()) != plain


def test_an_undisturbed_formation_hovers() -> None:
    """It stays where it is for seconds, and feels its weight."""
    running = exact().begin()
    before = running.truth()["positions"]
    running.advance(3 * SECOND)
    assert running.truth()["positions"] == pytest.approx(before, abs=1e-9)
    felt = running.measure("1", "imu", 0)
    assert felt is not None
    assert felt[:3] == pytest.approx(np.zeros(3), abs=1e-9)
    assert felt[3:6] == pytest.approx(GRAVITY * UP, abs=1e-9)
    dip = math.radians(63.0)
    assert felt[6:] == pytest.approx([math.cos(dip), 0.0, -math.sin(dip)], abs=1e-9)


def test_a_formation_falls_freely_without_thrust() -> None:
    """And feels nothing, but the drag that it is too slow for."""
    running = exact(vehicle=Vehicle(drag=0.0, command_timeout_ns=9 * SECOND)).begin()
    start = running.truth()["positions"]
    running.act("2", "thrust", -9.0 * UP)
    running.advance(SECOND)
    assert (running.truth()["positions"] - start)[3:6] == pytest.approx([0.0, 0.0, -GRAVITY / 2], abs=1e-9)
    felt = running.measure("2", "imu", 0)
    assert felt is not None
    assert felt[3:6] == pytest.approx(np.zeros(3), abs=1e-9)


def test_thrust_is_in_the_body_coordinates_of_the_instant_and_then_held() -> None:
    """A vehicle that looks west and is pushed ahead goes west, though it goes on turning."""
    running = exact(headings=(math.pi / 2,) * 3).begin()
    start = running.truth()["positions"]
    running.act("1", "yaw-rate", np.array([1.0]))
    running.act("1", "thrust", np.array([0.45, 0.0, 0.0]))
    running.advance(SECOND - 1)
    moved = (running.truth()["positions"] - start)[:3]
    assert moved[1] == pytest.approx(0.5 * (1.0 - 2 * 0.08), rel=0.1)
    assert np.abs(moved[[0, 2]]).max() < 0.02


def test_a_command_times_out() -> None:
    """A second after the last thrust the vehicle levels, and after the last yaw rate it turns no more."""
    running = exact().begin()
    running.act("1", "thrust", np.array([1.0, 0.0, 0.0]))
    running.act("1", "yaw-rate", np.array([0.5]))
    running.advance(SECOND - 20 * MS)
    leaning = running.truth()["attitude@1"]
    assert math.degrees(math.acos(rotate(leaning, UP)[2])) > 10.0
    running.advance(2 * SECOND)
    level = running.truth()["attitude@1"]
    assert math.degrees(math.acos(rotate(level, UP)[2])) < 0.1
    heading = 2.0 * math.atan2(level[3], level[0])
    assert heading == pytest.approx(0.5 * (1.0 + 0.5 / 60.0), abs=0.5 * 1.5 / 60.0)
    running.advance(3 * SECOND)
    assert running.truth()["attitude@1"] == pytest.approx(level, abs=1e-6)


def test_the_gyroscope_feels_how_the_attitude_turns() -> None:
    """Ṙ = R skew(ω): the readings, run forward at 1 kHz by the midpoint rule, lead to the true attitude."""
    running = exact(vehicle=Vehicle(command_timeout_ns=9 * SECOND)).begin()
    running.act("1", "yaw-rate", np.array([1.0]))
    running.act("1", "thrust", np.array([0.5, -0.7, 0.0]))
    attitude = running.truth()["attitude@1"]
    for index in range(1000):
        running.advance(index * MS + MS // 2)
        felt = running.measure("1", "imu", index)
        assert felt is not None
        attitude = integrate(attitude, felt[:3], 0.001)
    running.advance(SECOND)
    truth = running.truth()
    assert math.degrees(angle_between(attitude, truth["attitude@1"])) < 0.5
    felt = running.measure("1", "imu", 1000)
    assert felt is not None
    dip = math.radians(63.0)
    north = to_matrix(truth["attitude@1"]).T @ [math.cos(dip), 0.0, -math.sin(dip)]
    assert felt[6:] == pytest.approx(north, abs=1e-9)
    assert felt[:3] == pytest.approx([0.0, 0.0, 1.0], abs=0.2)


def test_the_accelerometer_feels_all_but_gravity() -> None:
    """R s − g is how the velocity changes, under thrust, drag, turbulence and a gust."""
    gusts = Scripted((Gust(400 * MS, SECOND, (0.0, 2.0, 0.0)),))
    calm = exact(gusts=gusts)
    running = replace(calm, gusts=gusts, turbulence=Turbulence(0.6, 0.5)).begin()
    running.act("1", "thrust", np.array([1.0, 0.0, 0.3]))
    running.advance(500 * MS)
    felt, before = running.measure("1", "imu", 0), running.truth()
    running.advance(500 * MS + 10_000)
    change = (running.truth()["velocities"] - before["velocities"])[:3] / 1e-5
    assert felt is not None
    assert rotate(before["attitude@1"], felt[3:6]) - GRAVITY * UP == pytest.approx(change, abs=1e-3)
    assert abs(change[1]) > 0.5


def test_the_accelerometer_feels_a_command_at_once() -> None:
    """More thrust along the body's axis is there at the instant of the command, and in a sample that is taken then."""
    running = exact().begin()
    running.advance(SECOND)
    before = running.measure("1", "imu", 0)
    running.act("1", "thrust", 0.9 * UP)
    after = running.measure("1", "imu", 0)
    assert before is not None
    assert after is not None
    assert (after - before)[3:6] == pytest.approx([0.0, 0.0, 0.9 / 0.45], abs=1e-9)


def test_a_gust_moves_all_alike() -> None:
    """Its impulse is acceleration times duration, wherever it lies on the grid; the shape of the formation stays."""
    calm = exact(vehicle=Vehicle(drag=0.0))
    running = replace(calm, gusts=Scripted((Gust(123_456_789, 500 * MS, (0.0, 1.0, 0.0)),))).begin()
    shape = running.truth()["formation"]
    running.advance(2 * SECOND)
    truth = running.truth()
    assert truth["velocities"].reshape(3, 3) == pytest.approx(np.tile([0.0, 0.5, 0.0], (3, 1)), abs=1e-9)
    assert truth["formation"] == pytest.approx(shape, abs=1e-9)
    assert truth["centre"] == pytest.approx(truth["positions"].reshape(3, 3).mean(axis=0))


def test_the_truth_of_the_formation() -> None:
    """r_i = p_i − p_(i+1) with its velocity, one after the other."""
    running = world(4).begin()
    running.advance(SECOND)
    truth = running.truth()
    p, v = truth["positions"].reshape(4, 3), truth["velocities"].reshape(4, 3)
    expected = np.hstack((p[:-1] - p[1:], v[:-1] - v[1:]))
    assert truth["formation"].reshape(3, 6) == pytest.approx(expected)
    assert np.abs(v).max() > 0.01


def test_a_collision_is_told_when_it_begins_and_when_it_ends() -> None:
    """Two vehicles that fly through each other are close for the time that two radii take, and go on undisturbed."""
    running = exact(2, spacing=2.0, vehicle=Vehicle(command_timeout_ns=9 * SECOND)).begin()
    running.act("1", "thrust", np.array([0.9, 0.0, 0.0]))
    seen = []
    for instant in range(0, 3 * SECOND, 100 * MS):
        running.advance(instant)
        seen += running.events()
    begins, ends = seen
    assert [each["event"] for each in seen] == ["collision", "collision over"]
    assert begins["agents"] == ends["agents"] == ["1", "2"]
    assert begins["distance_m"] < 0.4 <= ends["distance_m"]
    path = exact(2, spacing=2.0, vehicle=Vehicle(command_timeout_ns=9 * SECOND)).begin()
    path.act("1", "thrust", np.array([0.9, 0.0, 0.0]))
    for told, earlier in ((begins, 0.4), (ends, -0.4)):
        path.advance(told["time_ns"] - period_ns(60.0, 1) - 1)
        assert path.truth()["formation"][0] < -earlier
        path.advance(told["time_ns"])
        assert path.truth()["formation"][0] > -earlier


@pytest.mark.parametrize("ground", [True, False])
def test_the_ground_is_told_where_it_is_asked_for(ground: bool) -> None:
    """A vehicle that sinks below height 0 is on the ground, until it rises."""
    lifted = tuple((x, y, 0.5) for x, y, _ in world().places)
    running = exact(places=lifted, ground=ground).begin()
    running.act("3", "thrust", -2.0 * UP)
    running.advance(600 * MS)
    running.act("3", "thrust", 4.0 * UP)
    running.advance(1600 * MS)
    told = running.events()
    assert [(each["event"], each["agents"]) for each in told] == (
        [("ground", ["3"]), ("ground over", ["3"])] if ground else []
    )
    assert running.events() == []


def test_a_sensor_that_is_not_there() -> None:
    """The world names those that are, and refuses others."""
    blind = exact(camera=None)
    assert blind.sensors("1") == {"imu": 30.0}
    assert exact().sensors("1") == {"imu": 30.0, "camera": 30.0}
    assert list(exact().sensors("1")) == ["imu", "camera"]
    assert exact(camera=Camera(rate=15.0), imu=Imu(rate=60.0)).sensors("1") == {"imu": 60.0, "camera": 15.0}
    with pytest.raises(BadInput, match="vehicle 1 has no sensor 'camera': it has imu"):
        blind.begin().measure("1", "camera", 0)
    with pytest.raises(BadInput, match="it has none"):
        exact(camera=None, imu=None).begin().measure("1", "camera", 0)


@pytest.mark.parametrize(
    ("agent", "command", "value", "said"),
    [
        ("9", "thrust", [0.0, 0.0, 0.0], "agent '9' is no vehicle of the formation: it has 1, 2, 3"),
        ("1", "thurst", [0.0, 0.0, 0.0], "vehicle 1 knows no command 'thurst': it obeys thrust, yaw-rate"),
        ("1", "thrust", [0.0], "command thrust to vehicle 1 takes 3 finite values"),
        ("1", "yaw-rate", [0.0, 1.0], "takes 1 finite values"),
        ("1", "yaw-rate", [math.nan], "takes 1 finite values"),
    ],
)
def test_a_wrong_command_is_refused(agent: str, command: str, value: list[float], said: str) -> None:
    """With who, what and how many."""
    with pytest.raises(BadInput, match=said):
        world().begin().act(agent, command, np.array(value))


def test_time_does_not_go_back() -> None:
    """An earlier instant is refused, the same one is not."""
    running = world().begin()
    running.advance(5)
    running.advance(5)
    with pytest.raises(BadInput, match="at 5 ns and cannot go back to 4 ns"):
        running.advance(4)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"agents": ("1",)}, "at least 2 vehicles, not 1"),
        ({"headings": (0.0,)}, "1 headings for 3 vehicles"),
        ({"vehicle": Vehicle(radius=0.5)}, "vehicles 1 and 2 begin 0.9 m apart"),
        ({"steps": 10.0}, "steps is 10 Hz, it must be at least 1/attitude_response, 12.5 Hz"),
        ({"steps": math.inf}, "steps is inf Hz"),
        ({"truth_rate": 0.0}, "truth_rate is 0 Hz"),
        ({"vehicle": Vehicle(drag=99.0)}, "drag is 99 1/s, it must be at most steps"),
        ({"sense_delay_ns": 0}, "sense_delay is 0 ns, it must be at least 1 ns"),
        ({"act_delay_ns": -1}, "act_delay is -1 ns"),
    ],
)
def test_a_formation_that_cannot_be_is_refused(change: dict[str, Any], said: str) -> None:
    """With the value and the bound."""
    with pytest.raises(BadInput, match=said):
        world(**change)
