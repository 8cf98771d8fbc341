"""The control client of a running swarm: what `volery status`, `fault` and `stop` ask its supervisor."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgpack

from ...errors import BadInput, RunFailed
from ...transport import zenoh_session as zs
from ...transport.keys import CONTROL_CLIENT, Keys
from ..record.run_files import CONTROL_FILE

_TIMEOUT_S = 15.0
_JOIN_TIMEOUT_S = 5.0


def call(folder: Path, request: Mapping[str, Any]) -> Any:
    """Ask the supervisor of the run in a folder.

    Raises:
        BadInput: the run does not run, or the request is refused.
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
    return answer["said"]


def running(runs: Path) -> list[Path]:
    """Folders of the runs that run, the newest last."""
    return sorted(path.parent for path in runs.glob(f"*/{CONTROL_FILE}"))
