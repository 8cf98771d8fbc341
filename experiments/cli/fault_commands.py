"""`volery fault`: faults injected into a running swarm, in force at one nominal instant, and recorded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter

from ...errors import BadInput
from ..scenario.trace_files import anchor
from ..scenario.yaml_document import assign
from ..swarm.running_swarm import RunningSwarm
from .common_options import RUNS, RunsFolder, SwarmName
from .live_commands import running_swarm
from .output import print_plain

_LINKS = (
    "Links, separated by commas: 3-7 (both directions), '3>7' (one), the name of an agent or a group (all its links), "
    "left-right (between two groups), 'random 0.3' (that fraction of the edges), or all."
)
_AGENTS = "Agents, separated by commas: names of agents or groups, 'random 0.3' (that fraction), or all."
_KINDS = "halves, random, majority-ring, isolate 5, bridge 5, or the groups: 1,2,3 4,5,6, or left rest."
Links = Annotated[str, Parameter(help=_LINKS)]
Agents = Annotated[str, Parameter(help=_AGENTS)]
Sensors = Annotated[str, Parameter(help="Sensors of an agent, a group or all: 2.distance, all.distance.")]
Sides = Annotated[str, Parameter(help=_KINDS)]
Settings = Annotated[str, Parameter(help="FIELD=VALUE as in a scenario: loss=0.3 latency=5ms rate=57.6kbit/s.")]
Trouble = Annotated[
    str,
    Parameter(
        help="failed, stuck, bias=0.02, noise=0.05, or spikes.size=0.5 spikes.probability=0.1; in the sensor's unit, "
        "one number or one a component: bias=[0.1,0,0]."
    ),
]
KeepState = Annotated[bool, Parameter(help="Restart the agent with the state that it had.")]
Share = Annotated[float, Parameter(help="Share of the processor that the load takes, above 0 and at most 1.")]
Offset = Annotated[str | None, Parameter(help="Step of the local clock, e.g. 20ms, or --offset=-20ms.")]
Drift = Annotated[str | None, Parameter(help="Rate error of the local clock, e.g. 50ppm, or --drift=-50ppm.")]
Names = Annotated[str, Parameter(help="Names of faults, such as f1 or t2; by default all that are in force.")]

fault = App(name="fault")


@Parameter(name="*")
@dataclass(frozen=True)
class Where:
    """Which running swarm."""

    run: SwarmName = None
    runs: RunsFolder = RUNS

    @property
    def swarm(self) -> RunningSwarm:
        """The running swarm.

        Raises:
            BadInput: it is not running, or none is.
        """
        return running_swarm(self.run, self.runs)

    def inject(self, entry: Mapping[str, Any], lasting: Lasting) -> None:
        """Inject a fault, given as in a scenario's timeline but without `at`."""
        print_plain(self.swarm.inject({**entry, **lasting.fields()}))


@Parameter(name="*")
@dataclass(frozen=True)
class Lasting:
    """Duration of a fault, or its mean times as a random process, in nominal time."""

    for_: Annotated[str | None, Parameter("--for", help="Duration, e.g. 2s; by default until cleared.")] = None
    mtbf: Annotated[str | None, Parameter(help="Mean time between failures, e.g. 5s, of a random process.")] = None
    mttr: Annotated[str | None, Parameter(help="Mean time to repair, e.g. 1s; with --mtbf.")] = None
    together: Annotated[bool, Parameter(help="All places fail together, instead of separately.")] = False

    def fields(self) -> dict[str, Any]:
        """The fields of an entry of the timeline.

        Raises:
            BadInput: an incomplete random process.
        """
        if (self.mtbf is None) != (self.mttr is None) or (self.together and self.mtbf is None):
            raise BadInput("--mtbf and --mttr belong together, and --together to them: --mtbf 5s --mttr 1s")
        every = {"mtbf": self.mtbf, "mttr": self.mttr, "together": self.together}
        return {**({"every": every} if self.mtbf else {}), **({"for": self.for_} if self.for_ else {})}


NEWEST = Where()
ON = Lasting()


@fault.command
def cut(links: Links, /, *, lasting: Lasting = ON, where: Where = NEWEST) -> None:
    """Cut links: no frame passes. Example: volery fault cut 3-7 --for 2s."""
    where.inject({"cut": links}, lasting)


@fault.command
def restore(links: Links, /, *, where: Where = NEWEST) -> None:
    """End the cuts and partitions that touch these links. Example: volery fault restore 3-7."""
    print_plain(where.swarm.restore(links))


@fault.command
def hold(links: Links, /, *, lasting: Lasting = ON, where: Where = NEWEST) -> None:
    """Hold frames back until the fault ends. Example: volery fault hold 3-7 --for 500ms."""
    where.inject({"hold": links}, lasting)


@fault.command
def release(links: Links, /, *, where: Where = NEWEST) -> None:
    """Release the frames that are held back on these links. Example: volery fault release 3-7."""
    print_plain(where.swarm.release(links))


@fault.command
def partition(*sides: Sides, lasting: Lasting = ON, where: Where = NEWEST) -> None:
    """Cut the links between groups of agents. Example: volery fault partition isolate 5 --for 2s."""
    where.inject({"partition": " ".join(sides)}, lasting)


@fault.command(name="set")
def set_links(links: Links, /, *settings: Settings, lasting: Lasting = ON, where: Where = NEWEST) -> None:
    """Change settings of links. Example: volery fault set all loss=0.3 latency=5ms --for 2s."""
    changes, _ = assign({}, settings)
    anchor(changes, lambda _place: Path.cwd())
    where.inject({"where": links, "set": changes}, lasting)


@fault.command
def kill(agents: Agents, /, *, keep_state: KeepState = False, lasting: Lasting = ON, where: Where = NEWEST) -> None:
    """Kill agents' processes (kill -9); with --for they are restarted. Example: volery fault kill 5 --for 2s."""
    where.inject({"kill": agents, **({"keep_state": True} if keep_state else {})}, lasting)


@fault.command
def restart(agents: Agents, /, *, where: Where = NEWEST) -> None:
    """Restart agents that were killed by a fault. Example: volery fault restart 5."""
    print_plain(where.swarm.restart(agents))


@fault.command
def pause(agents: Agents, /, *, lasting: Lasting = ON, where: Where = NEWEST) -> None:
    """Pause agents: they handle later what arrives meanwhile. Example: volery fault pause 5 --for 1s."""
    where.inject({"pause": agents}, lasting)


@fault.command
def resume(agents: Agents, /, *, where: Where = NEWEST) -> None:
    """Resume paused agents. Example: volery fault resume 5."""
    print_plain(where.swarm.resume(agents))


@fault.command
def hog(agents: Agents, /, *, share: Share = 1.0, lasting: Lasting = ON, where: Where = NEWEST) -> None:
    """Load the processors of agents, in realtime pace. Example: volery fault hog 5 --share 0.5 --for 2s."""
    where.inject({"hog": agents, "share": share}, lasting)


@fault.command
def clock(
    agents: Agents, /, *, offset: Offset = None, drift: Drift = None, lasting: Lasting = ON, where: Where = NEWEST
) -> None:
    """Disturb agents' local clocks. Example: volery fault clock 5 --offset 20ms --drift 50ppm."""
    wrong = {name: value for name, value in (("offset", offset), ("drift", drift)) if value is not None}
    where.inject({"clock": agents, **wrong}, lasting)


@fault.command
def sensor(sensors: Sensors, /, *trouble: Trouble, lasting: Lasting = ON, where: Where = NEWEST) -> None:
    """Make sensors fail, stick or err. Example: volery fault sensor 2.distance bias=0.02 --for 2s."""
    fields = [word if "=" in word else f"{word}=true" for word in trouble]
    where.inject({"sensor": sensors, **assign({}, fields)[0]}, lasting)


@fault.command
def clear(*faults: Names, where: Where = NEWEST) -> None:
    """Undo faults. Example: volery fault clear f1."""
    print_plain(where.swarm.clear(*faults))
