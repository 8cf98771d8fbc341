"""The context of an agent: the one door between its pure code and the node that carries it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import BadInput
from ..randomness import Stream, stream
from ..transport.faults import Fault
from .agent import CentralEstimator, Timer
from .journal import NOTED, Estimate
from .plan import WORLD, AgentPlan, Plan
from .registry import find
from .wires import pack_commands

if TYPE_CHECKING:
    from .node import Node


class NotANeighbour(BadInput):
    """An agent wanted to talk to someone to whom it has no link."""


class BrokenPromise(BadInput):
    """An agent that says it acts on timers and samples only acted on a frame."""


class NodeContext:
    """What a node lets its agent see and do; see `agent.Context`."""

    __slots__ = ("_me", "_node")

    def __init__(self, node: Node, me: AgentPlan) -> None:
        self._node = node
        self._me = me

    @property
    def name(self) -> str:
        """The agent's own name."""
        return self._me.name

    @property
    def neighbours(self) -> tuple[str, ...]:
        """Whom it may talk to now, in natural order."""
        return self._node.present

    @property
    def swarm(self) -> tuple[str, ...]:
        """All agents of the run, in natural order."""
        return tuple(agent.name for agent in self.plan.agents)

    @property
    def degrees(self) -> Mapping[str, int]:
        """Number of neighbours of itself and of each neighbour."""
        return self._node.degrees

    @property
    def position(self) -> tuple[float, ...] | None:
        """Its place on the body in metres, where the topology has places."""
        return self._me.position

    @property
    def briefing(self) -> Any:
        """What its class has for it before the start."""
        return find(self._me.kind).briefing(self.plan, self.name)

    @property
    def now_ns(self) -> int:
        """What its own clock shows for the event in hand, or later where that had to wait."""
        return self._node.clock.reading(self._node.now_ns)

    def send(self, target: str, payload: bytes, stream: str = "") -> None:
        """Hand a payload to the link to a neighbour; what becomes of it is not told."""
        if target not in self._node.present:
            known = ", ".join(self.neighbours)
            raise NotANeighbour(f"agent {self.name} has no link to {target!r}; its neighbours are {known}")
        self._check_promise()
        self._node.sender.send((target,), payload, stream)

    def broadcast(self, payload: bytes, stream: str = "") -> None:
        """Hand a payload to the links to all neighbours: one transmission over a shared radio, else one on each."""
        self._check_promise()
        self._node.sender.broadcast(self.neighbours, payload, stream)

    def set_timer(self, time_ns: int, name: str = "", index: int = 0) -> None:
        """Ask for `on_timer` at an instant that is not before that of the event in hand, unless its own clock jumps."""
        if time_ns < self._node.event_ns and not self._node.clock_jumps():
            raise BadInput(f"agent {self.name} set timer {name!r} to {time_ns} ns, and now is {self._node.event_ns} ns")
        self._check_promise()
        self._node.set_timer(Timer(name, index, time_ns))

    def report(self, quantity: str, value: ArrayLike, index: int = 0) -> None:
        """Write down an estimate; `index` is the sample it belongs to."""
        flat: list[float] = np.asarray(value, dtype=np.float64).ravel().tolist()
        self._node.journal.estimates.append(Estimate(self._node.now_ns, quantity, index, flat))

    def command(self, commands: Mapping[str, ArrayLike]) -> None:
        """Act upon a coupled world."""
        if WORLD not in self._me.wired:
            named = ", ".join(commands)
            raise BadInput(f"agent {self.name} commands {named}, and this scenario's world takes no commands")
        self.wire(WORLD, pack_commands(commands))

    def note(self, what: str, **facts: Any) -> None:
        """Write down that something happened."""
        entry = {"event": NOTED, "what": what, "time_ns": self._node.now_ns, **facts}
        self._node.journal.events.append(entry)

    # -- what a coupled world needs besides ---------------------------------------------------------------------

    @property
    def plan(self) -> Plan:
        """The plan of the run."""
        return self._node.plan

    @property
    def faults(self) -> Iterable[Fault]:
        """The faults that touch this agent, live ones included."""
        return self._node.faults.values()

    def central_estimator(self) -> CentralEstimator | None:
        """The centralised estimator that the agents' class has for this plan."""
        return find(self.plan.agents[0].kind).central_estimator(self.plan)

    def wire(self, target: str, payload: bytes) -> None:
        """Hand a payload to the wire to a coupled world, or from it."""
        self._check_promise()
        self._node.sender.send((target,), payload, "")

    # -- chance ---------------------------------------------------------------------------------------------------

    def random(self, purpose: str) -> Stream:
        """The agent's own random stream for a purpose."""
        return stream(self._node.plan.seed, f"agent-{purpose}", self.name, str(self._node.incarnation))

    def _check_promise(self) -> None:
        if self._node.in_frame and self._node.timers_only:
            raise BrokenPromise(
                f"agent {self.name} acts on a frame, but its class says timers_only: remove that, or act on a timer"
            )
