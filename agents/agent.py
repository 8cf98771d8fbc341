"""What an agent is: a deterministic state machine. Events come in as method calls, effects go out through its context.

An agent never sleeps, never reads a clock, never opens a socket and never draws from a global random generator.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import BadInput
from ..estimators.information import pack_symmetric
from ..kinds import NoParameters
from ..quantities import covariance_name
from ..randomness import Stream, stream
from ..transport.events import FOREVER_NS
from ..transport.media_settings import AIR
from .call_checks import covariance as checked_covariance
from .call_checks import finite_numbers, numbers, payload_bytes, plain, text, whole_number

if TYPE_CHECKING:
    from .plan import Plan, PublicPlan


@dataclass(frozen=True, slots=True)
class Sample:
    """A sensor sample; `value` is None where the sensor saw nothing."""

    sensor: str
    index: int
    time_ns: int
    value: NDArray[np.float64] | None


@dataclass(frozen=True, slots=True)
class Received:
    """A payload from a neighbour, at the instant at which it is due: all that a radio would tell.

    `measured`: what the receiver measured from the frame, such as range or signal strength, (k,); None where the world
    has no such sensor, or where it sees nothing.
    """

    source: str
    payload: bytes
    time_ns: int
    measured: NDArray[np.float64] | None = None


@dataclass(frozen=True, slots=True)
class Timer:
    """A timer that the agent has set."""

    name: str
    index: int
    time_ns: int


@dataclass(frozen=True, slots=True)
class Offer:
    """What an agent offers to each neighbour: largest payload [bytes], frames per second; None where unknown."""

    largest_payload: int | None
    per_second: float | None


class NotANeighbour(BadInput):
    """An agent wanted to talk to someone to whom it has no link."""


class FrameTooLarge(BadInput):
    """A payload over the MTU of its link."""


class BrokenPromise(BadInput):
    """An agent whose class says `timers_only` acted on a frame."""


class Send(NamedTuple):
    """Effect: hand a payload to one outlet, for one or more of its targets."""

    targets: tuple[str, ...]
    payload: bytes
    stream: str


class Refuse(NamedTuple):
    """Effect: count a payload over the MTU."""

    targets: tuple[str, ...]


class Report(NamedTuple):
    """Effect: journal an estimate."""

    quantity: str
    sample: int
    value: list[float]


class Note(NamedTuple):
    """Effect: journal that something happened."""

    what: str
    facts: dict[str, Any]


class Command(NamedTuple):
    """Effect: act upon a coupled world."""

    commands: dict[str, NDArray[np.float64]]


class Apply(NamedTuple):
    """Effect: journal that a command of an agent takes effect on a coupled world."""

    agent: str
    command: str
    value: list[float]


_NOTE_FIELDS = {"event", "agent", "incarnation", "time_ns"}

Effect = Send | Refuse | Timer | Report | Note | Command | Apply


@dataclass(slots=True)
class ContextState:
    """What a node tells its agent, and what the agent has asked for since: plain values, so nothing leads to the truth.

    outlet_of: target → the outlet that its link belongs to. mtus: outlet → MTU [bytes]. event_ns: reading of the own
    clock at the event in hand; `now_ns` is later where that had to wait. clock_jumped: whether the clock may have
    jumped over an instant that the agent planned for. may_act: whether it may send and set timers now.
    """

    name: str
    incarnation: int
    seed: int
    swarm: tuple[str, ...]
    position: tuple[float, ...] | None
    briefing: Any
    commands_world: bool
    outlet_of: Mapping[str, str]
    mtus: Mapping[str, int]
    neighbours: tuple[str, ...] = ()
    degrees: Mapping[str, int] = field(default_factory=dict)
    now_ns: int = 0
    event_ns: int = 0
    clock_jumped: bool = False
    may_act: bool = True
    effects: list[Effect] = field(default_factory=list)


class Context:
    """All that an agent may know and do.

    It holds plain values only. What the agent asks for takes effect when its handler returns, at the instant of the
    event in hand. Arguments are checked at the call: BadInput names call, value and remedy. Times and indices are whole
    numbers of at most 64 bits, NumPy's included; a float is refused.
    """

    __slots__ = ("_state",)

    def __init__(self, state: ContextState) -> None:
        self._state = state

    @property
    def name(self) -> str:
        """The agent's own name."""
        return self._state.name

    @property
    def neighbours(self) -> tuple[str, ...]:
        """Agents to which it has a link now, in natural order."""
        return self._state.neighbours

    @property
    def swarm(self) -> tuple[str, ...]:
        """All agents of the run, itself included, in natural order."""
        return self._state.swarm

    @property
    def degrees(self) -> Mapping[str, int]:
        """Number of neighbours of itself and of each neighbour."""
        return self._state.degrees

    @property
    def position(self) -> tuple[float, ...] | None:
        """Its place on the body [m], where the topology has places."""
        return self._state.position

    @property
    def briefing(self) -> Any:
        """What its class's `briefing` tells this agent before the start; None if nothing."""
        return self._state.briefing

    @property
    def now_ns(self) -> int:
        """Reading of its own clock at the event in hand [ns], or later where that event had to wait.

        Without a clock fault this is nominal time. Stamps and timers are by this clock.
        """
        return self._state.now_ns

    def send(self, target: str, payload: bytes, stream: str = "") -> None:
        """Hand a payload to the link to a neighbour; the sender is not told what becomes of it.

        Raises:
            NotANeighbour: there is no link to `target`.
            FrameTooLarge: the payload is over the link's MTU.
        """
        if target not in self._state.neighbours:
            known = ", ".join(map(repr, self.neighbours)) or "nobody"
            raise NotANeighbour(f"send: there is no link to {target!r}; the neighbours are {known}")
        self._check_may_act()
        self._send((target,), payload, stream)

    def broadcast(self, payload: bytes, stream: str = "") -> None:
        """Hand a payload to the links to all neighbours: one transmission over a shared radio, else one on each link.

        Raises:
            FrameTooLarge: the payload is over a link's MTU.
        """
        self._check_may_act()
        outlet_of = self._state.outlet_of
        if shared := tuple(target for target in self.neighbours if outlet_of[target] == AIR):
            self._send(shared, payload, stream)
        for target in self.neighbours:
            if outlet_of[target] != AIR:
                self._send((target,), payload, stream)

    def set_timer(self, time_ns: int, name: str = "", index: int = 0) -> None:
        """Ask for `on_timer` at an instant that is not before that of the event in hand.

        Where that event had to wait and the instant is over, or where its own clock has jumped, it rings at once.

        Raises:
            BadInput: the instant is before the event in hand, or later than every run.
        """
        state = self._state
        time_ns = whole_number(time_ns, "set_timer", "time_ns")
        index = whole_number(index, "set_timer", "index")
        name = text(name, "set_timer", "name")
        if time_ns < state.event_ns and not state.clock_jumped:
            raise BadInput(f"set_timer: {name!r} is set to {time_ns} ns, and now is {state.event_ns} ns")
        if time_ns >= FOREVER_NS:
            raise BadInput(f"set_timer: {name!r} is set to {time_ns} ns, later than every run: set no timer instead")
        self._check_may_act()
        state.effects.append(Timer(name, index, time_ns))

    def report(self, quantity: str, value: ArrayLike, index: int = 0, *, covariance: ArrayLike | None = None) -> None:
        """Journal an estimate; `index` is the sample it belongs to, `covariance` (k, k) that of its error.

        The value is a number or an array of them: NaN says that there is no estimate, infinity that it has diverged.
        The covariance is a quantity of its own, QUANTITY/covariance: its upper triangle by rows.

        Raises:
            BadInput: the value is empty, or no real numbers; the covariance is not square and symmetric, or a
                variance is below 0.
        """
        quantity, index = text(quantity, "report", "the quantity"), whole_number(index, "report", "index")
        flat: list[float] = numbers(value, "report", quantity).ravel().tolist()
        reports = [Report(quantity, index, flat)]
        if covariance is not None:
            matrix = checked_covariance(covariance, "report", f"covariance of {quantity}")
            reports.append(Report(covariance_name(quantity), index, pack_symmetric(matrix).tolist()))
        self._state.effects += reports

    def command(self, commands: Mapping[str, ArrayLike]) -> None:
        """Act upon a coupled world, by name: the commands take effect `compute` and the world's act delay later.

        Raises:
            BadInput: the scenario's world is not coupled, or a value is not finite.
        """
        if not isinstance(commands, Mapping):
            raise BadInput(f"command: {commands!r} is no mapping: give values by name, as in {{'thrust': [0, 0, 1]}}")
        flat = {
            text(name, "command", "a name"): finite_numbers(value, "command", name).flatten()
            for name, value in commands.items()
        }
        if not self._state.commands_world:
            raise BadInput(f"command: {', '.join(flat)} for a world that takes no commands")
        self._check_may_act()
        self._state.effects.append(Command(flat))

    def note(self, what: str, **facts: Any) -> None:
        """Journal that something happened, with values that say more about it.

        These are numbers, texts, and lists and mappings of them; NumPy's numbers and arrays become such values.

        Raises:
            BadInput: a value of another kind, or one that is called as something that every note has.
        """
        if taken := facts.keys() & _NOTE_FIELDS:
            raise BadInput(f"note: {', '.join(sorted(taken))} is in every note anyway: use another name")
        known = {name: plain(value, "note", name) for name, value in facts.items()}
        self._state.effects.append(Note(text(what, "note", "what"), known))

    def random(self, purpose: str) -> Stream:
        """The agent's own random stream for a purpose; a restarted agent has another one."""
        purpose, state = text(purpose, "random", "the purpose"), self._state
        return stream(state.seed, f"agent-{purpose}", state.name, str(state.incarnation))

    def _check_may_act(self) -> None:
        if not self._state.may_act:
            raise BrokenPromise("it acts on a frame, but its class says timers_only: remove that, or act on a timer")

    def _send(self, targets: tuple[str, ...], payload: bytes, stream: str) -> None:
        state = self._state
        payload, stream = payload_bytes(payload, "send"), text(stream, "send", "the stream")
        mtu = state.mtus[state.outlet_of[targets[0]]]
        if len(payload) > mtu:
            state.effects.append(Refuse(targets))
            raise FrameTooLarge(f"send: {len(payload)} B for {', '.join(targets)}, the link's MTU is {mtu} B")
        state.effects.append(Send(targets, payload, stream))


class Agent:
    """Base of all agents. Override the handlers that you need.

    `Parameters` is a frozen dataclass: its fields are what a scenario may write under `agents:`.
    `timers_only` says that this agent sends and sets timers from samples and timers only, never from a frame; its
    promises in lockstep pace then reach further. `evaluation` is the class by which runs of such agents are judged, a
    subclass of `volery.experiments.evaluation.evaluation.Evaluation`: itself, or its name as `package.module:Class`.
    """

    Parameters: ClassVar[type] = NoParameters
    timers_only: ClassVar[bool] = False
    evaluation: ClassVar[str | type] = "volery.experiments.evaluation.evaluation:Evaluation"

    def __init__(self, context: Context, parameters: Any) -> None:
        self.context = context
        self.parameters = parameters

    def start(self) -> None:
        """Called once, before any other event."""

    def on_sample(self, sample: Sample) -> None:
        """Called when a sensor has taken a sample."""

    def on_frame(self, frame: Received) -> None:
        """Called when a neighbour's payload has arrived."""

    def on_timer(self, timer: Timer) -> None:
        """Called when a timer is due."""

    def on_neighbours(self) -> None:
        """Called when the graph has changed, with the new `context.neighbours` and `context.degrees`."""

    def save(self) -> Any:
        """State that a kill with `keep_state` passes on to the next incarnation.

        It is made of None, numbers, texts, bytes, and lists and mappings of them by text; arrays become lists. Timers
        and queued frames are not kept. A class that overrides this overrides `restore` too.
        """
        raise BadInput(f"{type(self).__name__} keeps no state: it does not override save and restore")

    def restore(self, state: Any) -> None:
        """Restore what the previous incarnation has saved; called after `start`, which has set timers anew."""

    @classmethod
    def briefing(cls, plan: PublicPlan, name: str) -> Any:
        """What an agent is told before the start, worked out from all agents and links, such as weights."""
        return None

    @classmethod
    def keeps_state(cls) -> bool:
        """Whether such agents can pass their state on to the next incarnation."""
        return cls.save is not Agent.save

    @classmethod
    def largest_payload(cls, parameters: Any) -> int | None:
        """Largest payload that an agent with these parameters sends [bytes]; None if unknown beforehand."""
        return None

    @classmethod
    def sends_per_second(cls, parameters: Any) -> float | None:
        """Frames per second that such an agent offers to each neighbour; None if unknown beforehand."""
        return None

    @classmethod
    def offers(cls, plan: Plan, name: str) -> Offer:
        """What one agent of a plan sends, by its parameters; override it where that depends on the plan."""
        parameters = plan.agent(name).parameters
        return Offer(cls.largest_payload(parameters), cls.sends_per_second(parameters))

    @classmethod
    def is_silent(cls, plan: Plan, name: str) -> bool:
        """Whether this agent of a plan never sends, as far as known beforehand."""
        return cls.offers(plan, name).per_second == 0

    @classmethod
    def broadcasts(cls, parameters: Any) -> bool:
        """Whether such an agent sends by `broadcast`."""
        return False

    @classmethod
    def libraries(cls, parameters: Any) -> Sequence[str]:
        """Installed packages, besides NumPy and SciPy, on which the bits of such an agent's numbers depend."""
        return ()

    @classmethod
    def problems(cls, plan: Plan) -> Sequence[str]:
        """Problems that make a plan impossible for such agents, each a sentence with the remedy."""
        return ()
