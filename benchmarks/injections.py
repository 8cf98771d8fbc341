"""Time of live faults in a running swarm from the command to the instant of effect."""

from __future__ import annotations

import asyncio
import tempfile
import time
from pathlib import Path

from shapes import quantile, ring
from swarms import TimedSwarm, pulses

import volery
from volery.experiments.record.frame_fates import frame_fates
from volery.experiments.record.record import Collector, Record
from volery.experiments.swarm.control_server import ControlServer
from volery.experiments.swarm.live_faults import Injector
from volery.transport.keys import Keys
from volery.transport.latency_settings import Constant
from volery.transport.links import LinkSettings

_WARM_S, _LOOK_S, _LONGEST_S, _LASTS = 1.0, 0.01, 0.6, "60 ms"
_RUN = "bench"


def latency(agents: int, degree: int, rate: float, faults: int) -> dict[str, float]:
    """Milliseconds from the call to the instant of effect, for consecutive cuts of all links in exact pace.

    `stray`: frames that were cut outside of a fault, or delivered during one; `late`: late faults.
    """
    seconds = _WARM_S + faults * _LONGEST_S
    plan = pulses("bench_agents:Pulse", ring(agents, degree), rate, seconds, LinkSettings(latency=Constant(20_000_000)))
    collector = Collector()

    async def life() -> tuple[TimedSwarm, list[int]]:
        swarm = TimedSwarm(plan, collector, _RUN)
        injector = Injector(swarm)
        running = asyncio.create_task(swarm.run())
        await swarm.ready.wait()
        with tempfile.TemporaryDirectory() as folder:
            serving = asyncio.create_task(ControlServer(swarm, injector).serve(Keys(_RUN), Path(folder)))
            await asyncio.sleep(_WARM_S)
            called = [await _command(Path(folder), injector) for _ in range(faults)]
            await swarm.stop()
            await running
            serving.cancel()
        return swarm, called

    swarm, called = asyncio.run(life())
    record = collector.record(plan)
    effects = [event["fault"]["at_ns"] + swarm.epoch_ns for event in record.events if event["event"] == "fault"]
    waits = sorted((effect - call) / 1e6 for effect, call in zip(effects, called, strict=True))
    late = sum(event["event"] == "late-fault" for event in record.events)
    return {"p50": quantile(waits, 0.5), "p99": quantile(waits, 0.99), "stray": _stray(record), "late": late}


async def _command(folder: Path, injector: Injector) -> int:
    """Cut all links briefly after the last cut is over; the time of the call on the monotonic clock [ns]."""
    while injector.in_force():  # noqa: ASYNC110 - there is no event to wait for
        await asyncio.sleep(_LOOK_S)
    began_ns = time.monotonic_ns()
    await asyncio.to_thread(volery.connect(folder).inject, {"cut": "all", "for": _LASTS})
    return began_ns


def _stray(record: Record) -> int:
    """Number of frames whose fate contradicts the faults at their start."""

    def is_cut(start_ns: int) -> bool:
        return any(fault.in_force(start_ns) for fault in record.faults)

    frames = (frame for of_link in frame_fates(record).values() for frame in of_link)
    return sum(
        (frame.fate == "cut") != is_cut(frame.start_ns)
        for frame in frames
        if frame.start_ns is not None and frame.fate in ("cut", "delivered")
    )
