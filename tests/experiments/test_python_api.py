"""volery from Python: where an event loop runs already, interrupted, and called with what it does not take."""

from __future__ import annotations

import asyncio
import signal
import subprocess
import sys
import typing
from pathlib import Path
from typing import Any

import pytest

import volery
from volery.errors import BadInput

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
    cell = f"""
import asyncio, volery
async def cell():
    run = volery.run("dfa4", overrides=["{FOREVER}"], name="long")
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
        ({"pace": "fast"}, "run(): pace is 'fast', it must be 'realtime' or 'lockstep'"),
        ({"speed": "2"}, "run(): speed is '2', it must be float"),
        ({"speed": -1}, "speed is -1, it must be above 0"),
        ({"name": 3}, "run(): name is 3, it must be str | None"),
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
