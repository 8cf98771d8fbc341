"""Radios in one collision domain with carrier sense: in volery's twin, and in SimPy written as plainly as it goes.

Every node broadcasts at random instants, and all others hear it. The channel is used for a share of its time that does
not depend on how many nodes there are.
"""

from __future__ import annotations

import random
import time
from collections.abc import Generator
from typing import Any

import simpy

from volery.experiments.record.record import Collector
from volery.experiments.scenario.load import load_scenario
from volery.experiments.twin import Twin
from volery.transport.media_settings import Csma

PAYLOAD_BYTES, OVERHEAD_BYTES, RATE = 40, 17, 250_000
FRAME_BYTES = PAYLOAD_BYTES + OVERHEAD_BYTES
AIRTIME_S = FRAME_BYTES * 8 / RATE
LOAD = 0.3
ACCESS = Csma()
PERIOD_S, CCA_S, TURNAROUND_S = ACCESS.period / 1e9, ACCESS.cca / 1e9, ACCESS.turnaround / 1e9


def frames_per_second(nodes: int) -> float:
    """Of one node, so that all of them use the share of the channel."""
    return LOAD / AIRTIME_S / nodes


def twin_run(nodes: int, seconds: float) -> dict[str, float]:
    """CPU µs per frame at a receiver, collided ones included; receptions; share of them delivered."""
    beacons = f"kind: beacon, pattern: poisson, broadcast: true, size: {PAYLOAD_BYTES} B"
    fields = (
        f"topology={{complete: {nodes}}}",
        f"agents={{{beacons}, rate: {frames_per_second(nodes)!r} Hz}}",
        "links={preset: 802.15.4, latency: 1 ms}",
        f"duration={seconds} s",
    )
    collector = Collector()
    run = Twin(load_scenario("beacons", fields).plan, collector)
    began = time.process_time()
    run.run()
    spent = time.process_time() - began
    fates = [entry.fate for batch in collector.batches.values() for entry in batch.heard]
    return _summary(spent, len(fates), fates.count("delivered"))


def simpy_run(nodes: int, seconds: float) -> dict[str, float]:
    """The same, with a store and three processes for each node, and neither encoding nor record."""
    channel = _Channel(nodes)
    began = time.process_time()
    channel.world.run(until=seconds)
    return _summary(time.process_time() - began, len(channel.heard), sum(channel.heard))


class _Signal:
    """A transmission until `end_s`, and whether it met another."""

    def __init__(self, end_s: float) -> None:
        self.end_s = end_s
        self.met = False


class _Channel:
    """Nodes that all hear each other; `heard` has an entry for each frame at each receiver, whether it was clear."""

    def __init__(self, nodes: int) -> None:
        self.world = simpy.Environment()
        self.heard: list[bool] = []
        self._draws = random.Random(1)  # noqa: S311 - traffic
        self._rate = frames_per_second(nodes)
        self._on_air: list[_Signal] = []
        self._inboxes = [simpy.Store(self.world) for _ in range(nodes)]
        for inbox in self._inboxes:
            queue = simpy.Store(self.world)
            self.world.process(self._talk(queue))
            self.world.process(self._send(inbox, queue))
            self.world.process(self._hear(inbox))

    def _talk(self, queue: simpy.Store) -> Generator[Any, Any, None]:
        while True:
            yield self.world.timeout(self._draws.expovariate(self._rate))
            yield queue.put(b"x" * PAYLOAD_BYTES)

    def _send(self, own: simpy.Store, queue: simpy.Store) -> Generator[Any, Any, None]:
        while True:
            payload = yield queue.get()
            for attempt in range(ACCESS.max_backoffs + 1):
                exponent = min(ACCESS.min_be + attempt, ACCESS.max_be)
                yield self.world.timeout(self._draws.randrange(2**exponent) * PERIOD_S)
                began_s = self.world.now
                yield self.world.timeout(CCA_S)
                if all(signal.end_s <= began_s for signal in self._on_air):
                    yield self.world.timeout(TURNAROUND_S)
                    yield from self._transmit(own, payload)
                    break

    def _transmit(self, own: simpy.Store, payload: bytes) -> Generator[Any, Any, None]:
        now_s = self.world.now
        signal = _Signal(now_s + AIRTIME_S)
        self._on_air = [other for other in self._on_air if other.end_s > now_s - CCA_S]
        for other in self._on_air:
            if other.end_s > now_s:
                other.met = signal.met = True
        self._on_air.append(signal)
        yield self.world.timeout(AIRTIME_S)
        for inbox in self._inboxes:
            if inbox is not own:
                yield inbox.put((payload, not signal.met))

    def _hear(self, inbox: simpy.Store) -> Generator[Any, Any, None]:
        while True:
            _, clear = yield inbox.get()
            self.heard.append(clear)


def _summary(spent_s: float, receptions: int, delivered: int) -> dict[str, float]:
    return {"cpu_us": spent_s / receptions * 1e6, "receptions": receptions, "delivered": delivered / receptions}
