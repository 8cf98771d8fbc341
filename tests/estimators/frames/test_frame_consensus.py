"""One agent's frame through IMU readings, lost, late and repeated messages; three of them, until they agree."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from volery import rotations as rot
from volery.errors import BadInput
from volery.estimators.frames.frame_consensus import FrameConsensus
from volery.estimators.frames.inertial_frame import imu_model
from volery.estimators.frames.so3_consensus import disagreement, seen_attitude

Floats = NDArray[np.float64]

MODEL = imu_model(np.diag([0.005, 0.005, 0.009]), noise=(0.01, 1.0, 0.02), walk=(5.0, 0.05, 0.01))
ONE = np.array([1.0, 0.0, 0.0, 0.0])
IMU_NS, MS = 10_000_000, 1_000_000
SETTLED = 1e-5
"""What is left in these tests of the rate's unknown start [rad]: noise² / walk² = 4e-6 of 0.8 rad/s, for a moment."""
SPIN = np.array([0.0, 0.0, 0.8])


def turned(roll: float, pitch: float, yaw: float) -> Floats:
    """A rotation, from angles in degrees."""
    return rot.euler_to_quaternion(math.radians(roll), math.radians(pitch), math.radians(yaw))


def sense(agent: FrameConsensus, time_ns: int, attitude: Floats, rates: Floats) -> None:
    """One noiseless reading of all three sensors."""
    back = rot.conjugate(attitude)
    force, field = rot.rotate(back, np.array([0.0, 0.0, 9.81])), rot.rotate(back, np.array([0.5, 0.0, -0.8]))
    agent.predict(time_ns)
    agent.update(gyro=rates, accelerometer=force, magnetometer=field)


def flown(
    until_ns: int, start: Floats = ONE, frame: Floats = ONE, name: str = "1", anchor: float = 0.0
) -> FrameConsensus:
    """An agent that has sensed while it turned about body z at 0.8 rad/s; its own frame is off by `frame`."""
    agent = FrameConsensus(name, {other: 1.0 for other in "123" if other != name}, 1 / 3, MODEL, anchor=anchor)
    fly(agent, -IMU_NS, until_ns, start, frame)
    return agent


def fly(agent: FrameConsensus, after_ns: int, until_ns: int, start: Floats = ONE, frame: Floats = ONE) -> None:
    """Go on so, from after one instant to another."""
    for time_ns in range(after_ns + IMU_NS, until_ns + 1, IMU_NS):
        sense(agent, time_ns, rot.quaternion_product(frame, body(time_ns, start)), SPIN)


def body(time_ns: int, start: Floats = ONE) -> Floats:
    """The attitude of such a body."""
    return rot.integrate(start, SPIN, time_ns * 1e-9)


def known(attitude: Floats | None) -> Floats:
    """An attitude that has to be there."""
    assert attitude is not None
    return attitude


def test_nothing_is_known_before_both_directions_are() -> None:
    """Neither attitude nor message until accelerometer and magnetometer have been read, which may be at two times."""
    agent = FrameConsensus("1", {"2": 1.0}, 0.3, MODEL)
    agent.update(gyro=[0.0, 0.0, 0.0], accelerometer=[0.0, 0.0, 9.81])
    assert agent.attitude() is None
    assert agent.message("2", ONE, 0) is None
    assert not agent.receive("2", ONE, 0)
    agent.predict(IMU_NS)
    agent.update(magnetometer=[0.5, 0.0, -0.8])
    np.testing.assert_allclose(known(agent.attitude()), ONE, atol=1e-12)


def test_who_begins_upright_does_not_take_a_gust_for_up() -> None:
    """A gust leans the force by 11.5° for 0.1 s: ten more readings of 1 m/s² weigh 0.23 against 1° known before."""
    for upright, low, high in ((math.radians(1.0), 2.5, 3.3), (None, 11.0, 12.0)):
        agent = FrameConsensus("1", {"2": 1.0}, 0.3, MODEL, upright=upright)
        for time_ns in range(0, 11 * IMU_NS, IMU_NS):
            agent.predict(time_ns)
            agent.update(gyro=[0.0] * 3, accelerometer=[2.0, 0.0, 9.81], magnetometer=[0.5, 0.0, -0.8])
        tilted = rot.rotate(known(agent.attitude()), np.array([0.0, 0.0, 1.0]))
        assert low < math.degrees(math.acos(tilted[2])) < high


def test_attitude_between_and_after_readings_follows_the_rotation() -> None:
    """Half way between two readings, and 40 ms after the last, the attitude is the body's then; not after 100 ms."""
    agent = flown(500 * MS, turned(3, -2, 40))
    for time_ns in (123 * MS, 405 * MS, 500 * MS, 540 * MS):
        assert rot.angle_between(known(agent.attitude(time_ns)), body(time_ns, turned(3, -2, 40))) < SETTLED
    assert agent.attitude(601 * MS) is None
    agent.predict(560 * MS)
    assert rot.angle_between(known(agent.attitude()), body(560 * MS, turned(3, -2, 40))) < SETTLED


def test_a_gap_in_the_readings_is_bridged() -> None:
    """After 0.35 s without any the filter goes on, in steps that its prediction allows, and knows where it is."""
    agent = flown(200 * MS)
    agent.predict(550 * MS)
    sense(agent, 550 * MS, body(550 * MS), SPIN)
    assert rot.angle_between(known(agent.attitude()), body(550 * MS)) < SETTLED


def test_what_was_agreed_outlasts_the_readings_that_follow() -> None:
    """Half of 12° taken over from a neighbour at one time is still there a second of rotation later."""
    agent = flown(0)
    said = rot.quaternion_product(turned(0, 0, 12), body(0))
    assert agent.receive("2", said, 0)
    assert agent.agree() == pytest.approx(math.radians(12.0), rel=1e-6)
    fly(agent, 0, 1000 * MS)
    off = rot.quaternion_product(known(agent.attitude()), rot.conjugate(body(1000 * MS)))
    assert rot.angle_between(off, turned(0, 0, 4)) < SETTLED  # a step of 1/3
    assert rot.angle_between(known(agent.local_attitude()), body(1000 * MS)) < SETTLED


def test_a_late_message_counts_as_if_it_had_come_at_once() -> None:
    """Seen 430 ms ago, while the body turned by 20°: the correction is the one that a fresh message gives."""
    fresh, late = flown(500 * MS), flown(500 * MS)
    assert fresh.receive("2", rot.quaternion_product(turned(5, 0, 9), body(500 * MS)), 500 * MS)
    assert late.receive("2", rot.quaternion_product(turned(5, 0, 9), body(70 * MS)), 70 * MS)
    fresh.agree()
    late.agree()
    assert rot.angle_between(fresh.correction, ONE) > math.radians(3.0)
    assert rot.angle_between(fresh.correction, late.correction) < SETTLED


def test_messages_count_once_and_old_ones_not_at_all() -> None:
    """A repeated one, one overtaken by a newer, and one older than the memory are not used; nor is any used twice."""
    agent = flown(1500 * MS)
    said = rot.quaternion_product(turned(0, 0, 9), body(1400 * MS))
    assert agent.receive("2", said, 1400 * MS)
    assert not agent.receive("2", said, 1400 * MS)
    assert not agent.receive("2", said, 1300 * MS)
    assert not agent.receive("3", said, 400 * MS)
    assert not agent.receive("3", said, 1700 * MS)
    assert agent.agree() is not None
    first = agent.correction
    assert agent.agree() is None
    np.testing.assert_array_equal(agent.correction, first)
    assert not agent.receive("2", said, 1400 * MS)


def test_narrow_payloads_are_taken() -> None:
    """A quaternion that came in float16 has norm 1 to a thousandth: it is put right; zero is refused."""
    agent = flown(0)
    assert agent.receive("2", turned(4, 5, 6).astype(np.float16).astype(np.float64), 0)
    agent.agree()
    assert np.linalg.norm(agent.correction) == pytest.approx(1.0, abs=1e-15)
    with pytest.raises(BadInput, match="no direction"):
        agent.receive("3", np.zeros(4), 0)


@pytest.mark.parametrize("kept", [1.0, 0.5])
def test_three_agents_agree_on_one_frame(kept: float) -> None:
    """Frames 5° and 15° apart: through messages 250 ms old, half of them lost, to a hundredth of a degree.

    With a step of 1/3 a round contracts by 1/3 if all is heard, by some 2/3 if half is: (2/3)⁴⁰ = 1e-7.
    """
    random = np.random.default_rng(2)
    starts = {"1": turned(2, 1, 0), "2": turned(0, -3, 120), "3": turned(1, 0, -100)}
    frames = {"1": ONE, "2": turned(5, 0, 0), "3": turned(0, 0, 15)}
    agents = {name: flown(0, starts[name], frames[name], name) for name in starts}
    waiting: list[tuple[str, str, Floats, int]] = []
    for now_ns in range(0, 8000 * MS, 200 * MS):
        for source, target, said, taken_ns in waiting:
            if random.random() < kept:
                assert agents[target].receive(source, said, taken_ns)
        waiting = []
        for name, agent in agents.items():
            agent.agree()
            taken_ns = now_ns - 50 * MS if now_ns else 0
            for other in agents.keys() - {name}:
                relative = rot.quaternion_product(
                    rot.conjugate(body(taken_ns, starts[name])), body(taken_ns, starts[other])
                )
                waiting.append((name, other, known(agent.message(other, relative, taken_ns)), taken_ns))
        for name, agent in agents.items():
            fly(agent, now_ns, now_ns + 200 * MS, starts[name], frames[name])
    end_ns = 8000 * MS
    common = [
        rot.quaternion_product(known(agent.attitude()), rot.conjugate(body(end_ns, starts[name])))
        for name, agent in agents.items()
    ]
    assert disagreement(np.array(list(frames.values()))) > math.radians(5.0)
    assert disagreement(np.array(common)) < math.radians(0.01)


def test_an_anchor_holds_the_frame_and_costs_agreement() -> None:
    """A neighbour 12° off for ever: with κ = 0.1 and ε a = 1/3 the pull ends at 12° · (1/3) / (1/3 + 0.1)."""
    agent = flown(0, anchor=0.1)
    for time_ns in range(IMU_NS, 100 * IMU_NS, IMU_NS):
        sense(agent, time_ns, body(time_ns), SPIN)
        agent.receive("2", rot.quaternion_product(turned(0, 0, 12), body(time_ns)), time_ns)
        agent.agree()
    assert rot.angle_between(agent.correction, turned(0, 0, 12 / 1.3)) < SETTLED


def test_the_message_is_what_was_seen_in_the_agreed_frame() -> None:
    """Γ = C R ξ at the time at which the neighbour was seen."""
    agent = flown(500 * MS)
    agent.receive("2", rot.quaternion_product(turned(0, 0, 9), body(500 * MS)), 500 * MS)
    agent.agree()
    said = known(agent.message("3", turned(10, 20, 30), 450 * MS))
    own = rot.quaternion_product(agent.correction, body(450 * MS))
    assert rot.angle_between(said, seen_attitude(own, turned(10, 20, 30))) < SETTLED


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"weights": {"2": 0.0}}, "weights at 1 are .* positive"),
        ({"weights": {"1": 1.0}}, "weights at 1 are .* of neighbours only"),
        ({"step": 0.0}, "step at 1 is 0: above 0 and, by its own weights alone, below 1"),
        ({"step": 1.0}, "step at 1 is 1: .* below 1"),
        ({"step": 0.95, "anchor": 0.1}, "step at 1 is 0.95: .* below 0.95"),
        ({"anchor": 1.0}, "anchor is 1"),
        ({"upright": 0.0}, "upright is 0 rad"),
        ({"memory_ns": 0}, "memory at 1 is 0 ns"),
    ],
)
def test_settings_that_cannot_work_are_refused(change: dict[str, object], message: str) -> None:
    """Weights, steps, anchors and memories out of their bounds, with the agent's name."""
    settings = {"weights": {"2": 1.0, "3": 1.0}, "step": 0.3, "anchor": 0.0, "memory_ns": 10**9, **change}
    weights, step = settings.pop("weights"), settings.pop("step")
    with pytest.raises(BadInput, match=message):
        FrameConsensus("1", weights, step, MODEL, **settings)  # type: ignore[arg-type]


def test_strangers_are_refused() -> None:
    """Who is not a neighbour is neither told nor heard, the agent itself included."""
    agent = flown(0, anchor=0.1)
    for name in ("1", "9"):
        with pytest.raises(BadInput, match=f"'{name}' is not a neighbour"):
            agent.receive(name, ONE, 0)
        with pytest.raises(BadInput, match=f"'{name}' is not a neighbour"):
            agent.message(name, ONE, 0)
