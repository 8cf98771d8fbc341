"""An in-memory network for exact pace: the real pacers without processes, and a wire that delivers when it pleases.

Every pacer runs its node as in a process of its own. The network keeps order on each link, as one subscriber does, and
nothing else: which link delivers next, how many of its frames at once, when a woken agent wakes up, and how far the
wall clock goes meanwhile, if there is one, is drawn.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, cast

import numpy as np

from volery.agents.exact_pace import Exact
from volery.agents.node import Node
from volery.agents.plan import Plan
from volery.agents.run_start import RunStart
from volery.experiments.record.record import Collector, Record
from volery.transport.events import FOREVER_NS
from volery.transport.faults import Fault, Kill, kills_of
from volery.transport.frames import PROMISE_ONLY, Message, decode, encode
from volery.transport.media_settings import AIR

if TYPE_CHECKING:
    from asyncio import AbstractEventLoop


class Alarm:
    """The wall clock as one agent has it; it rings once, in the network's own time."""

    epoch_ns, speed = 0, 1.0

    def __init__(self, network: Network, wake: Callable[[], None]) -> None:
        self._network, self._wake = network, wake
        self.time_ns: int | None = None
        network.alarms.append(self)

    def now_ns(self) -> int:
        """The network's time."""
        return self._network.now_ns

    def wake_at(self, time_ns: int) -> None:
        """Set the alarm, or none."""
        self.time_ns = time_ns if time_ns < FOREVER_NS else None

    def ring(self) -> Callable[[], None]:
        """It rings, and has to be set again."""
        self.time_ns = None
        return self._wake

    def close(self) -> None:
        """Nothing to give back."""


class Network:
    """All nodes of a plan in exact pace, and the wire between them. It watches that promises are kept.

    Args:
        plan: what is run.
        seed: of what is drawn.
        clocked: whether there is a wall clock, else it is lockstep.
    """

    def __init__(self, plan: Plan, seed: int, *, clocked: bool = False) -> None:
        self._clocked = clocked
        self.now_ns = 0
        self.alarms: list[Alarm] = []
        self._rng = np.random.default_rng(seed)
        self._plan = plan
        self._wire: dict[tuple[str, str], deque[bytes]] = {link: deque() for link in (*plan.links, *plan.wires)}
        self._promised = dict.fromkeys(self._wire, 0)
        self._woken: list[Callable[[], None]] = []
        self._interventions: tuple[int, ...] = ()
        self._intervening = False
        self._live: dict[str, Fault] = {}
        self._collector = Collector()
        self._subscribed = {agent.name for agent in plan.all_agents}
        self._over: set[tuple[str, int]] = set()
        self._outside: set[tuple[str, int]] = set()
        self._standing_by: set[str] = set()
        self.done: set[str] = set()
        self.pacers: dict[str, Exact] = {}
        self.nodes: dict[str, Node] = {}
        for agent in plan.all_agents:
            self._make(agent.name)

    def _make(self, name: str, incarnation: int = 0, start_ns: int = 0, saved: bytes | None = None) -> None:
        done = partial(self._done, name, incarnation)
        clock_of = partial(Alarm, self) if self._clocked else None
        pacer = Exact(cast("AbstractEventLoop", self), self._write(name), done, lambda wake: wake, clock_of)
        self.pacers[name] = pacer
        self.nodes[name] = Node(self._plan, name, [], pacer.put, incarnation, start_ns, saved=saved)

    def _done(self, name: str, incarnation: int) -> None:
        """A node is at its end: of the run, or of a life, which has a next one where its kill has an end."""
        node = self.nodes[name]
        if not node.state.dead:
            self.done.add(name)
        elif (name, incarnation) not in self._over:
            self._over.add((name, incarnation))
            self._subscribed.discard(name)
            self._collector(node.take_journal())
            for link, queue in self._wire.items():
                if link[1] == name:
                    queue.clear()
            kill = self.kills(name)[incarnation]
            if kill.until_ns is None:
                self.done.add(name)
            else:
                self._woken.append(partial(self._stand_by, kill))

    def kills(self, name: str) -> list[Kill]:
        """The kills of an agent, those from outside the plan included."""
        return kills_of(({fault.id: fault for fault in self._plan.faults} | self._live).values(), name)

    def _stand_by(self, kill: Kill) -> None:
        """The next life of an agent has joined; it is told to begin some time later."""
        assert kill.until_ns is not None
        if kill.until_ns >= self._plan.duration_ns:
            self.done.add(kill.agent)
            return
        self.done.discard(kill.agent)
        self._subscribed.add(kill.agent)
        self._standing_by.add(kill.agent)
        self._woken.append(partial(self._revive, kill.agent, kill))

    def _revive(self, name: str, kill: Kill) -> None:
        """Nobody comes to life while somebody intervenes."""
        if self._intervening:
            self._woken.append(partial(self._revive, name, kill))
            return
        assert kill.until_ns is not None
        self._standing_by.discard(name)
        before = self.nodes[name]
        self._promised.update({link: 0 for link in self._promised if link[0] == name})
        self._make(name, before.state.incarnation + 1, kill.until_ns, before.saved if kill.keep_state else None)
        for fault in self._live.values():
            self.nodes[name].arm(fault)
        killed = tuple(self._outside)
        self.pacers[name].begin(self.nodes[name], RunStart(0, self._plan.duration_ns, self._interventions, killed))

    def _write(self, source: str) -> Callable[[str, Message], None]:
        def write(outlet: str, frame: Message) -> None:
            near = self._plan.agent(source).neighbours
            for target in near if outlet == AIR else (outlet,):
                link = (source, target)
                if target not in self._subscribed:
                    continue
                if frame.sequence != PROMISE_ONLY:
                    assert frame.start_ns >= self._promised[link], f"{link}: a frame starts before the promise"
                assert frame.promise_ns is not None
                assert frame.promise_ns >= self._promised[link], f"{link}: a promise was taken back"
                self._promised[link] = frame.promise_ns
                self._wire[link].append(encode(frame))

        return write

    def call_soon_threadsafe(self, wake: Callable[[], None]) -> None:
        """All that a pacer asks of its loop."""
        self._woken.append(wake)

    def start(self) -> None:
        """Bring all nodes to life."""
        for name, pacer in self.pacers.items():
            pacer.begin(self.nodes[name], RunStart(0, self._plan.duration_ns))

    def deliver(self) -> bool:
        """Deliver some of what is on one link, or wake somebody up; False when nothing is left to do."""
        busy = [link for link, queue in self._wire.items() if queue and link[1] not in self._standing_by]
        self._let_time_pass(idle=not busy and not self._woken)
        if not busy and not self._woken:
            return False
        choice = self._rng.integers(len(busy) + len(self._woken))
        if choice >= len(busy):
            self._woken.pop(choice - len(busy))()
            return True
        source, target = busy[choice]
        queue = self._wire[source, target]
        for _ in range(self._rng.integers(1, len(queue) + 1)):
            self.pacers[target].arrived(source, decode(queue.popleft()))
        return True

    def _let_time_pass(self, *, idle: bool) -> None:
        """The clock goes on by some of the way to the next alarm, all of it if nothing else happens."""
        set_ = [alarm for alarm in self.alarms if alarm.time_ns is not None]
        if not set_ or not (idle or self._rng.random() < 0.2):
            return
        next_ns = min(alarm.time_ns for alarm in set_ if alarm.time_ns is not None)
        share = 1.0 if idle else self._rng.uniform(0.0, 2.0)
        self.now_ns += max(0, int(share * (next_ns - self.now_ns)))
        for alarm in set_:
            if alarm.time_ns is not None and alarm.time_ns <= self.now_ns:
                self._woken.append(alarm.ring())

    def deliver_some(self, times: int) -> None:
        """Deliver that often, if there is so much."""
        for _ in range(times):
            self.deliver()

    def kill_from_outside(self, name: str) -> None:
        """An agent's process is gone; some of what it sent is on the wire still, and everybody is told at some time."""
        incarnation = self.nodes[name].state.incarnation
        self._subscribed.discard(name)
        self.done.add(name)
        self._woken = [wake for wake in self._woken if getattr(wake, "__self__", None) is not self.pacers[name]]
        for link, queue in self._wire.items():
            if link[1] == name:
                queue.clear()
        batch = self.nodes[name].take_journal()
        self._collector(batch)
        self._outside.add((name, incarnation))
        self._collector.event(
            {
                "event": "died",
                "agent": name,
                "incarnation": incarnation,
                "time_ns": 0,
                "cause": "was killed from outside",
            }
        )
        for other, pacer in self.pacers.items():
            if other != name:
                self._woken.append(partial(pacer.external_kill, name, incarnation))

    def living(self) -> list[str]:
        """Agents that are neither dead nor on standby, and whose process was not killed from outside."""
        running = self._subscribed - self._standing_by
        return [name for name, node in self.nodes.items() if not node.state.dead and name in running]

    def wire(self, source: str, target: str) -> list[Message]:
        """What is on its way from one to another."""
        return [decode(message) for message in self._wire[source, target]]

    def deliver_until(self, reached: Callable[[], bool]) -> bool:
        """Deliver until something has come about, or nothing is left."""
        while not reached() and self.deliver():
            pass
        return reached()

    def inject(self, fault_from: Callable[[int], Fault], between: Callable[[], None] = lambda: None) -> Fault:
        """Arm a fault everywhere as a supervisor does: prepare an instant, or hold all, and arm; `between` the phases.

        All go on meanwhile unless they are held.
        """
        self._intervening = True
        instant_ns = self._prepared() or self._held()
        between()
        fault = fault_from(instant_ns)
        assert instant_ns == (fault.at_ns if fault.until_ns is None else fault.until_ns)
        self._interventions += (instant_ns,)
        self._live[fault.id] = fault
        for name in self.living():
            self._promised |= {link: min(told, instant_ns) for link, told in self._promised.items() if link[0] == name}
            assert self.pacers[name].arm([fault], instant_ns)
            self.deliver_some(int(self._rng.integers(0, 8)))
        if isinstance(fault, Kill) and fault.until_ns is not None:
            self._stand_by(fault)
        self._intervening = False
        for name in self.living():
            self.pacers[name].thaw()
        return fault

    def _prepared(self) -> int:
        """An instant a little ahead, if nobody has passed it; else 0."""
        ahead_ns = int(self._rng.integers(0, 60_000_000))
        instant_ns = max(self.nodes[name].state.now_ns for name in self.living()) + ahead_ns
        instant_ns = max([instant_ns, *(before_ns + 1 for before_ns in self._interventions)])
        agreed = []
        for name in self.living():
            agreed.append(self.pacers[name].prepare(instant_ns))
            self.deliver_some(int(self._rng.integers(0, 8)))
        return instant_ns if all(agreed) and instant_ns < self._plan.duration_ns else 0

    def _held(self) -> int:
        """The first instant that nobody has reached; all are frozen."""
        instants = list(self._interventions)
        for name in self.living():
            passed_ns = self.pacers[name].freeze()
            assert all(heard.due_ns <= passed_ns for heard in self.nodes[name].state.journal.heard), name
            instants.append(passed_ns)
            self.deliver()
        return max(instants) + 1

    def finish(self) -> Record:
        """Deliver until nobody says anything more; everybody must have come to the end."""
        while self.deliver():
            pass
        waiting = {name: self.nodes[name].state.now_ns for name in self.nodes.keys() - self.done}
        assert not waiting, f"stuck, waiting for each other: {waiting}"
        for name, node in self.nodes.items():
            if (name, node.state.incarnation) in self._outside:
                continue
            if not node.state.dead:
                node.finish()
            if batch := node.take_journal():
                self._collector(batch)
        self._collector.event({"event": "finished", "time_ns": self._plan.duration_ns})
        return self._collector.record(replace(self._plan, faults=(*self._plan.faults, *self._live.values())))
