"""status, watch, fault, stop: what they ask of the supervisor, whom they ask, and what they say."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from volery.errors import BadInput
from volery.experiments.cli import live_commands as cli_live
from volery.experiments.scenario.expansion import parse_fault
from volery.experiments.scenario.fault_places import Places
from volery.experiments.swarm import running_swarm
from volery.transport.faults import ClockFault, Fault, Hog, Kill, LinkFault, Pause, SensorFault

from ...surroundings import build_world as build
from .conftest import Volery

STATUS = {
    "time_s": 1.25,
    "duration_s": 60.0,
    "agents": 4,
    "alive": ["1", "2", "4"],
    "frames": 1234,
    "lost": 56,
    "discarded": {"queue": 8, "refused": 1},
    "late": 7,
    "disagreement": None,
    "faults": {"f1": "kill 3"},
}
PLACES = Places(
    [("3", "7"), ("3", "5")],
    {"ends": ("5", "7")},
    world=build({"kind": "plane", "altitude": "0.2 m"}, {name: (float(name), 0.0) for name in "357"}, 1),
)
LASTING_NS = 10_000_000_000


class Supervisor:
    """Stands in for the supervisor of every run: notes what is asked, answers with the status."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, Mapping[str, Any]]] = []
        self.ends_after = 0

    def __call__(self, folder: Path, request: Mapping[str, Any]) -> Any:
        """Answer one request; the run ends with the last one that is expected."""
        self.asked.append((folder.name, request))
        if len(self.asked) == self.ends_after:
            (folder / "control.json").unlink()
        return STATUS if request == {"do": "status"} else "done"


@pytest.fixture
def supervisor(volery: Volery, monkeypatch: pytest.MonkeyPatch) -> Supervisor:
    """Two swarms run, `first` and `second`; a third, `stale`, was killed and left its control file."""
    assert volery is not None
    gone = 2**22 + 1  # above the largest process id of Linux
    for number, (name, pid) in enumerate([("second", os.getpid()), ("first", os.getpid()), ("stale", gone)]):
        folder = Path("runs") / name
        folder.mkdir(parents=True)
        (folder / "scenario.yaml").touch()
        os.utime(folder / "scenario.yaml", ns=(1000 - number, 1000 - number))
        (folder / "run.json").write_text(json.dumps({"status": "running", "pid": pid}), "utf-8")
        (folder / "control.json").touch()
    found = Supervisor()
    monkeypatch.setattr(running_swarm, "call", found)
    monkeypatch.setattr(cli_live, "_ASK_EVERY_S", 0.0)
    return found


def asked_for(supervisor: Supervisor, number: int = 0) -> tuple[Fault, ...]:
    """The faults that the supervisor would read from a request."""
    return parse_fault(supervisor.asked[number][1]["fault"], "f1", PLACES, LASTING_NS)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("cut 3-7", LinkFault("f1", 0, None, (("3", "7"), ("7", "3")), {"cut": True})),
        ("cut 3>7 --for 2s", LinkFault("f1", 0, 2_000_000_000, (("3", "7"),), {"cut": True})),
        ("hold 3>7 --for 2s", LinkFault("f1", 0, 2_000_000_000, (("3", "7"),), {"hold": True})),
        ("partition isolate 7", LinkFault("f1", 0, None, (("3", "7"), ("7", "3")), {"cut": True})),
        ("partition 3,5 rest --for 1s", LinkFault("f1", 0, 10**9, (("3", "7"), ("7", "3")), {"cut": True})),
        ("kill 5 --for 0.5s", Kill("f1", 0, 500_000_000, "5")),
        ("kill 5 --keep-state", Kill("f1", 0, None, "5", keep_state=True)),
        ("kill 5", Kill("f1", 0, None, "5")),
        ("pause 5 --for 20ms", Pause("f1", 0, 20_000_000, "5")),
        ("hog 5", Hog("f1", 0, None, "5", 1.0)),
        ("hog 5 --share 0.5 --for 1s", Hog("f1", 0, 10**9, "5", 0.5)),
        ("clock 5 --offset=-20ms", ClockFault("f1", 0, None, "5", -20_000_000, 0)),
        ("clock 5 --offset 1ms --drift 50ppm --for 1s", ClockFault("f1", 0, 10**9, "5", 1_000_000, 50_000)),
        ("sensor 5.distance failed", SensorFault("f1", 0, None, "5", "distance", "failed")),
        ("sensor 5.distance bias=-0.1 --for 1s", SensorFault("f1", 0, 10**9, "5", "distance", "bias", (-0.1,))),
        (
            "sensor 5.distance spikes.size=0.5 spikes.probability=0.1",
            SensorFault("f1", 0, None, "5", "distance", "spikes", (0.5,), 0.1),
        ),
    ],
)
def test_faults_are_asked_for_as_in_a_timeline(
    volery: Volery, supervisor: Supervisor, words: str, expected: Fault
) -> None:
    """What the command sends is the fault that its words say, once the supervisor reads it."""
    said = volery("fault", *words.split())
    assert (said.code, said.out) == (0, "done\n")
    ((run, request),) = supervisor.asked
    assert (run, request["do"]) == ("second", "inject")
    assert asked_for(supervisor) == (expected,)


def test_many_places_and_random_processes(volery: Volery, supervisor: Supervisor) -> None:
    """Groups and lists expand; --mtbf and --mttr let each edge come and go, within --for where it is given."""
    assert volery("fault", "pause", "ends,3").code == 0
    assert [getattr(fault, "agent") for fault in asked_for(supervisor)] == ["3", "5", "7"]  # noqa: B009
    every = ["--mtbf", "200ms", "--mttr", "50ms"]
    assert volery("fault", "cut", "all", *every, "--for", "2s").code == 0
    faults = asked_for(supervisor, 1)
    assert len({getattr(fault, "links") for fault in faults}) == 2  # noqa: B009 - faults of links
    assert 0 < faults[0].at_ns <= faults[-1].at_ns < 2_000_000_000
    assert volery("fault", "cut", "all", *every, "--together").code == 0
    assert len({getattr(fault, "links") for fault in asked_for(supervisor, 2)}) == 1  # noqa: B009
    assert volery("fault", "cut", "random 0.5").code == 0
    assert len(getattr(asked_for(supervisor, 3)[0], "links")) == 2  # noqa: B009
    for half in (["--mtbf", "1s"], ["--mttr", "1s"], ["--together"]):
        said = volery("fault", "cut", "all", *half)
        assert (said.code, said.error.startswith("error: --mtbf and --mttr belong together")) == (2, True)


def test_settings_are_written_as_in_a_scenario(volery: Volery, supervisor: Supervisor) -> None:
    """`fault set` takes several fields, units without a space, models by name, and a time."""
    words = ["all", "loss=0.3", "latency=5ms", "rate=57.6kbit/s", "overhead=6 B"]
    assert volery("fault", "set", *words, "--for", "2s").code == 0
    (fault,) = asked_for(supervisor)
    nested = volery("fault", "set", "3-7", "loss.gilbert-elliott.to_bad=0.1", "loss.gilbert-elliott.to_good=0.5")
    assert nested.code == 0
    assert isinstance(fault, LinkFault)
    assert fault.until_ns == 2_000_000_000
    assert len(fault.links) == len(PLACES.links)
    assert set(fault.changes) == {"loss", "latency", "rate", "overhead"}
    assert (fault.changes["rate"], fault.changes["overhead"]) == (57_600.0, 6)
    (burst,) = asked_for(supervisor, 1)
    assert isinstance(burst, LinkFault)
    assert burst.changes["loss"][0].to_bad == 0.1


def test_traces_are_those_where_the_command_is_given(
    volery: Volery, supervisor: Supervisor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The supervisor may run elsewhere: it is given the whole path of the file."""
    monkeypatch.chdir(tmp_path)
    assert volery("fault", "set", "3-7", "loss.trace=own.csv").code == 0
    assert supervisor.asked[0][1]["fault"]["set"] == {"loss": {"trace": str(tmp_path / "own.csv")}}


@pytest.mark.parametrize("words", [["set", "all"], ["set", "all", "loss"]])
def test_settings_that_are_none(volery: Volery, supervisor: Supervisor, words: list[str]) -> None:
    """Nothing to set, or no value for it, is bad input; here or where the supervisor reads it."""
    if volery("fault", *words).code == 0:
        with pytest.raises(BadInput, match="set is empty"):
            asked_for(supervisor)
    else:
        assert supervisor.asked == []


@pytest.mark.parametrize(
    ("words", "request_"),
    [
        ("fault restore 3-7", {"do": "restore", "links": "3-7"}),
        ("fault release 3-7", {"do": "release", "links": "3-7"}),
        ("fault restart 5", {"do": "restart", "agents": "5"}),
        ("fault resume 5", {"do": "resume", "agents": "5"}),
        ("fault clear", {"do": "clear", "faults": []}),
        ("fault clear f1 t2", {"do": "clear", "faults": ["f1", "t2"]}),
        ("stop", {"do": "stop"}),
    ],
)
def test_other_requests(volery: Volery, supervisor: Supervisor, words: str, request_: dict[str, Any]) -> None:
    """Each command asks the newest swarm that runs, or the one that is named."""
    assert volery(*words.split()).code == 0
    assert volery(*words.split(), "--run", "first").code == 0
    assert supervisor.asked == [("second", request_), ("first", request_)]


def test_status_of_all_and_of_one(volery: Volery, supervisor: Supervisor) -> None:
    """Without a run, a row for each that runs in the order in which they began; a killed one is not asked."""
    said = volery("status")
    assert said.code == 0
    assert [run for run, _ in supervisor.asked] == ["first", "second"]
    row = next(line for line in said.out.splitlines() if "second" in line)
    assert [cell.strip() for cell in row.strip("│").split("│")] == [
        *("second", "1.2 of 60 s", "3 of 4", "1,234", "56", "9", "7", "–", "f1: kill 3")
    ]
    assert volery("status", "first").code == 0
    assert supervisor.asked[2:] == [("first", {"do": "status"})]


@pytest.mark.parametrize("words", [["watch"], ["stop"], ["fault", "cut", "1-2", "--run"]])
def test_a_run_that_is_over_cannot_be_asked(volery: Volery, supervisor: Supervisor, words: list[str]) -> None:
    """The one that was killed is not running, though its control file is still there."""
    said = volery(*words, "stale")
    assert (said.code, supervisor.asked) == (2, [])
    assert said.error.startswith("error: runs/stale is not running")


def test_nothing_runs(volery: Volery) -> None:
    """`status` says so; what needs a swarm is bad input and says how to start one."""
    said = volery("status")
    assert (said.code, said.out) == (0, "no swarm is running in runs\n")
    for words in (["stop"], ["watch"], ["fault", "clear"]):
        said = volery(*words)
        assert said.code == 2
        assert "--detach" in said.error


def test_watch_shows_the_swarm_until_it_ends(volery: Volery, supervisor: Supervisor) -> None:
    """It asks again and again, and says when the run is over."""
    supervisor.ends_after = 3
    said = volery("watch")
    assert said.code == 0
    assert len(supervisor.asked) == 3
    assert said.out.splitlines()[-1] == "runs/second has ended"
