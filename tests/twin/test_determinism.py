"""One seed, one journal: whatever the process, its hash seed or its version of Python; and draws that nobody shifts."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from volery.agents.agent import Agent, Timer
from volery.agents.plan import Plan
from volery.experiments.record.record import Record
from volery.transport.faults import LinkFault, Pause
from volery.transport.latency_settings import Normal, Uniform
from volery.transport.links import LinkSettings
from volery.transport.loss_settings import Bernoulli, GilbertElliott

MS = 1_000_000
SCENARIO = "dfa4"
OVERRIDES = ("duration=1 s", "links.loss=0.2", "faults=[{at: 300 ms, until: 600 ms, cut: 1-2}]")
PROGRAM = """
import sys
from hashlib import sha256
from canonical import canonical
from volery.experiments.scenario.load import load_scenario
from volery.experiments.twin import recorded
for _ in range(int(sys.argv[1])):
    plan = load_scenario(sys.argv[2], sys.argv[3:]).plan
    print(sha256(canonical(recorded(plan))).hexdigest())
"""


def journals(python: str, hash_seed: int, runs: int) -> list[str]:
    """Digests of the canonical journals of runs in a process of its own."""
    path = os.pathsep.join(filter(None, [str(Path(__file__).parent), os.environ.get("PYTHONPATH")]))
    environment = {**os.environ, "PYTHONHASHSEED": str(hash_seed), "PYTHONPATH": path}
    command = [python, "-c", PROGRAM, str(runs), SCENARIO, *OVERRIDES]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    return done.stdout.split()


@pytest.mark.parametrize(("processes", "runs"), [(2, 4), pytest.param(8, 92, marks=pytest.mark.long)])
def test_many_runs_of_one_seed_give_one_journal(processes: int, runs: int) -> None:
    """Byte for byte: in processes with hash seeds of their own, and again and again in one of them."""
    digests = [digest for seed in range(processes) for digest in journals(sys.executable, seed, 1)]
    digests += journals(sys.executable, 1234, runs)
    assert len(digests) == processes + runs
    assert len(set(digests)) == 1
    assert len(digests[0]) == len(sha256().hexdigest())


def test_other_versions_of_python_give_the_same_journal() -> None:
    """Where an interpreter of another version has the packages too; its path is in VOLERY_OTHER_PYTHON."""
    other = os.environ.get("VOLERY_OTHER_PYTHON")
    if not other or shutil.which(other) is None:
        pytest.skip("VOLERY_OTHER_PYTHON names no other interpreter")
    assert journals(other, 5, 1) == journals(sys.executable, 6, 1)


class Counter(Agent):
    """It reports how many threads BLAS may use where it is made, and where it runs."""

    timers_only = True

    def __init__(self, context: Any, parameters: Any) -> None:
        super().__init__(context, parameters)
        self._made = self._threads()

    def start(self) -> None:
        """Set a timer."""
        self.context.set_timer(MS)

    def on_timer(self, timer: Timer) -> None:
        """Report."""
        self.context.report("threads", [self._made, self._threads()], 0)

    def _threads(self) -> float:
        return float(max(pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"))


def test_the_twin_computes_on_one_thread_as_agents_processes_do(
    plan_of: Any, twin_run: Callable[[Plan], Record]
) -> None:
    """Bits of large products depend on the number of threads; afterwards there are as many as before."""
    with threadpool_limits(2, user_api="blas"):
        record = twin_run(plan_of([("1", "2")], Counter))
        assert max(pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas") == 2
    told = [estimate.value for batch in record.batches.values() for estimate in batch.estimates]
    assert told == [[1.0, 1.0], [1.0, 1.0]]


def frame_fates(record: Record, link: tuple[str, str]) -> list[Any]:
    """When the frames of a link started and what became of them, as the sender's draws say."""
    return [sent[1:] for sent in record.batches[link[0], 0].sent if sent.target == link[1]]


@pytest.fixture
def lossy(plan_of: Any, talker: type[Agent]) -> Callable[..., Plan]:
    """A plan of talkers, whose frames start whatever comes in, on links that draw all they can."""
    settings = LinkSettings(
        rate=1e6,
        loss=(Bernoulli(0.2), GilbertElliott(0.1, 0.3)),
        corruption=(Bernoulli(0.1),),
        duplication=0.5,
        latency=Normal(9 * MS, 1 * MS),
    )

    def plan(*edges: tuple[str, str]) -> Plan:
        made: Plan = plan_of(list(edges), talker, settings, (), 800)
        return made

    return plan


def test_another_agent_shifts_no_draw(lossy: Callable[..., Plan], twin_run: Callable[[Plan], Record]) -> None:
    """Frames of links that were there before start, fare and arrive as before; their payloads may differ in size."""
    before, after = twin_run(lossy(("1", "2"), ("2", "3"))), twin_run(lossy(("1", "2"), ("2", "3"), ("3", "4")))
    for link in (("1", "2"), ("2", "1")):
        assert frame_fates(before, link) == frame_fates(after, link)
        assert len(frame_fates(before, link)) > 30
    assert {story[-1] for story in frame_fates(after, ("1", "2"))} == {0, 1}


def test_a_fault_shifts_no_draw_of_another_link(lossy: Callable[..., Plan], twin_run: Callable[[Plan], Record]) -> None:
    """Other links fare as before; and so does the touched link's loss, where the fault is of its latency."""
    plan = lossy(("1", "2"), ("2", "3"))
    both = (("2", "3"), ("3", "2"))
    faults = (
        LinkFault("t1", 200 * MS, 400 * MS, both, {"latency": Uniform(1 * MS, 2 * MS), "loss": (Bernoulli(0.9),)}),
        LinkFault("t2", 500 * MS, None, both, {"latency": Uniform(1 * MS, 2 * MS)}),
        Pause("t3", 300 * MS, 350 * MS, "3"),
    )
    before, after = twin_run(plan), twin_run(replace(plan, faults=faults))
    assert frame_fates(before, ("1", "2")) == frame_fates(after, ("1", "2"))
    assert frame_fates(before, ("2", "3")) != frame_fates(after, ("2", "3"))
