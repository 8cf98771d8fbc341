"""A running swarm as `volery status`, `fault`, `stop` and `volery.connect` reach it: requests to its supervisor."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgpack

from ...errors import BadInput, RunFailed
from ...transport import zenoh_session as zs
from ...transport.keys import CONTROL_CLIENT, Keys
from ..record.run_files import CONTROL_FILE

_TIMEOUT_S = 15.0
_JOIN_TIMEOUT_S = 5.0


@dataclass(frozen=True)
class RunningSwarm:
    """A running swarm, by its folder; each method is one request to its supervisor.

    Every method raises BadInput if the request is refused or the run is over, and RunFailed without an answer.
    """

    folder: Path

    def inject(self, fault: Mapping[str, Any]) -> str:
        """Inject a fault, given as in a scenario's timeline but without times: {"cut": "3-7", "for": "2 s"}.

        Returns:
            Its name, when it is in force, and notes, one a line.
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
        BadInput: there is none.
    """
    if not (Path(folder) / CONTROL_FILE).exists():
        raise BadInput(f"{folder} is not running: `volery run SCENARIO --detach --name NAME` starts runs/NAME")
    return RunningSwarm(Path(folder))


def running(runs: Path) -> list[Path]:
    """Folders of running swarms, the newest last."""
    return sorted(path.parent for path in runs.glob(f"*/{CONTROL_FILE}"))


def call(folder: Path, request: Mapping[str, Any]) -> Any:
    """The answer of the supervisor of the run in a folder to a request.

    Raises:
        BadInput: the run is over, or the request is refused.
        RunFailed: the supervisor does not answer.
    """
    control = folder / CONTROL_FILE
    if not control.exists():
        raise BadInput(f"{folder} is not running: `volery status` lists what is")
    access = json.loads(control.read_text())
    session = zs.open_client(access["endpoint"], zs.Credentials(CONTROL_CLIENT, access["password"]), _JOIN_TIMEOUT_S)
    try:
        key = Keys(access["run"]).supervisor()
        answers = asyncio.run(zs.ask(session, key, msgpack.packb(dict(request)), _TIMEOUT_S))
    finally:
        session.close()
    if not answers:
        raise RunFailed(f"the supervisor of {folder} does not answer")
    answer = msgpack.unpackb(next(iter(answers.values())))
    if "error" in answer:
        raise (BadInput if answer["exit_code"] == BadInput.exit_code else RunFailed)(answer["error"])
    return answer["result"]
