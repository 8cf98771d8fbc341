"""Code of the program that runs goes with its plans, by value; elsewhere it is a module of its own."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass
from inspect import isfunction
from pathlib import Path
from typing import Any

import pytest

from volery.agents.agent import Agent
from volery.agents.code_by_value import PYTHON, OtherPython
from volery.agents.plan import AgentPlan, Plan
from volery.agents.plan_codec import Opaque, decode_plan, encode_plan, named_by_value
from volery.errors import BadInput

LOCK = threading.Lock()
STEP = 3


@dataclass(frozen=True)
class Parameters:
    """Parameters of an agent of the program."""

    law: str = ""


class Mine(Agent):
    """An agent of the program, which uses something else of it."""

    def start(self) -> None:
        """Use a constant."""
        self.step = STEP


class Locked(Agent):
    """An agent that uses what cannot go to other processes."""

    def start(self) -> None:
        """Use a lock."""
        with LOCK:
            pass


def plan(kind: str = "__main__:Mine", law: str = "", parameters: Callable[[str], Any] = Parameters) -> Plan:
    """A plan of one agent."""
    return Plan("some", 1, 10**9, (AgentPlan("1", kind, parameters(law), (), {"1": 0}),), {})


@pytest.fixture(autouse=True)
def _main(monkeypatch: pytest.MonkeyPatch) -> None:
    """The classes of this file as if a script had defined them."""
    main = sys.modules["__main__"]
    for code in (Mine, Parameters, Locked):
        for each in filter(isfunction, vars(code).values()):
            monkeypatch.setattr(each, "__module__", "__main__")
        monkeypatch.setattr(code, "__module__", "__main__")
        monkeypatch.setattr(main, code.__name__, code, raising=False)


ELSEWHERE = """
import sys
from volery.agents.plan_codec import decode_plan, encode_plan
from volery.agents.registry import find
text = sys.stdin.read()
agent = decode_plan(text).agents[0]
mine = find(agent.kind)(None, agent.parameters)
mine.start()
assert agent.kind.startswith("kept_"), agent.kind
print(type(mine).__name__, mine.step, mine.parameters, decode_plan(encode_plan(decode_plan(text))).agents[0] == agent)
"""


def test_another_process_has_the_code_and_hands_it_on(tmp_path: Path) -> None:
    """Class, parameters, and the constant that it uses, where no such module is; also encoded there once more."""
    text = encode_plan(plan(law="__main__:Mine"))
    command = [sys.executable, "-c", ELSEWHERE]
    done = subprocess.run(command, input=text, cwd=tmp_path, capture_output=True, text=True, check=False)
    name, step, parameters, same = done.stdout.split(maxsplit=3) if done.returncode == 0 else (done.stderr, "", "", "")
    assert (name, step, same) == ("Mine", "3", "True\n")
    assert parameters.startswith("Parameters(law='kept_")


def test_readers_load_nothing_of_it() -> None:
    """Names and fields are enough for them, whatever the pickle is."""
    document = json.loads(encode_plan(plan(law="__main__: hello")))
    document["code"]["__main__"] = {"python": "2.7", "pickle": "no pickle"}
    agent = decode_plan(json.dumps(document), only_read=True).agents[0]
    assert agent.kind == "__main__:Mine"
    assert agent.parameters == Opaque("__main__:Parameters", {"law": "__main__: hello"})
    with pytest.raises(OtherPython, match=rf"by value from Python 2\.7, and this is Python {PYTHON}"):
        decode_plan(json.dumps(document))


def test_what_is_named_by_value_is_told() -> None:
    """Texts that name nothing in the program are just texts."""
    assert named_by_value(plan()) == ["__main__:Mine", "__main__:Parameters"]
    assert named_by_value(plan("beacon", "__main__:nothing", str)) == []
    assert "code" not in json.loads(encode_plan(plan("beacon", "", str)))


def test_what_cannot_be_pickled_is_named() -> None:
    """With the class that uses it."""
    message = "__main__: Locked uses LOCK, which cannot be handed to other processes: cannot pickle '_thread.lock'"
    with pytest.raises(BadInput, match=message):
        encode_plan(plan("__main__:Locked"))
