"""volery from Python: where an event loop runs already, interrupted, and called with what it does not take."""

from __future__ import annotations

import asyncio
import signal
import subprocess
import sys
import typing
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import volery
from volery.errors import BadInput
from volery.experiments.scenario.load import load_scenario
from volery.experiments.swarm.live_fault_checks import RunState, refuse
from volery.transport.faults import LinkFault

FOREVER = "duration=1000 s"


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs go into a folder of the test."""
    monkeypatch.chdir(tmp_path)


def test_the_functions_say_what_they_take_and_give() -> None:
    """To whoever completes names, checks types or asks for help; the package itself loads none of it beforehand."""
    assert {*volery.__all__, "__version__"} <= set(dir(volery))
    assert volery.__version__.count(".") == 2
    assert typing.get_type_hints(volery.run)["return"].__name__ == "Run"
    light = "import sys, volery; assert not {'pydantic', 'zenoh', 'matplotlib', 'rich'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", light], check=True)
    with pytest.raises(AttributeError, match="has no attribute 'runs'"):
        _ = volery.runs


@pytest.mark.parametrize("engine", ["twin", "zenoh"])
def test_a_run_where_a_loop_runs_already(engine: typing.Literal["twin", "zenoh"]) -> None:
    """As in a notebook; waited for or awaited, it is the same run."""

    async def cell() -> tuple[Any, Any]:
        waited = volery.run("dfa4", engine=engine, pace="lockstep", overrides=["duration=0.5 s"], name="waited")
        awaited = await volery.run_async("dfa4", engine="twin", overrides=["duration=0.5 s"], name="awaited")
        return waited, awaited

    waited, awaited = asyncio.run(cell())
    assert waited.problems == awaited.problems == ()
    assert waited.record.info["wall_s"] > 0.0
    assert waited.samples().estimate.tobytes() == awaited.samples().estimate.tobytes()


def test_a_task_that_is_cancelled_ends_its_run_and_keeps_it() -> None:
    """In the middle of a run that would take hours."""

    async def cell() -> None:
        task = asyncio.create_task(volery.run_async("dfa16", engine="twin", overrides=[FOREVER], name="long"))
        while not Path("runs/long/record.mcap").exists():  # noqa: ASYNC110, ASYNC240 - the run is in another thread
            await asyncio.sleep(0.01)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    asyncio.run(cell())
    run = volery.load("runs/long")
    assert run.record.info["status"] == "finished"
    assert run.record.end_ns is not None
    assert run.record.end_ns < 10**12


def test_an_interrupted_cell_has_what_was_recorded() -> None:
    """Ctrl-C, where a loop runs and volery waits in it, stops the swarm; the program goes on with the run."""
    cell = """
import asyncio, volery
async def cell():
    run = volery.run({"duration": "1000 s", "topology": {"line": 2}, "agents": "beacon"}, name="long")
    print(run.record.end_ns, run.problems)
asyncio.run(cell())
"""
    command = [sys.executable, "-c", cell]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        while not Path("runs/long/control.json").exists():
            assert process.poll() is None
        process.send_signal(signal.SIGINT)
        out, _ = process.communicate()
    assert process.returncode == 0
    end_ns, problems = out.split(maxsplit=1)
    assert int(end_ns) < 10**12
    assert problems == "()\n"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"pace": "fast"}, "run(): pace is 'fast', it must be 'exact' or 'lockstep' or 'realtime'"),
        ({"speed": "2"}, "run(): speed is '2', it must be float or 'max'"),
        ({"speed": -1}, "speed is -1, it must be above 0, or max"),
        ({"name": 3}, "run(): name is 3, it must be str | None"),
        ({"name": "a/b"}, "the run's name 'a/b' must be that of one folder: --runs chooses where it is"),
        ({"name": ".."}, "the run's name '..' must be that of one folder: --runs chooses where it is"),
        ({"overrides": "seed=3"}, "run(): overrides is 'seed=3', it must be Sequence[str]"),
        ({"scenario": 4}, "run(): scenario is 4, it must be str | Path | Mapping[str, Any]"),
        ({"engin": "twin"}, "run() has no argument 'engin' (did you mean 'engine'?)"),
    ],
)
def test_an_argument_that_does_not_fit_is_named(arguments: dict[str, Any], message: str) -> None:
    """With what it may be, before anything is left behind."""
    with pytest.raises((BadInput, TypeError)) as caught:
        volery.run(**{"scenario": "dfa4", **arguments})
    assert str(caught.value) == message
    assert not Path("runs").exists()


def test_a_refused_task_leaves_nothing() -> None:
    """An argument is refused at the call, a scenario when it is awaited."""

    async def cell() -> None:
        with pytest.raises(BadInput, match="pace is 'fast'"):
            volery.run_async("dfa4", pace="fast")  # type: ignore[arg-type, unused-coroutine]
        with pytest.raises(BadInput, match="did you mean 'dfa4'"):
            await volery.run_async("dfa44")

    asyncio.run(cell())
    assert not Path("runs").exists()


OWN = """
from dataclasses import dataclass

import numpy as np

from volery.agents import agent, payloads
from volery.experiments.evaluation.evaluation import Evaluation
from volery.transport.link_models import LatencyModel, LossModel
from volery.units import Metres, Probability
from volery.worlds.world import World

@dataclass(frozen=True)
class Settings:
    noise: Metres = 1.0

class Pond(World):
    Parameters = Settings

    def sensors(self, agent):
        return {"depth": 10.0}

    def measure(self, agent, sensor, index, time_ns):
        return np.array([DEPTH + self.parameters.noise * self.random("depth", agent).normal(index)])

    def truth(self, agent, quantity, time_ns):
        return np.array([DEPTH])

class Mean(Evaluation):
    def central_estimate(self, agent, quantity, index, time_ns):
        return DEPTH

class Diver(agent.Agent):
    evaluation = Mean
    depth = 0.0

    def on_sample(self, sample):
        self.depth += 0.2 * (sample.value[0] - self.depth)
        self.context.report("depth", self.depth, sample.index)
        self.context.broadcast(payloads.encode(self.depth))

    def on_frame(self, frame):
        self.depth += 0.2 * (payloads.decode(frame.payload) - self.depth)

@dataclass(frozen=True)
class Every(LossModel):
    share: Probability = 0.5

    def probability(self, frame):
        return self.share if frame.index % 2 else 0.0

@dataclass(frozen=True)
class Jitter(LatencyModel):
    @property
    def minimum_ns(self):
        return 1_000_000

    def latency_ns(self, frame):
        return 1e6 + 1e6 * frame.uniform()

class Unsaved(Diver):
    def start(self):
        print(LOCK)

class Impossible(Diver):
    @classmethod
    def problems(cls, plan):
        return ["it cannot be"]
"""


@pytest.fixture
def cell(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], dict[str, Any]]:
    """Runs code as a cell of a notebook; what is defined there then."""
    main = vars(sys.modules["__main__"])

    def run(code: str) -> dict[str, Any]:
        defined: dict[str, Any] = {"__name__": "__main__"}
        exec(code, defined)  # noqa: S102 - the test's own code
        for name in defined.keys() - {"__name__", "__builtins__"}:
            monkeypatch.setitem(main, name, defined[name])
        return defined

    return run


def pond(own: dict[str, Any]) -> dict[str, Any]:
    """A scenario in which everything is the notebook's own."""
    return {
        "duration": "1 s",
        "topology": {"complete": 3},
        "agents": own["Diver"],
        "world": {"kind": own["Pond"], "noise": "0.5 m"},
        "links": {"latency": own["Jitter"], "loss": {own["Every"]: {"share": 0.9}}},
        "faults": [{"at": "0.4 s", "where": "all", "set": {"loss": own["Every"]}}],
    }


def test_everything_can_be_the_notebooks_own(cell: Callable[[str], dict[str, Any]]) -> None:
    """Agents, their evaluation, a world, losses and latencies of a cell: over Zenoh as in the twin, and certified."""
    own = cell(f"DEPTH = 3.0\n{OWN}")
    twin = volery.run(pond(own), engine="twin")
    swarm = volery.run(pond(own), pace="lockstep")
    assert swarm.problems == ()
    assert swarm.samples().estimate.tobytes() == twin.samples().estimate.tobytes()
    assert (twin.samples().oracle == 3.0).all()
    assert "kind: __main__:Diver" in (twin.folder / "scenario.yaml").read_text("utf-8")
    assert swarm.verify().lines[0].startswith("certified: 30 estimates and ")


def test_a_cell_that_runs_again_counts(cell: Callable[[str], dict[str, Any]]) -> None:
    """The class that was defined last is the one that runs, and the one before is refused."""
    first = cell(f"DEPTH = 3.0\n{OWN}")
    volery.run("beacons", agents=first["Diver"], world=first["Pond"], engine="twin", overrides=["duration=0.2 s"])
    second = cell(f"DEPTH = 5.0\n{OWN}")
    run = volery.run(pond(second), engine="twin")
    assert (run.samples().truth == 5.0).all()
    with pytest.raises(BadInput, match=r"agents\.kind: __main__:Diver is another object now"):
        volery.run("beacons", agents={"kind": first["Diver"]})


def test_a_sweep_of_the_notebooks_own(cell: Callable[[str], dict[str, Any]]) -> None:
    """Its workers have the code by value; those of a Dask cluster are refused it."""
    own = cell(f"DEPTH = 3.0\n{OWN}")
    over = {"world.noise": ["0.1 m", "2 m"]}
    swept = volery.sweep(pond(own), over, world=own["Pond"], workers=1, overrides=["duration=5 s"])
    small, large = swept.table["depth.truth_error.steady_rms"]
    assert small < large
    assert repr(swept).startswith("Sweep scenario: 2 world.noise, 2 of 2 runs, ")
    with pytest.raises(BadInput, match="--scheduler: __main__:Diver is of this program alone"):
        volery.sweep(pond(own), over, scheduler="tcp://127.0.0.1:1")


@pytest.mark.parametrize(
    ("agents", "message"),
    [
        ("Unsaved", "__main__: Unsaved uses LOCK, which cannot be handed to other processes"),
        ("Impossible", "agents: it cannot be"),
        ("Settings", "Settings.* not a subclass of"),
    ],
)
@pytest.mark.parametrize("engine", ["twin", "zenoh"])
def test_what_is_refused_leaves_nothing(
    cell: Callable[[str], dict[str, Any]], agents: str, message: str, engine: typing.Literal["twin", "zenoh"]
) -> None:
    """Neither a run's folder nor that of all runs."""
    own = cell(f"import threading\nLOCK, DEPTH = threading.Lock(), 3.0\n{OWN}")
    with pytest.raises(BadInput, match=message):
        volery.run(pond(own), agents=own[agents], engine=engine)
    assert not Path("runs").exists()


def test_a_live_fault_brings_no_code(cell: Callable[[str], dict[str, Any]]) -> None:
    """Agents that run have what the plan named; another class of the program is refused."""
    own = cell(f"DEPTH = 3.0\n{OWN}")
    fault = LinkFault("f1", 0, None, (("1", "2"),), {"loss": (own["Every"](),)})
    plan = load_scenario(pond(own)).plan
    now = RunState(plan, "lockstep", 0, {}, {"1", "2", "3"}, set())
    refuse([fault], now)
    with pytest.raises(BadInput, match="__main__:Every is of this program alone"):
        refuse([fault], replace(now, plan=load_scenario("beacons").plan))


def test_code_of_a_function_is_refused() -> None:
    """It has no name by which it could be found."""

    class Inner:
        """An agent of a function."""

    with pytest.raises(BadInput, match=r"agents: .*<locals>.Inner is made in a function: define it at the top"):
        volery.run("beacons", agents=Inner)
