"""A running swarm from Python: what `volery.connect` gives; each method is one request to its supervisor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...errors import BadInput
from ..record.run_files import CONTROL_FILE
from .control_client import call


@dataclass(frozen=True)
class RunningSwarm:
    """A running swarm, by its folder.

    Every method raises BadInput where what it asks is refused or the run is over, and RunFailed without an answer.
    """

    folder: Path

    def inject(self, fault: Mapping[str, Any]) -> str:
        """Inject a fault, given as in a scenario's timeline but without times: {"cut": "3-7", "for": "2 s"}.

        Returns:
            Its name, when it is in force, and notes, each a line.
        """
        return str(call(self.folder, {"do": "inject", "fault": dict(fault)}))

    def clear(self, *names: str) -> str:
        """Undo faults, such as f1 or t2; without a name all that are in force."""
        return str(call(self.folder, {"do": "clear", "faults": list(names)}))

    def restore(self, links: str) -> str:
        """End the cuts and partitions that touch these links."""
        return str(call(self.folder, {"do": "restore", "links": links}))

    def release(self, links: str) -> str:
        """Release the frames that are held back on these links."""
        return str(call(self.folder, {"do": "release", "links": links}))

    def restart(self, agents: str) -> str:
        """Restart agents that were killed."""
        return str(call(self.folder, {"do": "restart", "agents": agents}))

    def resume(self, agents: str) -> str:
        """Resume agents that are paused."""
        return str(call(self.folder, {"do": "resume", "agents": agents}))

    def status(self) -> dict[str, Any]:
        """Nominal time [s], who is alive, counts of frames, and the faults in force by name."""
        return dict(call(self.folder, {"do": "status"}))

    def stop(self) -> str:
        """End the run."""
        return str(call(self.folder, {"do": "stop"}))


def connect(folder: str | Path) -> RunningSwarm:
    """The swarm that runs in a folder.

    Raises:
        BadInput: none does.
    """
    if not (Path(folder) / CONTROL_FILE).exists():
        raise BadInput(f"{folder} is not running: `volery run SCENARIO --detach --name NAME` starts runs/NAME")
    return RunningSwarm(Path(folder))
