"""Volery's side of the benchmarks: plans of sending agents, and measurements of their swarms."""

from __future__ import annotations

import asyncio
import multiprocessing
import time
from collections.abc import Mapping
from typing import Any

from bench_agents import PulseParameters
from shapes import BEGIN_NS, PAYLOAD_BYTES, SECOND_NS, cpu_summary, delay_summary, end_ns, phase_ns, pss_mb, ring

from volery.agents.journal import Batch
from volery.agents.plan import AgentPlan, Plan
from volery.agents.process import Pace
from volery.experiments.scenario.load import load_scenario
from volery.experiments.swarm.supervisor import Ending, Swarm
from volery.transport.latency_settings import Constant, Normal
from volery.transport.link_models import Latency
from volery.transport.links import DELIVERED, LinkSettings
from volery.transport.loss_settings import GilbertElliott
from volery.transport.media_settings import HalfDuplex, Tdma


def full_pipeline(latency: Latency) -> LinkSettings:
    """A link with every stage: TDMA, rate, losses in bursts and a latency."""
    return LinkSettings(
        medium=HalfDuplex(access=Tdma(100.0, 200_000)), rate=1e6, loss=(GilbertElliott(0.05, 0.3),), latency=latency
    )


def pulses(
    kind: str, neighbours: Mapping[str, tuple[str, ...]], rate: float, seconds: float, settings: LinkSettings
) -> Plan:
    """A plan of agents that send to every neighbour at a rate, spread over the period."""
    duration_ns = int(seconds * SECOND_NS)

    def parameters(index: int) -> PulseParameters:
        phase = phase_ns(index, len(neighbours), rate)
        return PulseParameters(rate, phase, PAYLOAD_BYTES, BEGIN_NS, end_ns(seconds))

    agents = tuple(
        AgentPlan(name, kind, parameters(index), near, {other: len(neighbours[other]) for other in (name, *near)})
        for index, (name, near) in enumerate(neighbours.items())
    )
    return Plan("bench", 1, duration_ns, agents, {(a, b): settings for a, near in neighbours.items() for b in near})


class Collected:
    """A sink that keeps the reports of the benchmark's agents, and the last event of each process."""

    def __init__(self) -> None:
        self.reports: dict[str, list[list[float]]] = {}
        self.done: list[dict[str, Any]] = []
        self.heard = self.delivered = 0

    def __call__(self, batch: Batch) -> None:
        """Add the entries of one agent."""
        self.heard += len(batch.heard)
        self.delivered += sum(entry.fate == DELIVERED for entry in batch.heard)
        for estimate in batch.estimates:
            self.reports.setdefault(estimate.quantity, []).append(estimate.value)
        self.done += [event for event in batch.events if event["event"] == "done"]

    def event(self, event: dict[str, Any]) -> None:
        """Ignore events of the run."""


class TimedSwarm(Swarm):
    """A swarm that notes when it had joined, when it was begun, nominal time 0, and its end, on the monotonic clock."""

    joined_ns = begun_ns = epoch_ns = over_ns = 0

    async def order(self, order: Mapping[str, Any], *to: Any, **keywords: Any) -> dict[tuple[str, int], Any]:
        """Note the first order, which follows the last token, the start and the end on their way."""
        now_ns = time.monotonic_ns()
        self.joined_ns = self.joined_ns or now_ns
        if order["do"] == "start":
            self.begun_ns, self.epoch_ns = now_ns, order["run_start"]["epoch_ns"]
        elif order["do"] == "stop":
            self.over_ns = now_ns
        return await super().order(order, *to, **keywords)


def run(plan: Plan, pace: Pace = "realtime") -> tuple[Collected, TimedSwarm]:
    """A whole run; it must end well."""
    collected = Collected()

    async def life() -> tuple[TimedSwarm, Ending]:
        swarm = TimedSwarm(plan, collected, "bench", pace)
        return swarm, await swarm.run()

    swarm, ending = asyncio.run(life())
    if ending.problems:
        raise RuntimeError("; ".join(ending.problems))
    return collected, swarm


# -- samples, see measuring.fresh ---------------------------------------------------------------------------------


def delay(agents: int, degree: int, rate: float, seconds: float, latency_ms: float) -> dict[str, float]:
    """Delivered minus due, in µs: least, median and 99th percentile over all frames of a realtime run."""
    settings = LinkSettings(latency=Constant(int(latency_ms * 1e6)))
    plan = pulses("bench_agents:Stopwatch", ring(agents, degree), rate, seconds, settings)
    collected, swarm = run(plan)
    return delay_summary([error - swarm.epoch_ns for errors in collected.reports["error"] for error in errors])


def pipe(rate: float, seconds: float, latency_ms: float) -> dict[str, float]:
    """Mean and 99th percentile in µs of the time from start to handled on the one edge of two agents, in realtime."""
    settings = LinkSettings(latency=Constant(int(latency_ms * 1e6)))
    collected, swarm = run(pulses("bench_agents:Stopwatch", {"1": ("2",), "2": ("1",)}, rate, seconds, settings))
    errors = [error - swarm.epoch_ns for of_one in collected.reports["error"] for error in of_one]
    late = delay_summary(errors)
    latency_us = latency_ms * 1e3
    mean_us = latency_us + sum(errors) / len(errors) / 1e3
    return {"delay_us": mean_us, "p99_us": latency_us + late["p99"], "frames": late["frames"]}


def cpu(agents: int, degree: int, rate: float, seconds: float, latency_ms: float) -> dict[str, float]:
    """Processor time of all agents per frame handled, in µs, in a realtime run."""
    settings = LinkSettings(latency=Constant(int(latency_ms * 1e6)))
    plan = pulses("bench_agents:Meter", ring(agents, degree), rate, seconds, settings)
    return cpu_summary(run(plan)[0].reports["meter"])


def startup(agents: int, seconds: float) -> dict[str, float]:
    """Seconds from nothing until every agent has joined, and memory per agent in MB after a while of running."""
    plan = pulses("bench_agents:Pulse", ring(agents, 4), 2.0, seconds, LinkSettings(latency=Constant(20_000_000)))

    async def life() -> dict[str, float]:
        began = time.monotonic_ns()
        swarm = TimedSwarm(plan, Collected(), "bench")
        running = asyncio.create_task(swarm.run())
        await swarm.ready.wait()
        await asyncio.sleep(seconds / 2)
        pss = pss_mb([pid for process in multiprocessing.active_children() if (pid := process.pid)])
        await running
        return {"alive_s": (swarm.joined_ns - began) / 1e9, "pss_mb": pss}

    return asyncio.run(life())


def lockstep(agents: int, degree: int, rate: float, seconds: float) -> dict[str, float]:
    """A ring of agents that talk to every neighbour, in lockstep pace, with a shortest latency of 10 ms.

    Nominal seconds per wall second; processor time of all agents in µs per delivered frame, and in seconds per nominal
    second; bare promises per frame.
    """
    settings = full_pipeline(Normal(13_000_000, 1_000_000, 10_000_000))
    plan = pulses("bench_agents:Meter", ring(agents, degree), rate, seconds, settings)
    collected, swarm = run(plan, "lockstep")
    meters = collected.reports["meter"]
    measured_s = (end_ns(seconds) - BEGIN_NS) / SECOND_NS
    return {
        "speed": _speed(plan, swarm),
        "cpu_us": cpu_summary(meters)["cpu_us"],
        "cpu_share": sum(cpu_s for cpu_s, _ in meters) / measured_s,
        "promises": sum(event["promises"] for event in collected.done) / collected.heard,
    }


def lockstep_scenario(scenario: str, overrides: list[str]) -> dict[str, float]:
    """Nominal seconds per wall second of a scenario in lockstep pace, and memory per agent in MB at its end."""
    plan = load_scenario(scenario, overrides).plan
    collected, swarm = run(plan, "lockstep")
    pss = sum(event["pss_kb"] for event in collected.done) / len(collected.done) / 1024
    promises = sum(event["promises"] for event in collected.done) / collected.heard
    return {"speed": _speed(plan, swarm), "promises": promises, "pss_mb": pss}


def _speed(plan: Plan, swarm: TimedSwarm) -> float:
    return plan.duration_ns / (swarm.over_ns - swarm.begun_ns)
