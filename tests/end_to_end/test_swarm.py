"""A swarm is what it says: processes of their own, neighbours only, equal to its twin to the last bit."""

from __future__ import annotations

import asyncio
import math
import os
import signal
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from volery.agents.plan import AgentPlan, Plan
from volery.agents.process import Pace
from volery.errors import BadInput, RunFailed
from volery.experiments.analysis.accounting import account, total
from volery.experiments.record.frame_fates import frame_fates
from volery.experiments.record.record import Collector, Record
from volery.experiments.swarm.live_faults import Injector
from volery.experiments.swarm.supervisor import Swarm
from volery.kinds import NoParameters
from volery.transport import zenoh_session as zs
from volery.transport.faults import Hog
from volery.transport.frames import encode, promise
from volery.transport.keys import Keys
from volery.transport.latency_settings import Constant
from volery.transport.links import LinkSettings

from .conftest import MS, SECOND, advanced, departures, first_late_ns, run_swarm, until

PlanOf = Callable[..., Plan]


def line_plan(duration_s: int) -> Plan:
    """Three agents in a line, 1–2–3, that keep silent."""
    near = {"1": ("2",), "2": ("1", "3"), "3": ("2",)}
    degrees = {name: len(others) for name, others in near.items()}
    links = {
        (name, other): LinkSettings(latency=Constant(1_000_000)) for name, others in near.items() for other in others
    }
    agents = tuple(
        AgentPlan(name, "volery.agents.agent:Agent", NoParameters(), others, degrees) for name, others in near.items()
    )
    return Plan("line", 1, duration_s * 1_000_000_000, agents, links)


def is_running(pid: int) -> bool:
    """Whether there is a process of this number."""
    return Path(f"/proc/{pid}").exists()


def check_accounts(record: Record) -> None:
    """Every frame on every link has exactly one story."""
    accounts = account(record)
    assert set(accounts) == set(record.plan.links)
    assert all(link.closes for link in accounts.values()), total(accounts.values())


def check_arrivals(record: Record) -> None:
    """Every frame that was heard has come by the wall clock, and was handed over no earlier than that, nor than due."""
    frames = [frame for of_link in frame_fates(record).values() for frame in of_link if frame.fate == "delivered"]
    assert frames
    for frame in frames:
        assert None not in (frame.arrived_ns, frame.handed_ns, frame.due_ns)
        assert frame.handed_ns >= max(frame.arrived_ns, frame.due_ns)  # type: ignore[operator,type-var]


def test_lockstep_equals_the_twin(plan_of: PlanOf) -> None:
    """Sixteen processes over Zenoh give the twin's estimates and fates, bit for bit; every frame is accounted for."""
    record, ending = run_swarm(plan_of("dfa16-lossy", "duration=2 s", "faults=[{at: 1 s, until: 1.5 s, cut: 4-7}]"))
    assert ending.problems == ()
    assert len(record.estimates("estimate")) == 16
    assert departures(record) == []
    check_accounts(record)
    assert not any(batch.arrived for batch in record.batches.values())


def test_radios_that_listen_first_equal_the_twin(plan_of: PlanOf) -> None:
    """Twelve processes with carrier sense hear, collide and give up as in the twin, to the nanosecond."""
    record, ending = run_swarm(plan_of("radio-csma", "duration=2 s", "agents.rate=60 Hz"))
    assert ending.problems == ()
    lost = total(account(record).values())
    assert lost["lost (access)"] > 0
    assert lost["lost (collision)"] > 0
    assert departures(record) == []
    check_accounts(record)


@pytest.mark.usefixtures("busy_cores")
def test_lockstep_equals_the_twin_on_a_busy_machine(plan_of: PlanOf) -> None:
    """Work on both cores changes how long a lockstep run takes, and nothing else."""
    record, ending = run_swarm(plan_of("dfa16-lossy", "duration=1 s", "faults=[]"))
    assert ending.problems == ()
    assert departures(record) == []


def test_agents_are_processes_and_only_edges_carry_frames(plan_of: PlanOf) -> None:
    """While it runs there are sixteen processes, and the link keys in use are the directed edges of the graph."""
    plan = plan_of("dfa16-lossy", "duration=600 s", "faults=[]")
    seen: set[tuple[str, str]] = set()
    alive: list[int] = []

    async def look(swarm: Swarm, _injector: Injector, _collected: Collector) -> None:
        everything = Keys("test").link("*", "*")
        spy = swarm.session.declare_subscriber(
            everything,
            lambda sample: seen.add(tuple(str(sample.key_expr).rsplit("/", 2)[1:])),  # type: ignore[arg-type]
        )
        alive.extend(pid for pid in swarm.pids().values() if is_running(pid))
        await until(lambda: seen >= set(plan.links))
        await swarm.stop()
        spy.undeclare()

    run_swarm(plan, meanwhile=look)
    assert len(set(alive)) == 16
    assert os.getpid() not in alive
    assert seen == set(plan.links)


def test_strangers_get_nothing_through() -> None:
    """A client without credentials is turned away; an agent's credentials reach its neighbours' keys and no others."""
    keys = Keys("test")
    seen: list[str] = []
    overheard: list[str] = []

    async def intrude(swarm: Swarm, _injector: Injector, _collected: Collector) -> None:
        spy = swarm.session.declare_subscriber(keys.link("*", "*"), lambda sample: seen.append(str(sample.key_expr)))
        with pytest.raises(RunFailed, match="cannot join"):
            await asyncio.to_thread(zs.open_client, swarm.endpoint, zs.Credentials("nobody", "guessed"), 1.0)
        one, two, three = [
            await asyncio.to_thread(zs.open_client, swarm.endpoint, zs.Credentials(name, swarm.passwords[name]))
            for name in ("1", "2", "3")
        ]
        own = three.declare_subscriber(keys.link("2", "3"), lambda _: None)  # nothing is routed for `**` alone
        ear = three.declare_subscriber("**", lambda sample: overheard.append(str(sample.key_expr)))
        for source, target in (("1", "3"), ("2", "3"), ("1", "2")):
            one.put(keys.link(source, target), b"not a frame")
        await until(lambda: keys.link("1", "2") in seen)
        two.put(keys.link("2", "3"), b"not a frame")
        await until(lambda: keys.link("2", "3") in overheard and keys.link("2", "3") in seen)
        ear.undeclare()
        own.undeclare()
        for session in (one, two, three):
            session.close()
        spy.undeclare()
        await swarm.stop()

    run_swarm(line_plan(600), "realtime", intrude)
    assert seen == [keys.link("1", "2"), keys.link("2", "3")]
    assert overheard == [keys.link("2", "3")]


def test_killing_an_agent_from_outside(plan_of: PlanOf) -> None:
    """A kill -9 of one process: the run goes on, and says who died and when."""
    plan = plan_of("dfa4", "duration=600 s", "faults=[]")

    async def have_heard(collected: Collector, agents: str, since_ns: int) -> None:
        lives = [(agent, 0) for agent in agents]
        await until(
            lambda: all(
                life in collected.batches and any(heard.due_ns > since_ns for heard in collected.batches[life].heard)
                for life in lives
            )
        )

    async def kill(swarm: Swarm, _injector: Injector, collected: Collector) -> None:
        await until(lambda: swarm.status.time_ns > SECOND)
        await have_heard(collected, "1234", 0)
        os.kill(swarm.pids()["3"], signal.SIGKILL)
        await until(lambda: any(event["event"] == "died" for event in collected.events))
        (died,) = [event for event in collected.events if event["event"] == "died"]
        await have_heard(collected, "124", died["time_ns"])
        await swarm.stop()

    record, ending = run_swarm(plan, "realtime", kill)
    assert ending.problems == ()
    (died,) = [event for event in record.events if event["event"] == "died"]
    assert (died["agent"], died["cause"]) == ("3", "was killed from outside")
    assert died["time_ns"] > SECOND
    last = {agent: max(heard.due_ns for heard in batch.heard) for (agent, _), batch in record.batches.items()}
    assert all(due_ns > died["time_ns"] for agent, due_ns in last.items() if agent != "3")
    assert last["3"] < died["time_ns"]


_ASYNCHRONOUS = ("agents.estimator=running-sum", "agents.timing=asynchronous")


@pytest.mark.parametrize("pace", ["realtime", "lockstep"])
def test_a_run_with_a_death_from_outside_replays(pace: Pace, plan_of: PlanOf) -> None:
    """Nobody waits for the dead; with what was heard of it last the twin comes to the same bits.

    Up to the first late frame, that is: in realtime pace the machine may be too busy for frames to be in time.
    """
    plan = plan_of("dfa4", "duration=600 s", "faults=[]", "links.latency=20 ms", *_ASYNCHRONOUS)

    async def kill(swarm: Swarm, _injector: Injector, collected: Collector) -> None:
        await until(lambda: swarm.status.time_ns > 500 * MS)
        os.kill(swarm.pids()["3"], signal.SIGKILL)
        await until(lambda: not swarm.is_alive("3"))
        await advanced(swarm, collected, 500 * MS)
        await swarm.stop()

    record, ending = run_swarm(plan, pace, kill)
    assert ending.problems == ()
    assert [event["cause"] for event in record.events if event["event"] == "died"] == ["was killed from outside"]
    assert all(link.closes for link in account(record).values())
    assert departures(record, math.inf if pace == "lockstep" else first_late_ns(record)) == []


def test_a_stopped_process_counts_as_dead(plan_of: PlanOf) -> None:
    """SIGSTOP for good: after a while it is killed, the others go on, and every frame is accounted for."""
    plan = plan_of("dfa4", "duration=600 s", "faults=[]")

    async def stop(swarm: Swarm, _injector: Injector, collected: Collector) -> None:
        await until(lambda: swarm.status.time_ns > 500 * MS)
        os.kill(swarm.pids()["3"], signal.SIGSTOP)
        await until(lambda: not swarm.is_alive("3"))
        await advanced(swarm, collected, 500 * MS)
        await swarm.stop()

    record, ending = run_swarm(plan, "lockstep", stop)
    assert ending.problems == ()
    assert [event["cause"] for event in record.events if event["event"] == "died"] == ["was stopped from outside"]
    accounts = account(record)
    assert all(link.closes and not link.missing for link in accounts.values())
    assert any(link.unknown for link in accounts.values())
    assert departures(record) == []


def test_a_frame_that_the_middleware_loses_ends_the_run(plan_of: PlanOf) -> None:
    """The next message says that more were sent than have come; the run fails, and names the link."""
    plan = plan_of("dfa4", "duration=600 s", "faults=[]")

    async def pretend(swarm: Swarm, _injector: Injector, _collected: Collector) -> None:
        session = await asyncio.to_thread(zs.open_client, swarm.endpoint, zs.Credentials("1", swarm.passwords["1"]))
        session.put(Keys("test").link("1", "2"), encode(promise(0, 0, 10_000)))
        await until(lambda: not swarm.is_alive("2"))
        await asyncio.to_thread(session.close)

    _, ending = run_swarm(plan, "lockstep", pretend)
    assert any("link 1>2: 10000 frames were sent" in problem for problem in ending.problems)


def test_a_taken_port_is_bad_input(plan_of: PlanOf) -> None:
    """An endpoint that is in use is refused, with the remedy."""
    plan = plan_of("dfa16-lossy", "duration=20 s", "faults=[]")

    async def try_the_same(swarm: Swarm, _injector: Injector, _collected: Collector) -> None:
        with pytest.raises(BadInput, match="--listen"):
            await Swarm(plan, Collector(), "second", listen=swarm.endpoint).run()
        await swarm.stop()

    _, ending = run_swarm(plan, meanwhile=try_the_same)
    assert ending.problems == ()


def test_a_changing_graph_in_lockstep_equals_the_twin(plan_of: PlanOf) -> None:
    """Radios that move: links come and go while the hub's rules cover them all, and every bit is the twin's."""
    plan = plan_of("beacons-moving", "duration=8 s")
    assert any(start > 0 for spans in plan.presence.values() for start, _ in spans)
    record, ending = run_swarm(plan)
    assert ending.problems == ()
    assert departures(record) == []
    check_accounts(record)
    late_links = [link for link, spans in plan.presence.items() if spans[0][0] > 0]
    heard = {(entry.source, name) for (name, _), batch in record.batches.items() for entry in batch.heard}
    assert heard >= set(late_links)


def test_a_hog_takes_processor_time_and_nothing_else(plan_of: PlanOf) -> None:
    """The hogged agent uses more of it than each of the others; up to the first late frame the twin knows of no hog."""
    plan = replace(
        plan_of("dfa4", "duration=3 s", "links.latency=20 ms", *_ASYNCHRONOUS),
        faults=(Hog("t1", 500 * MS, 2500 * MS, "2", 0.8),),
    )
    record, ending = run_swarm(plan, "realtime")
    assert ending.problems == ()
    spent = {
        agent: event["cpu_s"]
        for (agent, _), batch in record.batches.items()
        for event in batch.events
        if event["event"] == "done"
    }
    assert spent["2"] > max(seconds for agent, seconds in spent.items() if agent != "2")
    assert departures(record, first_late_ns(record)) == []
    check_arrivals(record)
