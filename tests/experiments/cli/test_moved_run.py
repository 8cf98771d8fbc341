"""A run's folder explains itself: elsewhere and without the sources it was made with, everything can still be said."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import volery as package
from volery.experiments.record.machine import git_state

from .conftest import Volery

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
COMMANDS = """\
import contextlib, io, json, sys
from volery.experiments.cli.app import main

said = []
for words in json.load(sys.stdin):
    with contextlib.redirect_stdout(io.StringIO()) as out:
        code = exec(words[1]) if words[0] == "python" else main(words)
    said.append((code or 0, out.getvalue()))
    assert words[0] == "evaluate" or "talker" not in sys.modules, f"{words} has imported the agent"
print(json.dumps(said))
"""
LOADED = (
    "import volery; run = volery.load('{}'); print(run.samples('number').oracle_error.mean(), len(run.frames['fate']))"
)


ENGINES = [pytest.param("twin", marks=pytest.mark.long), "zenoh"]
OTHER_PYTHON = """\
import json, pathlib
path = pathlib.Path("runs/run/plan.json")
plan = json.loads(path.read_text("utf-8"))
plan["code"]["__main__"]["python"] = "3.99"
path.write_text(json.dumps(plan), "utf-8")
"""


def call(*words: str, folder: Path, told: str = "") -> str:
    """What Python prints that is called with these words in a folder, and knows no other folder."""
    environment = {**os.environ, "PYTHONPATH": str(Path(package.__file__).parents[1])}
    done = subprocess.run(
        [sys.executable, *words], cwd=folder, env=environment, input=told, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def commands(*each: tuple[str, ...], folder: Path) -> list[tuple[int, str]]:
    """Exit code and output of commands, one after the other in one process of their own in a folder."""
    said = json.loads(call("-c", COMMANDS, folder=folder, told=json.dumps(each)))
    return [(code, out) for code, out in said]


def made(home: Path, engine: str) -> Path:
    """The folder of a run with an agent of somebody's own, made in `home`, where its sources are."""
    home.mkdir()
    (home / "talker.py").write_text(AGENT, "utf-8")
    (home / "helper.py").write_text("LATER = 50_000_000\n", "utf-8")
    (home / "room.yaml").write_text(json.dumps(SCENARIO), "utf-8")
    words = ["--engine", engine, "--name", "run", "--no-figures"]
    words += ["--pace", "lockstep"] if engine == "zenoh" else []
    call("-m", "volery", "run", "room.yaml", *words, folder=home)
    return home / "runs" / "run"


@pytest.mark.parametrize("engine", ENGINES)
def test_a_moved_run_without_its_sources_can_be_read_and_verified(engine: str, tmp_path: Path) -> None:
    """By every command, in an empty folder; nothing but the folder is needed, and readers import no agent."""
    run = made(tmp_path / "home", engine)
    before = json.loads((run / "metrics.json").read_text("utf-8"))
    info = json.loads((run / "run.json").read_text("utf-8"))
    assert info["command"][1:3] == ["run", "room.yaml"]
    assert info["git"] is None
    there = tmp_path / "elsewhere" / "run"
    there.parent.mkdir()
    shutil.move(run, there)
    shutil.rmtree(tmp_path / "home")
    nowhere = tmp_path / "nowhere"
    nowhere.mkdir()
    codes, (metrics, figures, space_time, exported, trace, compared, loaded, verified) = zip(
        *commands(
            ("metrics", str(there), "--json"),
            ("plot", str(there), "--format", "png"),
            ("plot", str(there), "--space-time", "--format", "png"),
            ("export", str(there), "--csv", "--npz"),
            ("trace", str(there)),
            ("compare", str(there), str(there)),
            ("python", LOADED.format(there)),
            ("verify", str(there)),
            folder=nowhere,
        ),
        strict=True,
    )
    assert not any(codes)
    assert json.loads(metrics)["run"] == before
    assert figures.count(".png") == 5
    assert space_time.endswith("space-time.png\n")
    assert len(exported.split()) == 3
    assert "delivered" in trace
    assert "run" in compared
    error, frames = loaded.split()
    assert float(error) > 0
    assert int(frames) == 80
    assert verified.startswith("certified: 60 estimates and ")
    (there / "evaluation.npz").unlink()
    [(code, _)] = commands(("evaluate", str(there)), folder=nowhere)
    assert code == 0
    assert json.loads((there / "metrics.json").read_text("utf-8")) == before
    assert not list(nowhere.iterdir())


def test_a_replay_has_the_kept_sources_and_says_what_has_changed_since(tmp_path: Path) -> None:
    """On the disk, and in the folder itself; what is kept there counts. Processes of agents tell what they loaded."""
    home = tmp_path / "home"
    run = made(home, "zenoh")
    kept = json.loads((run / "sources.json").read_text("utf-8"))
    assert {"talker.py", "helper.py"} == set(kept)
    assert (run / "sources" / "talker.py").read_text("utf-8") == AGENT
    (home / "helper.py").write_text("LATER = 70_000_000\n", "utf-8")
    damage = "import pathlib; pathlib.Path('runs/run/sources/helper.py').write_text('LATER = 70_000_000')"
    (code, said), _, (departed, differs) = commands(
        ("verify", "run"), ("python", damage), ("verify", "run"), folder=home
    )
    certified, changed = said.splitlines()
    assert code == 0
    assert certified.startswith("certified: 60 estimates")
    assert changed == f"{home / 'helper.py'} has changed since the run, which kept it as it was"
    assert departed == 3
    assert differs.startswith("not certified")
    assert differs.splitlines()[-1] == f"{Path('runs/run/sources/helper.py')} is not what the run kept"


@pytest.mark.parametrize("engine", ENGINES)
def test_an_agent_of_the_script_itself_is_kept_too(engine: str, tmp_path: Path) -> None:
    """Its processes and the replay have it by value; the script, which need not guard its calls, is kept for people."""
    (tmp_path / "script.py").write_text(SCRIPT, "utf-8")
    (tmp_path / "helper.py").write_text("LATER = 50_000_000\n", "utf-8")
    assert call("script.py", engine, folder=tmp_path) == "()\n"
    (tmp_path / "script.py").unlink()
    folder = tmp_path / "runs" / "run"
    assert (folder / "sources" / "__main__.py").read_text("utf-8") == SCRIPT
    (code, certified), _, (refused, incomparable), (_, loaded) = commands(
        ("verify", "run"),
        ("python", OTHER_PYTHON),
        ("verify", "run"),
        ("python", LOADED.format("runs/run")),
        folder=tmp_path,
    )
    assert (code, refused) == (0, 3)
    assert certified.startswith("certified: 60 estimates and ")
    assert incomparable.startswith("not comparable here: ")
    assert loaded.split()[1] == "80"


def test_a_run_tells_its_commit(volery: Volery) -> None:
    """The commit of the user's folder, and whether files differ from it, of which the run's own are some."""
    who = ["-c", "user.name=a", "-c", "user.email=a@example.org"]
    for words in (["init", "-q"], ["add", "short.yaml"], [*who, "commit", "-qm", "first"]):
        subprocess.run(["git", *words], check=True)
    commit = subprocess.run(["git", "rev-parse", "HEAD"], capture_output=True, text=True, check=True).stdout.strip()
    assert git_state(Path.cwd()) == {"commit": commit, "dirty": False}
    assert volery("run", "short.yaml", "--engine", "twin", "--no-figures", "--name", "run").code == 0
    info = json.loads(Path("runs/run/run.json").read_text("utf-8"))
    assert info["git"] == {"commit": commit, "dirty": True}
