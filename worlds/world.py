"""A world of one's own: the truth of a run and its sensors, as functions of seed and time.

A scenario names the class, `world: {kind: my_world:Arena, …}`. Override what the world has; the rest stays as here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from numpy.typing import ArrayLike

from ..errors import BadInput
from ..kinds import NoParameters
from ..quantities import Floats, Quantity
from ..randomness import Stream, stream
from ..topologies import Position


@dataclass(frozen=True)
class Surroundings:
    """What a world is made in.

    agents: their names, in natural order; none where the topology takes them from the world.
    positions: agent → (x, y) or (x, y, z) [m], where the topology has positions.
    seed: of the run.
    """

    agents: tuple[str, ...]
    positions: Mapping[str, Position]
    seed: int


class World:
    """Base of worlds.

    Every method must be a pure function of the seed and its arguments: each agent's process makes a world of its own
    and asks it in an order of its own. Random numbers come from `random`, by index.

    `Parameters` is a frozen dataclass: its fields are what a scenario may say of the world. `quantities` declares what
    agents estimate, where their evaluation does not. `agents`, `positions`, `seed` as in `Surroundings`.

    A world that agents act upon overrides `begin`. It runs as an agent of its own, and `measure`, `truth` and
    `position` are then not asked. `sense_delay_ns` passes from a sample to its arrival, `act_delay_ns` from a command
    to its effect, `truth_rate` [Hz] says how often the truth is recorded.
    """

    Parameters: ClassVar[type] = NoParameters
    quantities: Sequence[Quantity] = ()
    sense_delay_ns: int = 5_000_000
    act_delay_ns: int = 5_000_000
    truth_rate: float = 50.0

    def __init__(self, surroundings: Surroundings, parameters: Any) -> None:
        self.agents = surroundings.agents
        self.positions = surroundings.positions
        self.seed = surroundings.seed
        self.parameters = parameters
        self._streams: dict[tuple[str, ...], Stream] = {}

    def random(self, purpose: str, *names: str) -> Stream:
        """The random stream of a purpose between these ends, such as who measures and who is measured."""
        key = (purpose, *names)
        if key not in self._streams:
            self._streams[key] = stream(self.seed, f"world-{purpose}", *names)
        return self._streams[key]

    @property
    def model(self) -> Any:
        """What agents know of the world before the start, such as noise; `Agent.briefing` gets it as `plan.model`."""
        return None

    def sensors(self, agent: str) -> Mapping[str, float | Sequence[int]]:
        """An agent's sensors: name → rate [Hz], or the instants of all samples [ns] in ascending order."""
        return {}

    def measure(self, agent: str, sensor: str, index: int, time_ns: int) -> ArrayLike | None:
        """A sensor's index-th sample, taken at an instant.

        A number, a vector (k,), or rows (n, k) whose first column says what each row measures, as by the number of an
        agent in `agents`; sensor faults leave that column alone. None, or no rows, where it sees nothing.
        """
        raise BadInput(f"{type(self).__name__} does not override measure, and agent {agent} has sensor {sensor!r}")

    def measure_frame(self, source: str, target: str, time_ns: int, noise: Stream) -> ArrayLike | None:
        """What `target` measures from a frame of `source`, such as its range: a number or a vector (k,).

        It is asked for each frame that is delivered; the value comes as `Received.measured`.

        Args:
            source: who sent it.
            target: who received it.
            time_ns: nominal start of the frame's transmission.
            noise: random stream of this frame, by index from 0 on; a duplicate has another one.
        Returns:
            None where nothing was measured.
        """
        return None

    def truth(self, agent: str, quantity: str, time_ns: int) -> ArrayLike | None:
        """The true value of what an agent reports as `quantity`, at an instant; None where the world does not know."""
        return None

    def position(self, agent: str, time_ns: int) -> ArrayLike:
        """Where an agent is at an instant, (2,) or (3,) [m]; override it if agents move.

        Distances of agents, losses that depend on them, and pictures then follow.
        """
        return self.positions[agent]

    def begin(self) -> RunningWorld:
        """The world at instant 0, of a world that agents act upon."""
        raise BadInput(f"{type(self).__name__} does not override begin")


class RunningWorld:
    """Base of worlds that agents act upon, as they run: state machines without a clock.

    `advance` to an instant comes before anything else that happens at it.
    """

    def advance(self, time_ns: int) -> None:
        """Advance to an instant, which is not before the present one."""

    def act(self, agent: str, command: str, value: Floats) -> None:
        """Let an agent's command take effect now.

        Raises:
            BadInput: there is no such command.
        """
        raise BadInput(f"the world takes no command {command!r} of agent {agent}")

    def measure(self, agent: str, sensor: str, index: int) -> ArrayLike | None:
        """A sensor's index-th sample, taken now; as in `World.measure`."""
        return None

    def truth(self) -> Mapping[str, ArrayLike]:
        """Quantity → its true value now; "quantity@agent" where it is that of one agent.

        "positions" has a row for each agent, in natural order: pictures are drawn from it.
        """
        return {}

    def events(self) -> Sequence[Mapping[str, Any]]:
        """Events since the last call, each {"event": …, "time_ns": …, …} of plain values."""
        return ()
