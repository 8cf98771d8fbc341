"""`volery fault`: faults of a running swarm, in force at one nominal instant for all, and recorded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter

from .cli_live import running_swarm
from .cli_output import print_plain
from .cli_parameters import RUNS, RunsFolder, SwarmName
from .operator import call
from .reading import assign
from .traces import anchor

_LINKS = "3-7 both directions, 3>7 one (quote it), an agent's name all of its links, or all; several with commas."
Links = Annotated[str, Parameter(help=_LINKS)]
Agent = Annotated[str, Parameter(help="Name of the agent.")]
Lasting = Annotated[
    str | None, Parameter("--for", help="How long, e.g. 2s, in nominal time; until cleared without it.")
]
Settings = Annotated[str, Parameter(help="FIELD=VALUE, the value as in a scenario.")]
Names = Annotated[str, Parameter(help="Names of faults such as f1 or t2; without any, all that are in force.")]

fault = App(name="fault")


@Parameter(name="*")
@dataclass(frozen=True)
class Where:
    """The swarm that is meant."""

    run: SwarmName = None
    runs: RunsFolder = RUNS

    def ask(self, request: Mapping[str, Any]) -> None:
        """Put a request to the supervisor and print what it says."""
        print_plain(str(call(running_swarm(self.run, self.runs), request)))

    def inject(self, entry: Mapping[str, Any], lasting: str | None) -> None:
        """Inject a fault, written as in a scenario's timeline but without `at`."""
        self.ask({"do": "inject", "fault": {**entry, **({} if lasting is None else {"for": lasting})}})


NEWEST = Where()


@fault.command
def cut(links: Links, /, *, for_: Lasting = None, where: Where = NEWEST) -> None:
    """Cut links: nothing comes through."""
    where.inject({"cut": links}, for_)


@fault.command
def restore(links: Links, /, *, where: Where = NEWEST) -> None:
    """End the cuts that touch these links."""
    where.ask({"do": "restore", "fault": {"cut": links}})


@fault.command(name="set")
def set_links(links: Links, /, *settings: Settings, for_: Lasting = None, where: Where = NEWEST) -> None:
    """Change links: loss=0.3 latency=5ms rate=57.6kbit/s, or any field of a scenario's links."""
    changes, _ = assign({}, settings)
    anchor(changes, lambda _place: Path.cwd())
    where.inject({"where": links, "set": changes}, for_)


@fault.command
def kill(agent: Agent, /, *, for_: Lasting = None, where: Where = NEWEST) -> None:
    """Kill an agent's process; with --for it comes back without its state."""
    where.inject({"kill": agent}, for_)


@fault.command
def restart(agent: Agent, /, *, where: Where = NEWEST) -> None:
    """Bring back an agent that was killed, without its state."""
    where.ask({"do": "restart", "agent": agent})


@fault.command
def pause(agent: Agent, /, *, for_: Lasting = None, where: Where = NEWEST) -> None:
    """Let an agent do nothing; what reaches it meanwhile it handles afterwards."""
    where.inject({"pause": agent}, for_)


@fault.command
def clear(*faults: Names, where: Where = NEWEST) -> None:
    """Undo faults."""
    where.ask({"do": "clear", "faults": list(faults)})
