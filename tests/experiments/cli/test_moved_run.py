"""A run's folder explains itself: elsewhere and without the sources it was made with, everything can still be said."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import volery

AGENT = """\
from dataclasses import dataclass
from volery.agents import agent, payloads
from volery.experiments.evaluation.evaluation import Evaluation

@dataclass(frozen=True)
class Settings:
    rate: float = 20.0

class Mean(Evaluation):
    def central_estimate(self, agent, quantity, index, time_ns):
        return 2.0

class Talker(agent.Agent):
    Parameters = Settings
    timers_only = True
    evaluation = Mean

    def start(self):
        self.value = float(self.context.name)
        self.context.set_timer(0)

    def on_frame(self, frame):
        self.value += (payloads.decode(frame.payload) - self.value) / 3

    def on_timer(self, timer):
        from helper import LATER  # loaded by nobody before an agent runs

        self.context.report("number", self.value, timer.index)
        for other in self.context.neighbours:
            self.context.send(other, payloads.encode(self.value))
        self.context.set_timer(self.context.now_ns + LATER, index=timer.index + 1)
"""
SCENARIO = {
    "name": "talk",
    "duration": "1 s",
    "topology": {"line": 3},
    "agents": {"kind": "talker:Talker", "rate": 10.0},
    "links": {"latency": "2 ms", "loss": 0.2},
}
SCRIPT = f"""\
{AGENT}
import sys, volery
print(volery.run({SCENARIO}, agents=Talker, engine=sys.argv[1], pace="lockstep", name="run").problems)
"""
LOADED = (
    "import volery; run = volery.load('{}'); print(run.samples('number').oracle_error.mean(), len(run.frames['fate']))"
)


def call(*words: str, folder: Path, code: int = 0) -> str:
    """What Python prints that is called with these words in a folder, and knows no other folder."""
    environment = {**os.environ, "PYTHONPATH": str(Path(volery.__file__).parents[1])}
    done = subprocess.run(
        [sys.executable, *words], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == code, done.stderr
    return done.stdout


@pytest.fixture(params=["twin", "zenoh"])
def run(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """The folder of a run with an agent of somebody's own, in `home`, where its sources are."""
    home = tmp_path / "home"
    home.mkdir()
    (home / "talker.py").write_text(AGENT, "utf-8")
    (home / "helper.py").write_text("LATER = 50_000_000\n", "utf-8")
    (home / "room.yaml").write_text(json.dumps(SCENARIO), "utf-8")
    words = ["--engine", request.param, "--name", "run", "--no-figures"]
    words += ["--pace", "lockstep"] if request.param == "zenoh" else []
    call("-m", "volery", "run", "room.yaml", *words, folder=home)
    return home / "runs" / "run"


def test_a_moved_run_without_its_sources_can_be_read_and_verified(run: Path, tmp_path: Path) -> None:
    """By every command, in a process of its own, in an empty folder; nothing but the folder is needed."""
    there = tmp_path / "elsewhere" / "run"
    there.parent.mkdir()
    before = json.loads((run / "metrics.json").read_text("utf-8"))
    shutil.move(run, there)
    shutil.rmtree(tmp_path / "home")
    nowhere = tmp_path / "nowhere"
    nowhere.mkdir()

    def said(*words: str) -> str:
        return call("-m", "volery", words[0], str(there), *words[1:], folder=nowhere)

    assert json.loads(said("metrics", "--json"))["run"] == before
    assert said("plot", "--format", "png").count(".png") == 5
    assert said("plot", "--space-time", "--format", "png").endswith("space-time.png\n")
    assert len(said("export", "--csv", "--npz").split()) == 3
    assert "delivered" in said("trace")
    assert "run" in said("compare", str(there))
    error, frames = call("-c", LOADED.format(there), folder=nowhere).split()
    assert float(error) > 0
    assert int(frames) == 80
    assert said("verify").startswith("certified: 60 estimates and ")
    shutil.rmtree(there / "figures")
    (there / "evaluation.npz").unlink()
    said("evaluate")
    assert json.loads((there / "metrics.json").read_text("utf-8")) == before
    assert not list(nowhere.iterdir())


def test_a_replay_has_the_kept_sources_and_says_what_has_changed_since(run: Path) -> None:
    """On the disk, and in the folder itself; what is kept there counts."""
    home = run.parents[1]
    kept = json.loads((run / "sources.json").read_text("utf-8"))
    assert {"talker.py", "helper.py"} == set(kept)
    assert (run / "sources" / "talker.py").read_text("utf-8") == AGENT
    (home / "helper.py").write_text("LATER = 70_000_000\n", "utf-8")
    certified, changed = call("-m", "volery", "verify", "run", folder=home).splitlines()
    assert certified.startswith("certified: 60 estimates")
    assert changed == f"{home / 'helper.py'} has changed since the run, which kept it as it was"
    (run / "sources" / "helper.py").write_text("LATER = 70_000_000\n", "utf-8")
    departs = call("-m", "volery", "verify", "run", folder=home, code=3).splitlines()
    assert departs[0].startswith("not certified")
    assert departs[-1] == f"{Path('runs/run/sources/helper.py')} is not what the run kept"


@pytest.mark.parametrize("engine", ["twin", "zenoh"])
def test_an_agent_of_the_script_itself_is_kept_too(engine: str, tmp_path: Path) -> None:
    """Its processes and the replay have it by value; the script, which need not guard its calls, is kept for people."""
    (tmp_path / "script.py").write_text(SCRIPT, "utf-8")
    (tmp_path / "helper.py").write_text("LATER = 50_000_000\n", "utf-8")
    assert call("script.py", engine, folder=tmp_path) == "()\n"
    (tmp_path / "script.py").unlink()
    folder = tmp_path / "runs" / "run"
    assert (folder / "sources" / "__main__.py").read_text("utf-8") == SCRIPT
    assert call("-m", "volery", "verify", "run", folder=tmp_path).startswith("certified: 60 estimates and ")
    plan = json.loads((folder / "plan.json").read_text("utf-8"))
    plan["code"]["__main__"]["python"] = "3.99"
    (folder / "plan.json").write_text(json.dumps(plan), "utf-8")
    assert call("-m", "volery", "verify", "run", folder=tmp_path, code=3).startswith("not comparable here: ")
    assert call("-c", LOADED.format("runs/run"), folder=tmp_path).split()[1] == "80"


def test_a_run_tells_its_command_and_commit(run: Path, tmp_path: Path) -> None:
    """The commit of the user's folder where there is one, and whether files differ from it; else none."""
    info = json.loads((run / "run.json").read_text("utf-8"))
    assert info["command"][1:3] == ["run", "room.yaml"]
    assert info["git"] is None
    home = tmp_path / "home"
    who = ["-c", "user.name=a", "-c", "user.email=a@example.org"]
    for words in (["init", "-q"], ["add", "talker.py"], [*who, "commit", "-qm", "first"]):
        subprocess.run(["git", *words], cwd=home, check=True)
    commit = subprocess.run(["git", "rev-parse", "HEAD"], cwd=home, capture_output=True, text=True, check=True).stdout
    call("-m", "volery", "run", "room.yaml", "--engine", "twin", "--no-figures", "--name", "again", folder=home)
    info = json.loads((home / "runs" / "again" / "run.json").read_text("utf-8"))
    assert info["git"] == {"commit": commit.strip(), "dirty": True}
