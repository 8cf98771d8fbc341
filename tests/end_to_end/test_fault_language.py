"""Faults of every kind, injected live: one instant for many places, undone by name, and replayed bit for bit."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import volery
from volery.agents.plan import Plan
from volery.agents.plan_codec import decode_value
from volery.errors import BadInput
from volery.experiments.analysis.accounting import account
from volery.experiments.record.record import Collector, Record
from volery.experiments.swarm.control_server import ControlServer
from volery.experiments.swarm.live_faults import Injector
from volery.experiments.swarm.supervisor import Swarm
from volery.transport.keys import Keys

from .conftest import MS, advanced, departures, run_swarm, until

PlanOf = Callable[..., Plan]
OVERRIDES = ("duration=600 s", "faults=[]", "groups={left: [1, 3, 10]}")


async def a_while(swarm: Swarm, collected: Collector) -> None:
    """Wait for two tenths of a nominal second after the latest intervention: four samples of each agent."""
    await advanced(swarm, collected, 200 * MS)


def injected(record: Record, name: str) -> list[Any]:
    """The faults that an injection came to."""
    faults = [decode_value(event["fault"]) for event in record.events if event["event"] == "fault"]
    return [fault for fault in faults if fault.id.partition(".")[0] == name]


def assert_replayed(record: Record) -> None:
    """The accounts close, no fault was late, and the twin says the same to the last bit."""
    assert all(link.closes for link in account(record).values())
    assert not [event for event in record.events if event["event"] == "late-fault"]
    assert departures(record) == []


def test_every_kind_live_in_lockstep(plan_of: PlanOf) -> None:
    """Hold, partition, pauses of a group, clocks, sensors, a random fraction and a random process."""
    plan = plan_of("dfa16-lossy", *OVERRIDES)
    said: list[str] = []

    async def meddle(swarm: Swarm, injector: Injector, collected: Collector) -> None:
        await a_while(swarm, collected)
        faults: list[dict[str, Any]] = [
            {"hold": "1-3"},
            {"partition": "halves", "for": "200 ms"},
            {"pause": "left", "for": "100 ms"},
            {"clock": "4, 5", "drift": "200 ppm", "offset": "1 ms"},
            {"sensor": "left.distance", "bias": 0.01},
            {"where": "random 0.5", "set": {"duplication": 0.5}},
            {"where": "left", "set": {"loss": 0.8}, "every": {"mtbf": "1 s", "mttr": "500 ms"}, "for": "30 s"},
        ]
        for written in faults:
            said.append(await injector.inject(written))
            await a_while(swarm, collected)
        said.append(await injector.restore("1-3", "hold"))
        said.append(await injector.clear(["f4", "f7"]))
        with pytest.raises(BadInput, match="no fault f7 is in force; in force: f5, f6"):
            await injector.clear(["f7"])
        await a_while(swarm, collected)
        await swarm.stop()

    record, ending = run_swarm(plan, "lockstep", meddle)
    assert ending.problems == ()
    paused = injected(record, "f3")
    assert [(fault.id, fault.agent) for fault in paused] == [("f3.1", "1"), ("f3.2", "3"), ("f3.3", "10")]
    assert len({(fault.at_ns, fault.until_ns) for fault in paused}) == 1
    assert "3 faults" in said[2]
    assert said[-2:] == ["cleared f1", "cleared f4, f7"]
    cleared = {event["id"]: event["time_ns"] for event in record.events if event["event"] == "cleared"}
    assert cleared["f4.1"] == cleared["f4.2"]
    process = injected(record, "f7")
    assert len(process) > 10
    assert {fault.id for fault in process if fault.at_ns > cleared["f4.1"]} <= set(cleared)
    assert all(fault.id in {held.id for held in record.faults_in_effect} for fault in paused)
    assert len(record.faults_in_effect) < len(record.faults)
    lost = [links.lost for links in account(record).values()]
    assert sum(causes.get("cut", 0) for causes in lost) > 0
    assert_replayed(record)


def test_agents_of_a_group_die_together_and_come_back_together(plan_of: PlanOf) -> None:
    """One instant for the deaths, one for the lives after them."""
    plan = plan_of("dfa16-lossy", *OVERRIDES)

    async def kill(swarm: Swarm, injector: Injector, collected: Collector) -> None:
        await a_while(swarm, collected)
        await injector.inject({"kill": "left"})
        await until(lambda: not {"1", "3", "10"} & swarm.status.alive)
        with pytest.raises(BadInput, match="not alive"):
            await injector.inject({"pause": "3"})
        assert await injector.restart("left") == "restarted 1, 3, 10"
        with pytest.raises(BadInput, match="agent 1, 3, 10: none was killed by a fault"):
            await injector.restart("left")
        await a_while(swarm, collected)
        await swarm.stop()

    record, ending = run_swarm(plan, "lockstep", kill)
    assert ending.problems == ()
    assert len({fault.at_ns for fault in injected(record, "f1")}) == 1
    back = {event["agent"]: event["time_ns"] for event in record.events if event["event"] == "restarted"}
    assert set(back) == {"1", "3", "10"}
    assert len(set(back.values())) == 1
    assert_replayed(record)


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"hold": "1-3"}, "already held: 1>3, 3>1"),
    ({"pause": "4"}, "agent 4 is paused already, by fault f2"),
    ({"where": "all", "set": {"overhead": "4 B"}}, "already so, overhead unchanged"),
    ({"hog": 5}, "a hog needs realtime pace"),
    ({"partition": [["left"], ["4"]]}, "is on no side of the partition"),
    ({"cut": "1-3", "every": {"mtbf": "100 h", "mttr": "1 s"}}, "no failure falls into what is left of the run"),
    ({"kill": 5, "every": {"mtbf": "1 s", "mttr": "1 s"}}, "a random process of kills belongs into the scenario"),
    ({"where": "1-3", "set": {"medium": {"kind": "half-duplex", "per": "node"}}}, "a fault cannot move 1>3, 3>1"),
    ({"sensor": "1.camera", "failed": True}, "agent 1 has no sensor 'camera'"),
]


def test_what_would_change_nothing_is_refused(plan_of: PlanOf) -> None:
    """The message says why, and no other fault is in force after that than before."""
    plan = plan_of("dfa16-lossy", *OVERRIDES)

    async def ask(swarm: Swarm, injector: Injector, _collected: Collector) -> None:
        await injector.inject({"hold": "1-3"})
        await injector.inject({"pause": "4"})
        for written, message in REFUSED:
            with pytest.raises(BadInput) as caught:
                await injector.inject(written)
            assert message in str(caught.value)
        assert set(injector.in_force()) == {"f1", "f2"}
        with pytest.raises(BadInput, match="agent 5: none is paused by a fault"):
            await injector.resume("5")
        assert await injector.resume("4, 5") == "resumed 4"
        await swarm.stop()

    record, ending = run_swarm(plan, "lockstep", ask)
    assert ending.problems == ()
    assert [event["fault"]["id"] for event in record.events if event["event"] == "fault"] == ["f1", "f2"]


def test_from_python_and_what_the_answer_notes(plan_of: PlanOf, tmp_path: Path) -> None:
    """`volery.connect` talks to the swarm in a folder; a fault on links that carry nothing is done, and noted."""
    plan = plan_of("beacons", "duration=6000 s", "faults=[]", "agents.talkers=[1]")

    async def ask(swarm: Swarm, injector: Injector, _collected: Collector) -> None:
        control_server = asyncio.create_task(ControlServer(swarm, injector).serve(Keys("test"), tmp_path))
        await until((tmp_path / "control.json").exists)
        other = plan.agent("1").neighbours[0]
        await until(lambda: ("1", other) in swarm.status.used)
        remote = volery.connect(tmp_path)
        busy = await asyncio.to_thread(remote.inject, {"cut": f"1>{other}", "for": "5000 s"})
        idle = await asyncio.to_thread(remote.inject, {"cut": f"{other}>1"})
        assert busy.startswith("f1: from ")
        assert "note" not in busy
        assert idle.splitlines()[1] == f"note: no effect on {other}>1: {other} never sends"
        assert (await asyncio.to_thread(remote.status))["faults"] == {"f1": f"cut 1→{other}", "f2": f"cut {other}→1"}
        with pytest.raises(BadInput, match=f"already cut: 1>{other}"):
            await asyncio.to_thread(remote.inject, {"cut": f"1>{other}"})
        assert await asyncio.to_thread(remote.restore, f"1-{other}") == "cleared f1, f2"
        assert await asyncio.to_thread(remote.stop) == "the run ends"
        control_server.cancel()

    _, ending = run_swarm(plan, "lockstep", ask)
    assert ending.problems == ()
