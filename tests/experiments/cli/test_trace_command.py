"""`volery trace`: filters, limits, JSON, and what it says where there is nothing."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from .conftest import Volery


def test_lost_frames_of_a_link(volery: Volery, own_run: Path) -> None:
    """Only lines of that link, that fate and that span; the cut holds from 0.3 to 0.5 s."""
    assert own_run.is_dir()
    said = volery("trace", "last", "--link", "1-2", "--fate", "cut", "--from", "0.4s", "--until", "0.5s")
    lines = said.out.splitlines()
    assert said.code == 0
    assert {line.split()[-1] for line in lines} == {"cut"}
    assert {line.split()[2] for line in lines} == {"1→2", "2→1"}
    assert all(0.4 <= float(line.split()[0]) < 0.5 for line in lines)


def test_limit_keeps_the_first_lines_and_says_how_many_there_are(volery: Volery, own_run: Path) -> None:
    """The rest is counted beside the output."""
    assert own_run.is_dir()
    everything = volery("trace", "last").out.splitlines()
    said = volery("trace", "last", "--limit", "3")
    assert said.out.splitlines() == everything[:3]
    assert said.error.strip() == f"… and {len(everything) - 3:,} more lines"


def test_json_lines_hold_the_whole_story(volery: Volery, own_run: Path) -> None:
    """An object a line: faults with what they do, frames with all their times in nanoseconds."""
    assert own_run.is_dir()
    values = [json.loads(line) for line in volery("trace", "last", "--agent", "3", "--json").out.splitlines()]
    assert values
    assert {value["what"] for value in values} == {"frame"}  # the cut of 1-2 is none of its business
    assert all("3" in (value["source"], value["target"]) for value in values)
    assert all(value["due_ns"] >= value["start_ns"] + value["airtime_ns"] for value in values)
    faults = [json.loads(line) for line in volery("trace", "last", "--link", "1>2", "--json").out.splitlines()]
    assert [value["does"] for value in faults if value["what"] == "fault"] == ["begins", "ends"]


def test_nothing_found(volery: Volery, own_run: Path) -> None:
    """No line, a word on what to do, and no error."""
    assert own_run.is_dir()
    said = volery("trace", "last", "--fate", "collision")
    assert (said.code, said.out) == (0, "")
    assert "leave out a filter" in said.error


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--fate", "los"], "--fate los: there is none (did you mean 'lost'?)"),
        (["--link", "1-9"], "there is no agent '9'"),
        (["--agent", "1,44"], "--agent 44: there is none (did you mean '4'?)"),
        (["--from", "2 s"], "--from 2 s: the run ends at 1 s"),
        (["--from", "0.5 s", "--until", "0.5 s"], "--until 0.5 s is not after --from 0.5 s"),
        (["--until", "3"], "--until: '3' is not a quantity here: write a number and one of ns"),
        (["--limit", "0"], "--limit 0: at least one line"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_bad_input(volery: Volery, own_run: Path, words: list[str], message: str) -> None:
    """Exit code 2, the value, the place and the remedy."""
    assert own_run.is_dir()
    said = volery("trace", "last", *words)
    assert said.code == 2
    assert message in said.error


def test_reader_that_has_enough(own_run: Path) -> None:
    """`volery trace last --json | head -1` ends quietly, as far as it got."""
    assert own_run.is_dir()
    command = [sys.executable, "-m", "volery", "trace", "last", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert json.loads(process.stdout.readline())
        process.stdout.close()
        assert process.stderr.read() == b""
        assert process.wait() == 0
