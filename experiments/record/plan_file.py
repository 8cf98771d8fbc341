"""The plan in a run's folder: plan.json, and large arrays in files of their own, named by their hashes."""

from __future__ import annotations

from hashlib import sha256
from pathlib import Path

from ...agents.plan import Plan
from ...agents.plan_codec import decode_plan, encode_plan
from ...errors import BadInput
from ..whole_files import write_whole
from .run_files import PLAN_FILE, SCENARIO_FILE

_OLDER = (
    "is of an older form, which keeps its scenario and no plan: read it with the volery that made it, "
    "commit 93240e7 or before"
)


def write_plan(folder: Path, plan: Plan) -> None:
    """Leave a plan in a folder.

    Raises:
        BadInput: a value in it has no encoding.
    """

    def store(data: bytes) -> str:
        name = f"plan-{sha256(data).hexdigest()[:16]}.bin"
        write_whole(folder / name, data)
        return name

    write_whole(folder / PLAN_FILE, encode_plan(plan, store))


def read_plan(folder: Path, *, only_read: bool = False) -> Plan:
    """The plan in a run's folder; with `only_read` nothing outside volery is imported for it.

    Raises:
        BadInput: none there, damaged, or of an older form.
        OtherPython: it has code by value from another version of Python.
    """

    def fetch(name: str) -> bytes:
        data = (folder / name).read_bytes()
        if sha256(data).hexdigest()[:16] not in name:
            raise BadInput(f"{folder / name} is damaged: its hash is not the one that {PLAN_FILE} names")
        return data

    path = folder / PLAN_FILE
    if not path.exists() and (folder / SCENARIO_FILE).exists():
        raise BadInput(f"{folder} {_OLDER}")
    try:
        return decode_plan(path.read_text("utf-8"), fetch, only_read=only_read)
    except OSError as error:
        raise BadInput(f"{error.filename} cannot be read: {error.strerror}") from error
    except BadInput as error:
        raise type(error)(f"{path}: {error}") from error
