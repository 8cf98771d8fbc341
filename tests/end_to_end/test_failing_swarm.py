"""Agents that fail in processes of their own say what they say in the twin."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from volery.agents.plan import AgentPlan, Plan
from volery.errors import RunFailed
from volery.experiments.twin import recorded
from volery.transport.faults import Kill
from volery.transport.links import LinkSettings

from .conftest import MS, run_swarm

MODULE = """
import sys
from dataclasses import dataclass

from volery.agents.agent import Agent


@dataclass(frozen=True)
class Where:

    method: str


class Failing(Agent):

    Parameters = Where

    def __init__(self, context, parameters):
        super().__init__(context, parameters)
        self._perhaps("__init__")

    def _perhaps(self, method):
        if self.context.name == "2" and self.parameters.method == method:
            sys.exit("of its own accord")

    def start(self):
        self.context.set_timer(self.context.now_ns)

    def on_timer(self, timer):
        if timer.index == 3:
            self._perhaps("on_timer")
        self.context.broadcast(b"x")
        self.context.set_timer(timer.time_ns + 5 * 1_000_000, index=timer.index + 1)

    def save(self):
        return [1]

    def restore(self, state):
        self._perhaps("restore")
"""
"""Two agents that send to each other, of which 2 fails in a method."""


@pytest.mark.parametrize("method", ["__init__", "on_timer", "restore"])
def test_the_sentence_of_a_failed_agent_is_that_of_the_twin(
    method: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the lines of the user's code; an agent that fails when it returns has not restarted."""
    module = f"failing_in_{method.strip('_')}"
    (tmp_path / f"{module}.py").write_text(MODULE, "utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    where = import_module(module).Where(method)
    agents = tuple(AgentPlan(me, f"{module}:Failing", where, (you,), {"1": 1, "2": 1}) for me, you in ("12", "21"))
    links = {("1", "2"): LinkSettings(), ("2", "1"): LinkSettings()}
    kill = Kill("t1", 30 * MS, 40 * MS, "2", keep_state=True)
    plan = Plan("failing", 1, 60 * MS, agents, links, faults=(kill,))
    with pytest.raises(RunFailed) as raised:
        recorded(plan)
    assert str(raised.value).startswith(f"agent 2 failed in {method}: SystemExit: of its own accord\n  File ")
    record, ending = run_swarm(plan)
    assert ending.problems == (str(raised.value),)
    assert [event["event"] for event in record.events if event["event"] == "restarted"] == []


TALKATIVE = """
import warnings

import volery
from volery.agents.agent import Agent


class Talkative(Agent):

    def start(self):
        print("starts")
        self.context.set_timer(0)

    def on_timer(self, timer):
        warnings.warn("rings")
        self.context.broadcast(b"x")

    def on_frame(self, frame):
        print("hears", frame.source)


fields = {"duration": "60 ms", "topology": {"line": 2}, "links": {"latency": "5 ms"}}
assert not volery.run(fields, agents=Talkative).problems
"""


def test_what_agents_print_is_printed_once(tmp_path: Path) -> None:
    """In real time agents rehearse before the run, on frames of their own; nobody hears of that."""
    (tmp_path / "talkative.py").write_text(TALKATIVE, "utf-8")
    command = [sys.executable, "talkative.py"]
    said = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert (said.stdout.count("starts"), said.stdout.count("hears")) == (2, 2)
    assert said.stderr.count("UserWarning: rings") == 2
