"""Sensor nodes and what they put on the wire."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from volery.agents import measurements, payloads
from volery.agents.agent import Agent, Received
from volery.agents.measurements import Measurement
from volery.agents.payloads import DamagedPayload, Precision
from volery.agents.plan import AgentPlan, Plan
from volery.agents.sensor_node import SensorNode, SensorNodeParameters
from volery.errors import BadInput
from volery.experiments.record.record import Record
from volery.experiments.scenario.consistency import inconsistencies
from volery.experiments.scenario.validate import validate_plan
from volery.experiments.twin import recorded
from volery.kinds import NoParameters
from volery.transport.faults import ClockFault, Fault, SensorFault
from volery.transport.latency_settings import Constant
from volery.transport.links import LinkSettings

MS = 1_000_000
SENSORS = {"thrice": 100.0, "once": 20.0}


@dataclass(frozen=True)
class Counters:
    """Two sensors for agent s: three numbers at 100 Hz, of which every second sample is empty, and one at 20 Hz."""

    def sensors(self, agent: str) -> Mapping[str, float]:
        """Only s has any."""
        return SENSORS if agent == "s" else {}

    def measure(self, agent: str, sensor: str, index: int) -> NDArray[np.float64] | None:
        """Numbers about a third, which float32 does not have exactly."""
        if sensor == "once":
            return np.array([index / 3])
        return None if index % 2 == 0 else index / 3 + np.arange(3.0)

    def truth(self, time_ns: int) -> NDArray[np.float64]:
        """Nothing true here."""
        return np.zeros(1)


class Listener(Agent):
    """Reports every measurement that it hears: stamp, sensor, values."""

    def on_frame(self, frame: Received) -> None:
        """Under a quantity for each sensor."""
        heard = measurements.decode(frame.payload)
        self.context.report(str(heard.sensor), [heard.stamp_ns, *heard.values])


def plan_of(parameters: SensorNodeParameters, faults: Sequence[Fault] = (), mtu: int = 1500) -> Plan:
    """Node s with listeners a and b, for 100 ms."""
    near = {"a": ("s",), "b": ("s",), "s": ("a", "b")}
    degrees = {name: len(others) for name, others in near.items()}
    listeners = (AgentPlan(name, f"{__name__}:Listener", NoParameters(), near[name], degrees) for name in "ab")
    agents = (*listeners, AgentPlan("s", "sensor-node", parameters, near["s"], degrees))
    links = {(a, b): LinkSettings(latency=Constant(3 * MS), mtu=mtu) for a, others in near.items() for b in others}
    return Plan("node", 3, 100 * MS, agents, links, Counters(), tuple(faults))


def run(plan: Plan) -> Record:
    """The record of a run in the twin."""
    return recorded(plan)


BOTH = SensorNodeParameters(sensors=("once", "thrice"), payload="float64")


def test_each_sample_goes_to_all_neighbours_at_once() -> None:
    """The number is the place in the list, the stamp the instant of the sample; an empty sample is not sent."""
    record = run(plan_of(BOTH))
    for number, rate, indices in (("0", 20, [0, 1]), ("1", 100, [1, 3, 5, 7, 9])):
        heard = record.estimates(number)
        assert list(heard) == ["a", "b"]
        for mine in heard.values():
            stamps = [index * 1000 // rate * MS for index in indices]
            assert mine.value[:, 0].tolist() == stamps
            assert mine.time_ns.tolist() == [stamp + 4 * MS for stamp in stamps]
            values = [index / 3 for index in indices]
            np.testing.assert_array_equal(mine.value[:, 1], values)


def test_stamps_are_by_the_nodes_own_clock() -> None:
    """A clock that is 7 ms ahead stamps so, and a failed sensor says nothing."""
    clock = ClockFault("c", 0, None, "s", offset_ns=7 * MS)
    failed = SensorFault("f", 0, 30 * MS, "s", "once", "failed")
    heard = run(plan_of(BOTH, [clock, failed])).estimates("0")["a"]
    assert heard.value[:, 0].tolist() == [57 * MS]


@pytest.mark.parametrize(("precision", "size"), [("float64", 8), ("float32", 4), ("float16", 2)])
@pytest.mark.parametrize("count", [1, 3, 5])
def test_payloads_come_back_and_have_their_size(precision: Precision, size: int, count: int) -> None:
    """Within half a unit in the last place of the precision; never longer than foretold, nor than what is in it."""
    told = Measurement(123_456_789_012, 2, np.arange(1, count + 1) / 3)
    payload = measurements.encode(told, precision)
    heard = measurements.decode(payload)
    assert (heard.stamp_ns, heard.sensor) == (told.stamp_ns, told.sensor)
    mantissa = {8: 52, 4: 23, 2: 10}[size]
    np.testing.assert_allclose(heard.values, told.values, rtol=2.0 ** -(mantissa + 1), atol=0)
    largest = measurements.largest_size(2, count, precision)
    assert len(payload) <= largest <= 9 + 1 + 1 + 3 + size * count


@pytest.mark.parametrize("content", [[1, 2], [1, 2, 3.0], [1.5, 2, np.zeros(1)], "text"])
def test_what_is_no_measurement_is_refused(content: object) -> None:
    """Whatever a neighbour of another kind may send."""
    with pytest.raises(DamagedPayload, match="no measurement"):
        measurements.decode(payloads.encode(content))


def test_validation_knows_sizes_and_rates() -> None:
    """Of the sensor with the most values, and of all sensors together; an MTU below is refused."""
    offer = SensorNode.offers(plan_of(BOTH), "s")
    assert offer.per_second == 120.0
    assert offer.largest_payload == measurements.largest_size(1, 3, "float64")
    assert validate_plan(plan_of(BOTH)).largest_payload == offer.largest_payload
    assert list(inconsistencies(plan_of(BOTH, mtu=offer.largest_payload))) == []
    (problem,) = inconsistencies(plan_of(BOTH, mtu=offer.largest_payload - 1))
    assert f"a payload of {offer.largest_payload} B is larger than the MTU" in problem.message


@pytest.mark.parametrize(
    ("sensors", "message"),
    [
        ((), r"several sensors, and no numbers for them: write sensors: \[thrice, once\]"),
        (("once",), "lists once, the world gives it thrice, once"),
        (("once", "thrice", "twice"), "lists once, thrice, twice, the world gives it thrice, once"),
    ],
)
def test_lists_that_are_not_the_sensors_are_refused(sensors: tuple[str, ...], message: str) -> None:
    """A node with several sensors numbers them all, and no others."""
    (text,) = SensorNode.problems(plan_of(SensorNodeParameters(sensors=sensors)))
    assert re.search(message, text)


def test_a_sensor_twice_and_a_node_without_are_refused() -> None:
    """The one by its own parameters, the other where the world has none for it."""
    with pytest.raises(BadInput, match="one of them twice"):
        SensorNodeParameters(sensors=("a", "a"))
    lonely = AgentPlan("s", "sensor-node", SensorNodeParameters(), (), {"s": 0})
    (text,) = SensorNode.problems(Plan("node", 3, MS, (lonely,), {}))
    assert text.startswith("sensor node s has no sensor")
