"""Moving horizon estimation as an agent: configurations, what comes late or not at all, and what is refused."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import msgpack
import numpy as np
import pytest
from numpy.typing import NDArray

from volery.agents import measurements
from volery.agents.agent import Received
from volery.agents.measurements import Measurement
from volery.agents.mhe.estimator import ATTITUDE, COUNTS, DISTURBANCE, Mhe
from volery.agents.mhe.mhe_settings import PLACES, MheParameters
from volery.agents.mhe.track import IN_TIME, LATE, TOO_LATE, Track
from volery.errors import BadInput
from volery.estimators.horizon.quadrotor_model import Deviations
from volery.experiments.evaluation.mhe_evaluation import MheEvaluation
from volery.experiments.record.record import Record
from volery.experiments.scenario.load import load_scenario
from volery.experiments.scenario.validate import validate_plan
from volery.experiments.twin import recorded
from volery.worlds.quadrotor.quadrotor_sensors import DEVIATIONS

Floats = NDArray[np.float64]
MS = 1_000_000
HUB = "agents.only.1"
STILL = ("world.roll=0 rad", f"{HUB}.configurations=[A]")
EARLY_ROLL = "world.roll={steps: {0 s: 0 rad, 500 ms: 0.1 rad}}"


def flown(scenario: str, *changes: str, central: bool = False) -> Record:
    """The record of a scenario with changes, run in the twin, if asked with what a central estimator says."""
    plan = load_scenario(scenario, changes).plan
    with pytest.MonkeyPatch.context() as patch:
        if not central:
            patch.setattr(MheEvaluation, "central_estimate", lambda *_: None)
        return recorded(plan)


def errors(record: Record, quantity: str, since: int = 0) -> Floats:
    """Estimate less truth of the hub from a point on, (n, k)."""
    series = record.estimates(quantity)["hub"]
    return (series.value - record.truth(quantity)["hub"])[series.sample >= since]


def rms(values: Floats) -> Floats:
    """Root mean square of each column."""
    return np.asarray(np.sqrt((values**2).mean(axis=0)))


def test_all_sensors_hold_a_roll_to_a_fraction_of_a_milliradian_and_imu_alone_a_hundred_times_worse() -> None:
    """Bassolillo 2025, Fig. 2, three seconds of it: A within 0.3 mrad in roll and pitch, B loses most of the roll."""
    record = flown("mhe-roll", "duration=4 s", EARLY_ROLL)
    full, inertial = (rms(errors(record, f"attitude {name}", since=100)) for name in "AB")
    assert (full[:2] < 3e-4).all()
    assert inertial[0] > 100 * full[0]
    assert rms(errors(record, "altitude A", since=100)) < 5e-4
    counts = record.estimates(COUNTS)["hub"].value[-1]
    assert counts.tolist() == [9 * 400, 0, 0, 0, 0, 0]


@pytest.mark.parametrize("printed", [False, True])
def test_the_sign_in_13_decides_whether_b_under_or_over_estimates(printed: bool) -> None:
    """With the right physics the roll of 0.1 rad shrinks in the estimate, as printed it grows."""
    switches = ("world.as_printed=[accelerometer]", f"{HUB}.as_printed=[accelerometer]") if printed else ()
    record = flown("mhe-roll", "duration=2 s", EARLY_ROLL, f"{HUB}.configurations=[B]", *switches)
    off = errors(record, "attitude B")[-1, 0]
    assert off > 0.03 if printed else off < -0.03


def test_over_links_that_neither_lose_nor_lag_it_is_its_oracle() -> None:
    """Every sample in time and in float64: the same bits."""
    record = flown("mhe-yaw", "duration=300 ms", "world.yaw={steps: {0 s: 0 rad, 100 ms: 0.1 rad}}", central=True)
    compared = 0
    for quantity in record.quantities():
        if quantity != COUNTS:
            series = record.estimates(quantity)["hub"]
            np.testing.assert_array_equal(series.value, record.central(quantity)["hub"])
            compared += len(series.value)
    assert compared > 200


def test_what_comes_late_helps_the_window_and_not_the_filter() -> None:
    """Most samples come a point or two late: the window's error stays below that of the filter, which misses them."""
    record = flown("mhe-lossy", "duration=3 s", "world.roll={steps: {0 s: 0 rad, 1 s: 0.1 rad}}", "faults=[]")
    window, filtered = (rms(errors(record, f"attitude A{name}", since=50)) for name in ("", " ekf"))
    assert (window[:2] < 6e-4).all()
    assert window[0] < 0.8 * filtered[0]
    in_time, late, too_late, *_ = record.estimates(COUNTS)["hub"].value[-1]
    assert late > 0.4 * in_time
    assert too_late == 0


def test_what_is_older_than_the_window_is_counted_and_left_out() -> None:
    """A latency of 150 ms is 15 points, the window has 10."""
    record = flown("mhe-roll", "duration=500 ms", "links.latency=150 ms")
    in_time, late, too_late, *_ = record.estimates(COUNTS)["hub"].value[-1]
    assert (in_time, late) == (0, 0)
    assert too_late > 200


def test_a_bias_of_the_gyroscope_is_estimated_where_it_is_a_state() -> None:
    """A bias of 0.01 rad/s about z, from the start, drags the yaw by milliradians; as a state it is found."""
    fault = "faults=[{at: 0 s, sensor: imu.gyroscope, bias: [0.0, 0.0, 0.01]}]"
    dragged, found = (
        rms(
            errors(
                flown("mhe-roll", "duration=4 s", *STILL, fault, *more),
                "attitude A",
                250,
            )
        )
        for more in ((), (f"{HUB}.gyroscope_bias=true",))
    )
    assert dragged[2] > 5e-3
    assert found[2] < 1.5e-3


def test_a_bias_of_the_accelerometer_is_estimated_where_it_is_a_state() -> None:
    """A bias of 0.3 m/s² along z, from the start, lifts the altitude by a millimetre; as a state it is found."""
    fault = "faults=[{at: 0 s, sensor: imu.accelerometer, bias: [0.0, 0.0, 0.3]}]"
    lifted, found = (
        rms(
            errors(
                flown("mhe-roll", "duration=2 s", *STILL, fault, *more),
                "altitude A",
                100,
            )
        )[0]
        for more in ((), (f"{HUB}.accelerometer_bias=true",))
    )
    assert lifted > 8e-4
    assert found < 3e-4


def test_a_gyroscope_that_breaks_its_bound_meets_it() -> None:
    """0.2 rad/s of bias for half a second: the window ascribes 0.05 rad/s of it to the sensor and no more."""
    fault = "faults=[{at: 500 ms, sensor: imu.gyroscope, bias: [0.2, 0.0, 0.0]}]"
    record = flown("mhe-roll", "duration=1 s", f"{HUB}.configurations=[A]", fault)
    oldest = record.estimates(f"{DISTURBANCE} A")["hub"].value[:, 0]
    assert abs(oldest).max() == pytest.approx(0.05, abs=1e-9)
    assert record.estimates(COUNTS)["hub"].value[-1, -1] > 20


def test_one_that_comes_back_begins_anew_and_finds_its_way() -> None:
    """Killed in the middle of a roll and back 200 ms later: after half a second it is right to 1 mrad."""
    fault = "faults=[{at: 1 s, for: 200 ms, kill: hub}]"
    record = flown("mhe-roll", "duration=2 s", EARLY_ROLL, f"{HUB}.configurations=[A]", fault)
    points = record.estimates("attitude A")["hub"].sample
    assert np.diff(points).max() == 21
    assert (abs(errors(record, "attitude A", since=170)) < 1e-3).all()


def test_one_that_keeps_its_state_goes_on_where_it_stood() -> None:
    """A track that takes up what another saved says the same bits, window and filter; a killed hub counts on too."""
    sensors = {"imu": ("gyroscope", "accelerometer", "magnetometer"), "eye": ("flow",), "low": ("range_centre",)}
    parameters = MheParameters(sensors, horizon=4, gyroscope_bias=True)
    one, other = Track(parameters, "A", 3), Track(parameters, "A", 9)
    rng = np.random.default_rng(1)

    def feed(tracks: list[Track], point: int) -> list[Floats]:
        for sensor, size in (("gyroscope", 3), ("magnetometer", 3), ("flow", 2)):
            values = rng.normal(size=size) * 0.1
            for track in tracks:
                track.put(sensor, point, values)
        return [np.concatenate([pair.window.state, pair.filtered]) for pair in (t.estimate(point) for t in tracks)]

    for point in range(3, 12):
        feed([one], point)
    other.restore(msgpack.unpackb(msgpack.packb(one.save())))
    for point in (12, 15, 16):
        mine, others = feed([one, other], point)
        assert (mine == others).all()
    fault = "faults=[{at: 500 ms, for: 100 ms, kill: hub, keep_state: true}]"
    record = flown("mhe-yaw", "duration=800 ms", "world.yaw=0 rad", f"{HUB}.configurations=[A]", fault)
    assert record.estimates(COUNTS)["hub"].value[-1, 0] > 9 * 60


def test_a_track_knows_what_is_late_and_what_it_has_no_use_for() -> None:
    """By the point of the newest estimate and that of the window's oldest."""
    track = Track(MheParameters({"imu": ("gyroscope", "accelerometer", "magnetometer")}, horizon=2), "A", 5)
    assert track.put("magnetometer", 5, np.ones(3)) == IN_TIME
    track.estimate(8)
    assert [track.put("magnetometer", point, np.ones(3)) for point in (5, 6, 8, 9)] == [TOO_LATE, LATE, LATE, IN_TIME]
    inertial = Track(MheParameters({"imu": ("magnetometer",), "eye": ("flow",)}, configurations=("B",)), "B", 0)
    assert inertial.put("flow", 0, np.zeros(2)) is None


def heard(payload: bytes, now_ns: int = 100 * MS, source: str = "imu") -> list[float]:
    """The counts after one frame."""
    told: dict[str, list[float]] = {}

    def report(quantity: str, value: Any, index: int) -> None:
        assert index == 0
        told[quantity] = list(value)

    context: Any = SimpleNamespace(now_ns=0, report=report, set_timer=lambda *_, **__: None)
    hub = Mhe(context, MheParameters({"imu": ("gyroscope", "magnetometer")}))
    context.now_ns = now_ns
    hub.on_frame(Received(source, payload, now_ns))
    hub.on_timer(SimpleNamespace(index=0, time_ns=now_ns))  # type: ignore[arg-type]
    return told[COUNTS]


def encoded(stamp_ns: int, sensor: int, size: int, value: float = 0.1) -> bytes:
    """A measurement on the wire."""
    return measurements.encode(Measurement(stamp_ns, sensor, np.full(size, value)), "float64")


def test_what_cannot_be_a_sample_is_counted_and_left_out() -> None:
    """Damage, an unknown node, a number or a width that no sensor has, infinity, a stamp far ahead."""
    good = encoded(100 * MS, 1, 3)
    assert heard(good) == [1, 0, 0, 0, 0, 0]
    for payload in (b"\xc1", encoded(100 * MS, 2, 3), encoded(100 * MS, -1, 3), encoded(100 * MS, 0, 2)):
        assert heard(payload) == [0, 0, 0, 0, 1, 0]
    assert heard(good, source="stranger") == [0, 0, 0, 0, 1, 0]
    assert heard(encoded(100 * MS, 0, 3, np.inf)) == [0, 0, 0, 0, 1, 0]
    assert heard(encoded(1000 * MS, 0, 3)) == [0, 0, 0, 0, 1, 0]


def test_a_stamp_ahead_of_the_own_clock_is_counted_and_used() -> None:
    """Clocks drift; by less than a window it does no harm."""
    assert heard(encoded(150 * MS, 1, 3)) == [1, 0, 0, 1, 0, 0]


SENSORS = {"imu": ("gyroscope", "accelerometer", "magnetometer")}


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"sensors": {}}, "sensors names none that configuration A measures with"),
        ({"sensors": {"imu": ("gyroscope",)}}, "add one of magnetometer, flow"),
        ({"sensors": {"imu": ("gyro",)}}, "'gyro' is not known"),
        ({"sensors": {"a": ("flow",), "b": ("flow",)}}, "flow is there 2 times"),
        ({"sensors": {"eye": ("flow",)}, "configurations": ("B",)}, "configuration B measures with"),
        ({"horizon": 0}, "horizon is 0, a window has at least 1 step"),
        ({"rate": 0.0}, "rate is 0 Hz"),
        ({"wait": -1}, "wait is -1 ns"),
        ({"configurations": ()}, "write A, B, or both"),
        ({"configurations": ("A", "A")}, "each once"),
        ({"configurations": ("B",), "accelerometer_bias": True}, "configuration B has no such state"),
        ({"configurations": ("B",), "largest_accelerometer": 2.0}, "largest_accelerometer is 2 m/s², and only config"),
        ({"configurations": ("B",), "lowest": -1.0}, "lowest is -1 m, and only configuration A reads it: add A, or le"),
        ({"configurations": ("B",), "altitude": 9.0}, "altitude is 9 m, and only configuration A"),
        ({"configurations": ("B",), "arm": 0.5}, r"arm is 0\.5 m, and only configuration A"),
        ({"configurations": ("B",), "flow_at": (0.0, 0.0, 0.0)}, r"flow_at is \[0 m, 0 m, 0 m\], and only config"),
        (
            {"configurations": ("B",), "as_printed": ("accelerometer", "range")},
            "as_printed names range, and only config",
        ),
        ({"configurations": ("B",), "noise": Deviations(flow=1.0)}, r"noise\.flow is 1 m/s, and only configuration A"),
        ({"configurations": ("B",), "noise": Deviations(ranges=1.0)}, r"noise\.ranges is 1 m, and only configuration"),
        ({"configurations": ("B",), "noise": Deviations(accelerometer_gap=2.0)}, r"noise\.accelerometer_gap is 2 m/s²"),
        ({"noise": Deviations(gyroscope_walk=1.0)}, r"noise\.gyroscope_walk is 1 .*, and gyroscope_bias is no state"),
        (
            {"noise": Deviations(accelerometer_walk=1.0)},
            r"noise\.accelerometer_walk is 1 .*: leave it out, or write acc",
        ),
        ({"largest_gyroscope": -0.1}, "no value is within a bound below 0"),
        ({"largest_accelerometer": -0.1}, "no value is within a bound below 0"),
        ({"altitude": -1.0}, "altitude is -1 m, and lowest 0 m"),
        ({"arm": 0.0}, "arm is 0, it must be above 0"),
    ],
)
def test_what_cannot_estimate_is_refused(changes: dict[str, Any], said: str) -> None:
    """No sensor at all, a horizon of 0, an infeasible bound and so on, each with the remedy."""
    with pytest.raises(BadInput, match=said):
        MheParameters(**{"sensors": SENSORS, **changes})


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ((f"{HUB}.horizon=0",), "agents.only.1: horizon is 0, a window has at least 1 step"),
        ((f"{HUB}.largest_gyroscope=-1 rad/s",), "no value is within a bound below 0"),
        ((f"{HUB}.rate=150 Hz",), "which do not fall on the 150 points a second of hub"),
        ((f"{HUB}.sensors={{tail: [flow]}}",), "sensors of hub name tail, which is no neighbour of it"),
        ((f"{HUB}.sensors={{flow: [flow]}}",), r"what imu measures would be refused: add imu: \[gyroscope, acc"),
        (("world.sensors.hub=flow", "world.sensors.flow=[]"), "hub has flow of its own"),
        ((f"{HUB}.sensors={{left: [flow]}}",), r"say that left has \[flow\], but it sends \[range_left\]"),
        ((f"{HUB}.where=[hub, back]",), "agents back, hub are mhe"),
        (
            ("agents.only.0.sensors=[gyroscope, compass]",),
            "sensor node imu lists gyroscope, compass, the world gives it",
        ),
    ],
)
def test_what_does_not_fit_the_scenario_is_refused(changes: tuple[str, ...], said: str) -> None:
    """At its place in the file, or with the names of those who do not fit."""
    with pytest.raises(BadInput, match=said):
        load_scenario("mhe-roll", (f"{HUB}.configurations=[A]", *changes))


def test_a_hub_that_only_listens_offers_nothing() -> None:
    """Its links are known to carry nothing, though nobody knows what it would send."""
    validation = validate_plan(load_scenario("mhe-roll").plan)
    assert {row.medium: row.utilisation for row in validation.rows}["hub>imu"] == 0.0


def test_the_models_believe_what_the_world_does() -> None:
    """Deviations, places and magnetic field of the world are the defaults of the estimators."""
    plan = load_scenario("mhe-roll").plan
    world = plan.world
    model: Any = MheParameters(SENSORS).model("A")
    believed = vars(Deviations())
    for sensor, deviation in DEVIATIONS.items():
        assert believed["ranges" if sensor.startswith("range_") else sensor] == pytest.approx(deviation, rel=1e-12)
    assert (model.flow_at, model.arm, model.field) == (world.flow_at, world.airframe.arm, (0.24, 0.02, 0.39))  # type: ignore[union-attr]
    assert set(PLACES["A"]) == set(DEVIATIONS)
    declared = {quantity.name: quantity for quantity in MheEvaluation(plan, {}).quantities}
    assert declared[f"{ATTITUDE} A"].components[0] == ("roll", "mrad", 1000.0)
