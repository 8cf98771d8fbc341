"""Faults injected while a swarm runs: one instant for all, recorded, and the run still equals its twin."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from volery.agents.plan import Plan
from volery.errors import BadInput
from volery.experiments.analysis.accounting import account
from volery.experiments.record.record import Collector
from volery.experiments.swarm.live_faults import Injector
from volery.experiments.swarm.supervisor import Swarm
from volery.transport.faults import Kill

from .conftest import MS, SECOND, advanced, departures, estimates_of, run_swarm, until

PlanOf = Callable[..., Plan]


async def a_while(swarm: Swarm, collected: Collector) -> None:
    """Wait for three tenths of a nominal second after the latest intervention: six samples of each agent."""
    await advanced(swarm, collected, 300 * MS)


def test_live_link_faults_and_pauses_in_lockstep(plan_of: PlanOf) -> None:
    """Cut, restore, loss, latency, rate, pause, clear and an early stop, all live: the replay equals the record."""
    plan = plan_of("dfa16-lossy", "duration=600 s", "faults=[]")

    async def meddle(swarm: Swarm, injector: Injector, collected: Collector) -> None:
        faults: list[dict[str, Any]] = [
            {"cut": "4-7"},
            {"where": "all", "set": {"loss": {"bernoulli": 0.5}}, "for": "500 ms"},
            {"where": "1-3", "set": {"latency": "1 ms", "rate": "230.4 kbit/s"}},
            {"pause": "5"},
        ]
        for written in faults:
            await injector.inject(written)
            await a_while(swarm, collected)
        await injector.restore("4-7", "cut")
        with pytest.raises(BadInput, match="none of these links is cut"):
            await injector.restore("4-7", "cut")
        await injector.clear([])
        assert injector.in_force() == {}
        await a_while(swarm, collected)
        await swarm.stop()

    record, ending = run_swarm(plan, "lockstep", meddle)
    assert ending.problems == ()
    assert [event["fault"]["id"] for event in record.events if event["event"] == "fault"] == ["f1", "f2", "f3", "f4"]
    assert sorted(event["id"] for event in record.events if event["event"] == "cleared") == ["f1", "f3", "f4"]
    assert not [event for event in record.events if event["event"] == "late-fault"]
    assert record.end_ns is not None
    assert record.end_ns < plan.duration_ns
    lost = {link: account.lost for link, account in account(record).items()}
    assert lost["4", "7"]["cut"] > 0
    assert all(link.closes for link in account(record).values())
    assert departures(record) == []


def test_kill_and_restart_in_realtime(plan_of: PlanOf) -> None:
    """A live kill ends the process; a restart brings the agent back without its state, and it estimates again."""
    plan = plan_of("dfa4", "duration=600 s", "faults=[]")

    async def kill(swarm: Swarm, injector: Injector, collected: Collector) -> None:
        first = swarm.pids()["3"]
        await injector.inject({"kill": "3"})
        await until(lambda: not swarm.is_alive("3"))
        with pytest.raises(BadInput, match="not alive"):
            await injector.inject({"pause": "3"})
        await injector.restart("3")
        assert swarm.pids()["3"] != first
        await estimates_of(collected, ("3", 1))
        await swarm.stop()

    record, ending = run_swarm(plan, "realtime", kill)
    assert ending.problems == ()
    assert {"died", "restarted", "cleared"} <= {event["event"] for event in record.events}
    assert [event["cause"] for event in record.events if event["event"] == "died"] == ["injected"]
    restarted = next(event["time_ns"] for event in record.events if event["event"] == "restarted")
    assert min(estimate.time_ns for estimate in record.batches["3", 1].estimates) > restarted


def test_kills_and_restarts_in_lockstep(plan_of: PlanOf) -> None:
    """A kill with an end, one without that is ended live, and one of the timeline: the replay equals the record."""
    overrides = ("duration=600 s", "faults=[{at: 300 ms, for: 400 ms, kill: 7}, {at: 1 s, for: 300 ms, pause: 2}]")
    plan = plan_of("dfa16-lossy", *overrides)

    async def meddle(swarm: Swarm, injector: Injector, collected: Collector) -> None:
        await injector.inject({"kill": "5", "for": "500 ms"})
        await injector.inject({"kill": "9"})
        await until(lambda: not swarm.is_alive("9"))
        await injector.inject({"where": "all", "set": {"loss": {"bernoulli": 0.5}}, "for": "500 ms"})
        await a_while(swarm, collected)
        await injector.restart("9")
        await estimates_of(collected, ("5", 1), ("7", 1), ("9", 1))
        await swarm.stop()

    record, ending = run_swarm(plan, "lockstep", meddle)
    assert ending.problems == ()
    restarted = {event["agent"] for event in record.events if event["event"] == "restarted"}
    assert restarted == {"5", "7", "9"}
    assert all(link.closes for link in account(record).values())
    assert departures(record) == []


@pytest.mark.usefixtures("busy_cores")
def test_everything_in_lockstep_on_a_busy_machine(plan_of: PlanOf) -> None:
    """Losses, a kill with a return and a pause of the timeline, and live faults, with both cores at other work."""
    faults = "faults=[{at: 200 ms, for: 300 ms, kill: 7}, {at: 400 ms, for: 200 ms, pause: 2}]"
    plan = plan_of("dfa16-lossy", "duration=600 s", faults)

    async def meddle(swarm: Swarm, injector: Injector, collected: Collector) -> None:
        await injector.inject(
            {"where": "all", "set": {"loss": {"bernoulli": 0.3}, "latency": "12 ms"}, "for": "300 ms"}
        )
        await injector.inject({"kill": "5"})
        await until(lambda: not swarm.is_alive("5"))
        await injector.restart("5")
        await until(lambda: swarm.current("7") == ("7", 1) and {"5", "7"} <= swarm.status.alive)
        await a_while(swarm, collected)
        await swarm.stop()

    record, ending = run_swarm(plan, "lockstep", meddle)
    assert ending.problems == ()
    assert {event["agent"] for event in record.events if event["event"] == "restarted"} == {"5", "7"}
    assert all(record.batches[agent, 1].heard for agent in ("5", "7"))
    assert all(link.closes and not link.missing for link in account(record).values())
    assert departures(record) == []


def test_several_lives_and_an_end_from_outside_before_a_kill(plan_of: PlanOf) -> None:
    """Who dies twice comes back twice, nobody comes back by two ways, and the end of a kill that never came is none."""
    twice = "{at: 200 ms, for: 200 ms, kill: 7}, {at: 500 ms, for: 200 ms, kill: 7}"
    plan = plan_of("dfa16-lossy", "duration=600 s", f"faults=[{twice}, {{at: 2500 ms, for: 200 ms, kill: 9}}]")

    async def meddle(swarm: Swarm, injector: Injector, collected: Collector) -> None:
        os.kill(swarm.pids()["9"], signal.SIGKILL)
        await injector.inject({"kill": "12", "for": "1 s"})
        with pytest.raises(BadInput, match="agent 12 comes back by itself"):
            await injector.restart("12")
        await until(lambda: swarm.current("7") == ("7", 2) and "7" in swarm.status.alive)
        await until(lambda: swarm.current("12") == ("12", 1) and "12" in swarm.status.alive)
        await until(lambda: swarm.status.time_ns > 3 * SECOND)
        await a_while(swarm, collected)
        await swarm.stop()

    record, ending = run_swarm(plan, "lockstep", meddle)
    assert ending.problems == ()
    deaths = [event for event in record.events if event["event"] == "died"]
    died = {(event["agent"], event["incarnation"]): event["cause"] for event in deaths}
    assert died.pop(("9", 0)) == "was killed from outside"
    assert died == dict.fromkeys([("7", 0), ("7", 1), ("12", 0)], "injected")
    assert {life for life in record.batches if life[1]} == {("7", 1), ("7", 2), ("12", 1)}
    assert all(link.closes and not link.missing for link in account(record).values())
    assert departures(record) == []


def test_nobody_waits_for_a_return_that_is_far_ahead(plan_of: PlanOf) -> None:
    """Live faults take effect, and the run ends, long before the agent on standby comes to life."""
    plan = plan_of("dfa16-lossy", "duration=600 s", "faults=[{at: 200 ms, for: 500 s, kill: 7}]")

    async def meddle(swarm: Swarm, injector: Injector, collected: Collector) -> None:
        await until(lambda: swarm.current("7") == ("7", 1) and "7" in swarm.status.alive)
        await injector.inject({"where": "all", "set": {"loss": {"bernoulli": 0.5}, "latency": "2 ms"}})
        await a_while(swarm, collected)
        await swarm.stop()

    record, ending = run_swarm(plan, "lockstep", meddle)
    assert ending.problems == ()
    assert not [event for event in record.events if event["event"] == "late-fault"]
    assert record.end_ns is not None
    assert record.end_ns < 500 * SECOND
    assert all(link.closes and not link.missing for link in account(record).values())
    assert departures(record) == []


def test_a_restart_that_keeps_the_state(plan_of: PlanOf) -> None:
    """What an agent saves at its death its next life has, over Zenoh as in the twin; without it, it begins anew."""
    kills = (Kill("t1", 2500 * MS, 2700 * MS, "2", keep_state=True), Kill("t2", 2500 * MS, 2700 * MS, "3"))
    plan = replace(plan_of("beacons", "duration=4 s", "links.loss=0"), faults=kills)
    record, ending = run_swarm(plan, "lockstep")
    assert ending.problems == ()
    first = {agent: record.batches[agent, 0].estimates[-1].value[0] for agent in ("2", "3")}
    later = {agent: record.batches[agent, 1].estimates[0].value[0] for agent in ("2", "3")}
    assert later["2"] > first["2"]
    assert later["3"] < first["3"]
    assert departures(record) == []


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ({"cut": "1-99"}, "99"),
        ({"kill": "99"}, "99"),
        ({"where": "all", "set": {"loss": {"bernoulli": 1.5}}}, "between 0 and 1"),
        ({"where": "all", "set": {"rate": "1 kbit/s"}}, "does not fit a tdma slot"),
    ],
)
def test_a_live_fault_that_makes_no_sense_is_refused(plan_of: PlanOf, written: dict[str, Any], message: str) -> None:
    """Nothing is armed, the message says what is wrong, and the run goes on."""
    plan = plan_of("dfa16-lossy", "duration=600 s", "faults=[]")

    async def ask(swarm: Swarm, injector: Injector, _collected: Collector) -> None:
        with pytest.raises(BadInput, match=message):
            await injector.inject(written)
        assert injector.in_force() == {}
        await swarm.stop()

    record, ending = run_swarm(plan, "lockstep", ask)
    assert ending.problems == ()
    assert not [event for event in record.events if event["event"] == "fault"]
