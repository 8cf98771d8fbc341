"""The same message pattern in volery's twin, with the full link pipeline, and in SimPy, with links as delays."""

from __future__ import annotations

import time
from collections.abc import Generator
from typing import Any

import simpy
from shapes import SECOND_NS, phase_ns, ring
from swarms import Collected, full_pipeline, pulses

from volery.experiments.twin import Twin
from volery.transport.latency_settings import Normal

DEGREE = 4
RATE = 50.0
LATENCY_S = 0.002
FULL = full_pipeline(Normal(2_000_000, 500_000))


def twin_run(agents: int, frames: int) -> dict[str, float]:
    """CPU µs per delivered frame, including the cost of lost ones."""
    plan = pulses("bench_agents:Pulse", ring(agents, DEGREE), RATE, frames / (agents * DEGREE * RATE), FULL)
    sink = Collected()
    run = Twin(plan, sink)
    began = time.process_time()
    run.run()
    return {"cpu_us": (time.process_time() - began) / sink.delivered * 1e6, "frames": sink.delivered}


def simpy_run(agents: int, frames: int) -> dict[str, float]:
    """CPU µs per message: a sender per agent, and per link a store, a process for each delay, and a receiver."""
    world = simpy.Environment()
    neighbours = ring(agents, DEGREE)
    stores = {(a, b): simpy.Store(world) for a, near in neighbours.items() for b in near}
    payload = b"x" * 40
    heard = 0

    def delayed(store: simpy.Store) -> Generator[Any, Any, None]:
        yield world.timeout(LATENCY_S)
        yield store.put(payload)

    def sender(name: str, first_s: float) -> Generator[Any, Any, None]:
        yield world.timeout(first_s)
        while True:
            for other in neighbours[name]:
                world.process(delayed(stores[name, other]))
            yield world.timeout(1 / RATE)

    def receiver(store: simpy.Store) -> Generator[Any, Any, None]:
        nonlocal heard
        while True:
            yield store.get()
            heard += 1

    for index, name in enumerate(neighbours):
        world.process(sender(name, phase_ns(index, agents, RATE) / SECOND_NS))
    for store in stores.values():
        world.process(receiver(store))
    began = time.process_time()
    world.run(until=frames / (agents * DEGREE * RATE))
    return {"cpu_us": (time.process_time() - began) / heard * 1e6, "frames": heard}
