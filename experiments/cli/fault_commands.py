"""`volery fault`: faults of a running swarm, in force at one nominal instant for all, and recorded."""

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
    "3-7 both directions, 3>7 one (quote it), an agent's or a group's name all links that touch it, left-right those "
    "between two groups, 'random 0.3' a fraction of the edges, or all; several with commas."
)
_AGENTS = "Names of agents or groups, 'random 0.3', or all; several with commas."
_KINDS = "halves, random, majority-ring, isolate 5, bridge 5, or the sides: 1,2,3 4,5,6, left rest."
Links = Annotated[str, Parameter(help=_LINKS)]
Agents = Annotated[str, Parameter(help=_AGENTS)]
Sensors = Annotated[str, Parameter(help="An agent's or a group's sensor: 2.distance, all.distance.")]
Sides = Annotated[str, Parameter(help=_KINDS)]
Settings = Annotated[str, Parameter(help="FIELD=VALUE, the value as in a scenario.")]
Trouble = Annotated[
    str,
    Parameter(
        help="failed, stuck, bias=0.02, noise=0.05, or spikes.size=0.5 spikes.probability=0.1; sizes in the sensor's "
        "unit, or one for each component: bias=[0.1,0,0]."
    ),
]
KeepState = Annotated[bool, Parameter(help="What it saved when it died is given back to its next life.")]
Share = Annotated[float, Parameter(help="Share of the processor that is taken, up to 1.")]
Offset = Annotated[str | None, Parameter(help="How far its clock jumps, e.g. 20ms, or --offset=-20ms.")]
Drift = Annotated[str | None, Parameter(help="How much faster its clock runs, e.g. 50ppm, or --drift=-50ppm.")]
Names = Annotated[str, Parameter(help="Names of faults such as f1 or t2; without any, all that are in force.")]

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
    """How long a fault lasts, or how often it comes and goes; nominal time."""

    for_: Annotated[str | None, Parameter("--for", help="How long, e.g. 2s; until cleared without it.")] = None
    mtbf: Annotated[str | None, Parameter(help="Mean time between failures, e.g. 5s: comes and goes at random.")] = None
    mttr: Annotated[str | None, Parameter(help="Mean time to repair, e.g. 1s; goes with --mtbf.")] = None
    together: Annotated[bool, Parameter(help="All places fail together, instead of each by itself.")] = False

    def fields(self) -> dict[str, Any]:
        """As in a timeline.

        Raises:
            BadInput: half of a random process.
        """
        if (self.mtbf is None) != (self.mttr is None) or (self.together and self.mtbf is None):
            raise BadInput("--mtbf and --mttr belong together, and --together to them: --mtbf 5s --mttr 1s")
        every = {"mtbf": self.mtbf, "mttr": self.mttr, "together": self.together}
        return {**({"every": every} if self.mtbf else {}), **({"for": self.for_} if self.for_ else {})}


NEWEST = Where()
ON = Lasting()


@fault.command
def cut(links: Links, /, *, lasting: Lasting = ON, where: Where = NEWEST) -> None:
    """Cut links: nothing comes through. Example: volery fault cut 3-7 --for 2s."""
    where.inject({"cut": links}, lasting)


@fault.command
def restore(links: Links, /, *, where: Where = NEWEST) -> None:
    """End the cuts and partitions that touch these links."""
    print_plain(where.swarm.restore(links))


@fault.command
def hold(links: Links, /, *, lasting: Lasting = ON, where: Where = NEWEST) -> None:
    """Hold frames back: those on their way and those to come wait. Example: volery fault hold 3-7 --for 500ms."""
    where.inject({"hold": links}, lasting)


@fault.command
def release(links: Links, /, *, where: Where = NEWEST) -> None:
    """Let the frames come that are held back on these links."""
    print_plain(where.swarm.release(links))


@fault.command
def partition(*sides: Sides, lasting: Lasting = ON, where: Where = NEWEST) -> None:
    """Cut every link between the sides of a partition. Example: volery fault partition isolate 5 --for 2s."""
    where.inject({"partition": " ".join(sides)}, lasting)


@fault.command(name="set")
def set_links(links: Links, /, *settings: Settings, lasting: Lasting = ON, where: Where = NEWEST) -> None:
    """Change links: loss=0.3 latency=5ms rate=57.6kbit/s, or any field of a scenario's links."""
    changes, _ = assign({}, settings)
    anchor(changes, lambda _place: Path.cwd())
    where.inject({"where": links, "set": changes}, lasting)


@fault.command
def kill(agents: Agents, /, *, keep_state: KeepState = False, lasting: Lasting = ON, where: Where = NEWEST) -> None:
    """Kill agents' processes, as by kill -9; with --for they come back, without their state unless it is kept."""
    where.inject({"kill": agents, **({"keep_state": True} if keep_state else {})}, lasting)


@fault.command
def restart(agents: Agents, /, *, where: Where = NEWEST) -> None:
    """Bring back agents that were killed."""
    print_plain(where.swarm.restart(agents))


@fault.command
def pause(agents: Agents, /, *, lasting: Lasting = ON, where: Where = NEWEST) -> None:
    """Let agents do nothing; what reaches them meanwhile they handle afterwards."""
    where.inject({"pause": agents}, lasting)


@fault.command
def resume(agents: Agents, /, *, where: Where = NEWEST) -> None:
    """Let agents go on that are paused."""
    print_plain(where.swarm.resume(agents))


@fault.command
def hog(agents: Agents, /, *, share: Share = 1.0, lasting: Lasting = ON, where: Where = NEWEST) -> None:
    """Take a share of agents' processors away, in realtime pace. Example: volery fault hog 5 --share 0.5 --for 2s."""
    where.inject({"hog": agents, "share": share}, lasting)


@fault.command
def clock(
    agents: Agents, /, *, offset: Offset = None, drift: Drift = None, lasting: Lasting = ON, where: Where = NEWEST
) -> None:
    """Let agents' own clocks be off. Example: volery fault clock 5 --offset 20ms --drift 50ppm."""
    wrong = {name: value for name, value in (("offset", offset), ("drift", drift)) if value is not None}
    where.inject({"clock": agents, **wrong}, lasting)


@fault.command
def sensor(sensors: Sensors, /, *trouble: Trouble, lasting: Lasting = ON, where: Where = NEWEST) -> None:
    """Let sensors fail, stick, or say something wrong. Example: volery fault sensor 2.distance bias=0.02 --for 2s."""
    told = [word if "=" in word else f"{word}=true" for word in trouble]
    where.inject({"sensor": sensors, **assign({}, told)[0]}, lasting)


@fault.command
def clear(*faults: Names, where: Where = NEWEST) -> None:
    """Undo faults."""
    print_plain(where.swarm.clear(*faults))
