"""How the command line is used: help, mistakes, and what it loads."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from volery.experiments.cli.app import app

from .conftest import Volery

SCENARIO_COMMANDS = ["list", "show", "new", "validate", "links"]
LIVE_COMMANDS = ["status", "watch", "fault", "stop"]
RESULT_COMMANDS = ["metrics", "evaluate", "compare", "plot", "export", "verify", "recover"]
COMMANDS = [*SCENARIO_COMMANDS, "run", "sweep", *LIVE_COMMANDS, *RESULT_COMMANDS]
FAULTS = ["cut", "restore", "set", "kill", "restart", "pause", "clear"]


def python_m_volery(*words: str) -> subprocess.CompletedProcess[str]:
    """The command line as a process of its own, in the folder of the test."""
    return subprocess.run([sys.executable, "-m", "volery", *words], capture_output=True, text=True, check=False)


def test_help_names_every_command(volery: Volery) -> None:
    """`volery --help` lists all commands, and so does `volery` alone."""
    said = volery("--help")
    assert said.code == 0
    assert said.error == ""
    assert {line.split()[1] for line in said.out.splitlines() if line.startswith("│ ")} >= set(COMMANDS)
    assert volery() == said


@pytest.mark.parametrize("words", [[name] for name in COMMANDS] + [["fault", name] for name in FAULTS], ids=" ".join)
def test_every_command_has_help(volery: Volery, words: list[str]) -> None:
    """Each command says how it is used and what for."""
    said = volery(*words, "--help")
    assert said.code == 0
    usage, _, purpose = said.out.splitlines()[:3]
    assert usage.startswith(f"Usage: volery {' '.join(words)}")
    assert purpose.strip()


@pytest.mark.parametrize("name", COMMANDS)
def test_examples_in_the_help_are_valid(volery: Volery, name: str) -> None:
    """Each example of a command, or of a fault, is a command line that volery can read."""
    shown = volery(name, "--help").out
    lines = re.findall(r"^ *(volery .*)$", shown, re.MULTILINE) + re.findall(r"Example: (volery .*?)\. *│", shown)
    assert lines or name in ("list", "watch")
    for line in lines:
        app.parse_args(shlex.split(line.partition(">")[0])[1:], exit_on_error=False, print_error=False)


@pytest.mark.parametrize(
    ("word", "needed", "most"),
    [
        ("--help", {"volery.experiments.cli.app", "volery.experiments.cli.output"}, 260),
        ("list", {"volery.experiments.cli.list_command", "volery.experiments.scenario.library"}, 280),
    ],
)
def test_what_only_prints_loads_little(word: str, needed: set[str], most: int) -> None:
    """`volery --help` and `volery list` are quick: no library of scenarios, runs or figures is loaded for them."""
    heavy = ["numpy", "scipy", "zenoh", "matplotlib", "duckdb", "pydantic", "networkx", "mcap", "markdown_it"]
    code = f"import sys; from volery.experiments.cli.app import main; main([{word!r}]); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = done.stdout.splitlines()[-1].split()
    assert needed <= set(loaded)
    assert set(heavy).isdisjoint(loaded)
    assert len(loaded) <= most


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        (["rum", "dfa4"], 'Did you mean "run"?'),
        (["fault", "cutt", "1-2"], 'Did you mean "cut"?'),
        (["run", "dfa4", "--enginee", "twin"], "Did you mean --engine?"),
        (["run", "dfa4", "--engine", "twins"], '"zenoh", "twin"'),
        (["run"], "SCENARIO"),
        (["metrics"], "RUN"),
        (["run", "dfa4", "--speed", "fast"], "--speed"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_a_slip_of_the_pen_is_bad_input(volery: Volery, words: list[str], hint: str) -> None:
    """Unknown commands and options end with exit code 2, say what was probably meant, and leave nothing behind."""
    said = volery(*words)
    assert said.code == 2
    assert hint in " ".join(said.error.replace("│", "").split())
    assert sorted(Path().iterdir()) == [Path("short.yaml")]


def test_the_process_ends_with_the_exit_code(volery: Volery) -> None:
    """`python -m volery` prints errors to the standard error, without a traceback, and ends with their exit code."""
    assert volery is not None
    done = python_m_volery("show", "dfa16-losy")
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith("error: there is no scenario 'dfa16-losy' (did you mean 'dfa16-lossy'?)")
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize("words", [["metrics"], ["run", "dfa4", "--engine", "twin", "--name"], ["show"]])
def test_names_that_are_too_long_for_a_file_are_bad_input(volery: Volery, words: list[str]) -> None:
    """Of scenarios, runs and folders: a sentence, and no traceback."""
    said = volery(*words, "a" * 300)
    assert said.code == 2
    assert "bytes: it may have at most" in said.error or "is too long for a file" in said.error
