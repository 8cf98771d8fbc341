"""The hub of a star of sensor nodes estimates the altitude, run in the twin."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from volery.agents import payloads
from volery.agents.agent import Agent
from volery.agents.altitude.altitude_ekf import AltitudeEkf
from volery.agents.altitude.altitude_ekf_settings import AltitudeEkfParameters
from volery.agents.plan import AgentPlan, Plan
from volery.agents.sensor_node import SensorNodeParameters
from volery.errors import BadInput
from volery.estimators.altitude.components import Barometer, Floats, Imu, RangeFinder
from volery.estimators.altitude.modular_filter import GroundJumps, Variant
from volery.experiments.record.record import Record
from volery.experiments.record.samples import Samples, samples
from volery.experiments.twin import recorded
from volery.kinds import NoParameters
from volery.transport.faults import ClockFault, Fault, Kill
from volery.transport.latency_settings import Constant, Uniform
from volery.transport.links import LinkSettings
from volery.transport.loss_settings import Bernoulli
from volery.worlds.altitude.altitude_sensors import AltitudeSensor, BarometerSensor, ImuSensor, RangeSensor
from volery.worlds.altitude.altitude_world import AltitudeWorld
from volery.worlds.altitude.room import Obstacle, Room
from volery.worlds.altitude.tour import Tour

MS, S = 1_000_000, 1_000_000_000
TOUR = Tour(((0.0, 0.0), (4.0, 0.0)), altitude=1.4, speed=0.6, wait=1.0, take_off=2.0, landing=3.0)
ROOM = Room((Obstacle((2.0, 0.0), (1.2, 0.8), 0.75),), 3)
CARRIED: dict[str, AltitudeSensor] = {"imu": ImuSensor(), "baro": BarometerSensor(), "laser": RangeSensor()}
PARTS: dict[str, Any] = {
    "imus": {"imu": Imu()},
    "barometers": {"baro": Barometer()},
    "range_finders": {"laser": RangeFinder()},
}
QUICK = LinkSettings(latency=Constant(2 * MS))
COUNTS = ("in order", "replayed", "repeated", "too old", "ahead", "refused", "jumps")


class Babbler(Agent):
    """Sends the hub what is no measurement of its own, once a kind."""

    timers_only = True

    def start(self) -> None:
        """In the beginning."""
        self.context.set_timer(0)

    def on_timer(self, timer: object) -> None:
        """No payload, no measurement, no component of this number, too many values, one that is not finite."""
        stamp = 0
        for content in ("text", [stamp, 7, np.zeros(1)], [stamp, 0, np.zeros(2)], [stamp, 0, np.array([np.nan])]):
            self.context.send("hub", payloads.encode(content))
        self.context.send("hub", b"\xc1")


def plan_of(
    settings: LinkSettings | Mapping[str, LinkSettings] = QUICK,
    faults: Sequence[Fault] = (),
    seconds: float = 14.0,
    parameters: AltitudeEkfParameters | None = None,
    babbling: str | None = None,
) -> Plan:
    """A hub with an IMU, a barometer and a range finder on nodes of their own, over a table."""
    nodes = tuple(CARRIED)
    near = {"hub": nodes, **dict.fromkeys(nodes, ("hub",))}
    degrees = {name: len(others) for name, others in near.items()}
    node = SensorNodeParameters(payload="float64")
    agents = [AgentPlan("hub", "altitude-ekf", parameters or AltitudeEkfParameters(**PARTS), nodes, degrees)]
    for name in nodes:
        kind, own = (f"{__name__}:Babbler", NoParameters()) if name == babbling else ("sensor-node", node)
        agents.append(AgentPlan(name, kind, own, ("hub",), degrees))
    per_node = settings if isinstance(settings, Mapping) else dict.fromkeys(nodes, settings)
    links = {(a, b): per_node.get(a, QUICK) for a, others in near.items() for b in others}
    world = AltitudeWorld(TOUR, ROOM, tuple(CARRIED.items()), 3)
    return Plan("altitude", 3, int(seconds * S), tuple(agents), links, world, tuple(faults))


def run(plan: Plan) -> Record:
    """The record of a run in the twin."""
    return recorded(plan)


def altitude_errors(seen: Samples, until_s: float = 1e9) -> Floats:
    """|ẑ − z| of the hub [m]."""
    errors = np.abs(seen.estimate[:, 0, 0] - seen.truth[:, 0, 0])
    return errors[seen.time_ns < until_s * S]


def arrived(seconds: int, rate: int, latency_ms: int) -> int:
    """How many samples of a sensor have come until the last estimate of a run, 50 ms before its end."""
    return (1000 * seconds - 50 - latency_ms - 1) * rate // 1000 + 1


def counts(record: Record) -> dict[str, float]:
    """What became of the measurements until the end."""
    return dict(zip(COUNTS, record.estimates("measurements")["hub"].value[-1], strict=True))


def test_the_altitude_is_right_within_centimetres() -> None:
    """From the ground, over a table and down again; the ground and the barometer's bias are right too."""
    record = run(plan_of())
    seen = samples(record, "altitude")
    assert altitude_errors(seen).mean() < 0.03
    over_table = seen.truth[:, 0, 1] == 0.75
    assert over_table.sum() > 20
    assert np.abs(seen.estimate[over_table, 0, 1] - 0.75).mean() < 0.1
    bias = samples(record, "barometer bias")
    assert abs(bias.estimate[-1, 0, 0] - bias.truth[-1, 0, 0]) < 0.15
    np.testing.assert_array_equal(seen.truth[0, 0], [0, 0, 0])


def test_findings_are_what_the_run_shows() -> None:
    """Mean errors in centimetres, apart over the table, how consistent the filter is, and what became of the frames."""
    record = run(plan_of())
    found = {finding.name: finding for finding in record.evaluated.findings}
    seen = samples(record, "altitude")
    errors, over_table = 100 * altitude_errors(seen), seen.truth[:, 0, 1] > 0
    assert found["mean error of the altitude"].value == pytest.approx(errors.mean())
    assert found["mean error of the altitude over obstacles"].value == pytest.approx(errors[over_table].mean())
    assert found["mean error of the altitude over the floor"].value == pytest.approx(errors[~over_table].mean())
    assert 70 < found["altitude within two deviations"].value <= 100
    assert found["measurements at the hub"].text.startswith(f"{counts(record)['in order']:,.0f} in order, ")
    silent = run(plan_of(faults=[Kill("k", 0, None, "hub")], seconds=1))
    assert silent.evaluated.findings == ()


def test_the_oracle_is_the_filter_without_links() -> None:
    """With links of 2 ms the hub lacks at most the newest sample of each sensor; with links of 300 ms it lacks more."""
    quick, slow = (
        samples(run(plan_of(LinkSettings(latency=Constant(latency * MS)))), "altitude") for latency in (2, 300)
    )
    np.testing.assert_array_equal(quick.oracle, slow.oracle)
    near, far = (np.abs(seen.estimate - seen.oracle)[:, 0, 0].mean() for seen in (quick, slow))
    assert near < 0.005
    assert far > 3 * near


def test_order_of_arrival_makes_no_difference() -> None:
    """Latencies from 5 to 250 ms mix everything up; once all has arrived the belief is that of the oracle, bit for bit.

    The nodes' sensors are silent from 13 s on (their agents are dead), so that at the end nothing is on its way.
    """
    dead: list[Fault] = [Kill(f"k{name}", 13 * S, None, name) for name in CARRIED]
    mixed = plan_of(LinkSettings(latency=Uniform(5 * MS, 250 * MS)), dead)
    record = run(mixed)
    found = counts(record)
    assert found["replayed"] > 500
    assert found["too old"] == 0
    ordered = run(plan_of(LinkSettings(latency=Constant(1)), dead))
    last, expected = (each.estimates("altitude")["hub"].value[-1] for each in (record, ordered))
    assert counts(ordered)["replayed"] == 0
    np.testing.assert_array_equal(last, expected)


def test_most_of_range_and_barometer_may_be_lost() -> None:
    """Six of ten of them, in one variant after the other: the gated one stays below 5 cm, as printed does not."""
    lossy = LinkSettings(latency=Constant(2 * MS), loss=(Bernoulli(0.6),))
    means = {}
    for variant in ("as_printed", "gate_and_floor"):
        parameters = AltitudeEkfParameters(**PARTS, jumps=GroundJumps(variant))
        record = run(plan_of({"baro": lossy, "laser": lossy}, parameters=parameters))
        means[variant] = altitude_errors(samples(record, "altitude")).mean()
    assert means["gate_and_floor"] < 0.05
    assert means["as_printed"] > 2 * means["gate_and_floor"]


def test_what_comes_too_late_is_counted_and_left_out() -> None:
    """A history of 50 ms and links of 100 ms: the range finder's are too old, the IMU's are not."""
    parameters = AltitudeEkfParameters(**PARTS, history=50 * MS)
    found = counts(run(plan_of({"laser": LinkSettings(latency=Constant(100 * MS))}, parameters=parameters, seconds=3)))
    assert found["too old"] == arrived(3, 20, 100)
    assert found["in order"] + found["replayed"] == arrived(3, 100, 2) + arrived(3, 20, 2)


def test_clocks_that_are_ahead_are_counted_and_their_measurements_used() -> None:
    """A node 30 ms ahead: every stamp of it lies ahead of the hub's clock by 27 ms, and the estimate is as good."""
    clock = ClockFault("c", 0, None, "laser", offset_ns=30 * MS)
    record = run(plan_of(faults=[clock]))
    assert counts(record)["ahead"] == arrived(14, 20, 2)
    assert counts(record)["refused"] == 0
    assert altitude_errors(samples(record, "altitude")).mean() < 0.03


def test_copies_of_a_clock_that_is_ahead_count_once() -> None:
    """They come at other times than the first ones: of 4 s at 100, 20 and 20 Hz no measurement is used twice."""
    clock = ClockFault("c", 0, None, "laser", offset_ns=30 * MS)
    links = LinkSettings(latency=Uniform(2 * MS, 9 * MS), duplication=1.0)
    found = counts(run(plan_of(links, faults=[clock], seconds=4)))
    assert found["ahead"] > 100
    assert found["in order"] + found["replayed"] <= 4 * (100 + 20 + 20)
    assert found["repeated"] > 500


def test_frames_that_come_twice_count_once() -> None:
    """A link that duplicates every frame changes no estimate."""
    twice = run(plan_of(LinkSettings(latency=Constant(2 * MS), duplication=1.0), seconds=4))
    once = run(plan_of(seconds=4))
    np.testing.assert_array_equal(twice.estimates("altitude")["hub"].value, once.estimates("altitude")["hub"].value)
    assert counts(twice)["repeated"] == counts(twice)["in order"] == counts(once)["in order"]


def test_what_is_no_measurement_is_refused() -> None:
    """Five frames of a node that talks nonsense, and the rest goes on."""
    found = counts(run(plan_of(babbling="baro", seconds=2)))
    assert found["refused"] == 5
    assert found["in order"] + found["replayed"] == arrived(2, 100, 2) + arrived(2, 20, 2)


@pytest.mark.parametrize("keep_state", [True, False])
def test_a_hub_that_dies_in_flight_finds_its_altitude(keep_state: bool) -> None:
    """With its state at once; without it, over the floor, within two seconds."""
    kill = Kill("k", 4 * S, int(4.2 * S), "hub", keep_state=keep_state)
    seen = samples(run(plan_of(faults=[kill])), "altitude")
    after = seen.time_ns > (4.25 if keep_state else 6.5) * S
    errors = np.abs(seen.estimate[:, 0, 0] - seen.truth[:, 0, 0])
    assert np.nanmax(errors[after & (seen.time_ns < 12 * S)]) < 0.15


def test_it_never_sends() -> None:
    """So faults on the links from it are said to have no effect."""
    plan = plan_of()
    assert AltitudeEkf.is_silent(plan, "hub")
    assert run(plan_of(seconds=1)).batches["hub", 0].sent == []


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        (
            {"barometers": PARTS["barometers"], "range_finders": PARTS["range_finders"]},
            "add a component imu to hub",
        ),
        ({**PARTS, "imus": {"imu": Imu(), "imu.1": Imu()}}, r"component imu\.1 has no sensor: node imu has imu"),
        ({**PARTS, "barometers": {"baro": Barometer(), "bmp": Barometer()}}, "component bmp is of no neighbour of hub"),
        ({**PARTS, "imus": {"baro": Imu()}, "barometers": {"imu": Barometer()}}, "imu measures 5 values, .* takes 1"),
    ],
)
def test_components_and_nodes_must_match(parts: dict[str, Any], message: str) -> None:
    """Neither may stand alone: it would have no effect."""
    texts = AltitudeEkf.problems(plan_of(parameters=AltitudeEkfParameters(**parts)))
    assert re.search(message, " ".join(texts))
    assert AltitudeEkf.problems(plan_of()) == []


def test_a_hub_has_no_sensor_of_its_own() -> None:
    """It would not be read."""
    plan = plan_of()
    carried = (*CARRIED.items(), ("hub", BarometerSensor()))
    (text,) = AltitudeEkf.problems(replace(plan, world=AltitudeWorld(TOUR, ROOM, carried, 3)))
    assert text.startswith("hub has barometer of its own")


def jumping(variant: Variant, **fields: float) -> dict[str, Any]:
    """Parameters of a filter with this variant and other values of some fields of it."""
    return {**PARTS, "jumps": GroundJumps(variant, **fields)}


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({}, "a filter without any sensor"),
        ({**PARTS, "range_finders": {"baro": RangeFinder()}}, "component baro is named twice"),
        ({**PARTS, "rate": 0.0}, "rate is 0 Hz"),
        ({**PARTS, "history": -1}, "history is -1 ns"),
        (jumping("as_printed", gate=3.0), r"jumps\.gate is 3, and jumps\.variant is as_printed, .*: leave it out"),
        (jumping("as_printed", jump=2.0), r"jumps\.jump is 2 m, and"),
        (jumping("gate", level=0.3), r"jumps\.level is 0\.3 m, and jumps\.variant is gate, which knows no floor"),
        (jumping("gate", floor_noise=0.3), r"jumps\.floor_noise is 0\.3 m, and"),
    ],
)
def test_parameters_that_make_no_filter(fields: dict[str, Any], message: str) -> None:
    """At once, with the remedy."""
    with pytest.raises(BadInput, match=message):
        AltitudeEkfParameters(**fields)


def test_what_a_variant_reads_may_be_said() -> None:
    """Each variant with all of its own fields, and a default that another one would read."""
    AltitudeEkfParameters(**jumping("gate", gate=3.0, jump=2.0, level=0.15))
    AltitudeEkfParameters(**jumping("gate_and_floor", gate=3.0, jump=2.0, level=0.3, floor_noise=0.1))
