"""Trials: start a run, kill or interrupt it at a random moment, and check what is left.

usage: python benchmarks/trials_orphans.py [TRIALS [SEED]]

Each trial starts `volery run` in a session of its own. This program makes itself a subreaper, so that all processes of
a run stay its descendants if their parents die; it touches no others. A trial is passed when

- supervisor killed (kill -9): all its processes end within 3 s; what was recorded can be recovered and read;
- agent killed (kill -9): the run goes on to its end, says who died, and leaves no process and a whole record;
- interrupted (Ctrl-C): the run ends within 3 s, with metrics if it was running, and leaves no process.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from measuring import table

from volery.errors import VoleryError
from volery.experiments.analysis.metrics import FILE_NAME as METRICS_FILE
from volery.experiments.analysis.metrics import write_metrics
from volery.experiments.record.mcap_file import recover
from volery.experiments.record.record import load
from volery.experiments.record.run_files import CONTROL_FILE, RECORD_FILE
from volery.randomness import stream

TRIALS, SEED = 50, 1
AGENTS, SECONDS = 8, 2.0
GONE_WITHIN_S = 3.0
_START_TIMEOUT_S, _END_TIMEOUT_S, _ALL_TIMEOUT_S = 30.0, 30.0, 1200.0
_POLL_S = 0.02
_CHILD_SUBREAPER = 36
_WAYS = ("supervisor killed", "agent killed", "interrupted")


@dataclass(frozen=True)
class Trial:
    """One run and how it is disturbed; `after_s`: time from its start, or from when it is running."""

    number: int
    way: str
    while_starting: bool
    after_s: float


@dataclass(frozen=True)
class Finding:
    """Result of a trial; `gone_s`: time until the last process had ended; `wrong`: empty if it is passed."""

    trial: Trial
    gone_s: float
    messages: int
    wrong: str


def children(pid: int) -> list[int]:
    """Child processes of all threads of a process."""
    found: list[int] = []
    for task in Path(f"/proc/{pid}/task").glob("*"):
        with contextlib.suppress(OSError):
            found += [int(word) for word in (task / "children").read_text().split()]
    return found


def descendants(pid: int) -> list[int]:
    """All descendants of a process."""
    own = children(pid)
    return own + [other for child in own for other in descendants(child)]


def reap(supervisor: subprocess.Popen[bytes]) -> list[int]:
    """Wait for ended processes, and list those that are alive."""
    supervisor.poll()
    for pid in children(os.getpid()):
        if pid != supervisor.pid:
            with contextlib.suppress(ChildProcessError):
                os.waitpid(pid, os.WNOHANG)
    return descendants(os.getpid())


def wait_until(happened: Callable[[], bool], timeout_s: float) -> bool:
    """Whether a condition holds in time."""
    deadline = time.monotonic() + timeout_s
    while not happened():
        if time.monotonic() > deadline:
            return False
        time.sleep(_POLL_S)
    return True


def agents_of(supervisor: int) -> list[int]:
    """The agents' processes: children of the fork server, which is a child of the supervisor."""
    return sorted(agent for helper in children(supervisor) for agent in children(helper))


def check(trial: Trial, folder: Path, exit_code: int | None, *, ran: bool) -> tuple[int, str]:
    """Number of messages in the record, and what is wrong with the run."""
    if not (folder / RECORD_FILE).exists():
        return 0, "there is no record" if ran else ""
    has_metrics = (folder / METRICS_FILE).exists()
    try:
        report = recover(folder)
        if ran:
            write_metrics(load(folder), folder)
        events = [event["event"] for event in load(folder).events] if report.messages else []
    except VoleryError as error:
        return 0, f"the record cannot be read: {error}"
    wrong = {
        f"exit code {exit_code}": trial.way == "agent killed" and exit_code != 0,
        "the record does not say that an agent died": trial.way == "agent killed" and "died" not in events,
        f"the record was {report.damage}": trial.way != "supervisor killed" and report.damage,
        "there are no metrics": trial.way == "interrupted" and ran and not has_metrics,
    }
    return report.messages, ", ".join(what for what, is_so in wrong.items() if is_so)


def attempt(trial: Trial, runs: Path) -> Finding:
    """Run a trial."""
    folder = runs / f"trial{trial.number}"
    options = f"--no-figures --set topology.hexagonal={AGENTS} --set duration={SECONDS:g}s --name {folder.name}"
    command = [sys.executable, "-m", "volery", "run", "dfa16", *options.split(), "--runs", str(runs)]
    with (runs / f"output{trial.number}.txt").open("wb") as output:
        supervisor = subprocess.Popen(command, stdout=output, stderr=output, start_new_session=True)
    ran = not trial.while_starting
    if ran and not wait_until((folder / CONTROL_FILE).exists, _START_TIMEOUT_S):
        supervisor.kill()
        return Finding(trial, 0.0, 0, "the run did not start")
    time.sleep(trial.after_s)
    if trial.way == "agent killed":
        agents = agents_of(supervisor.pid)
        os.kill(agents[trial.number % len(agents)], signal.SIGKILL)
        wait_until(lambda: supervisor.poll() is not None, _END_TIMEOUT_S)
    else:
        os.killpg(supervisor.pid, signal.SIGINT) if trial.way == "interrupted" else supervisor.kill()
    struck = time.monotonic()
    gone = wait_until(lambda: not reap(supervisor), GONE_WITHIN_S)
    gone_s = time.monotonic() - struck
    left = descendants(os.getpid())
    for pid in left:
        os.kill(pid, signal.SIGKILL)
    wait_until(lambda: not reap(supervisor), _END_TIMEOUT_S)
    if not gone:
        return Finding(trial, gone_s, 0, f"{len(left)} processes were left after {GONE_WITHIN_S:g} s")
    return Finding(trial, gone_s, *check(trial, folder, supervisor.returncode, ran=ran))


def plan(trials: int, seed: int) -> list[Trial]:
    """All ways in turn, at random moments; a quarter of the killed and interrupted runs are hit while starting."""
    moments = stream(seed, "moment")
    drawn = []
    for number in range(trials):
        way = _WAYS[number % len(_WAYS)]
        while_starting = way != "agent killed" and moments.uniform(2 * number) < 0.25
        longest_s = 2.0 if while_starting else 0.75 * SECONDS
        drawn.append(Trial(number, way, while_starting, moments.uniform(2 * number + 1) * longest_s))
    return drawn


def report(findings: list[Finding]) -> None:
    """Print a table with a row for each way, and what went wrong."""
    rows = []
    for way in _WAYS:
        mine = [finding for finding in findings if finding.trial.way == way]
        slowest = max((finding.gone_s for finding in mine), default=0.0)
        messages = sum(finding.messages for finding in mine)
        rows.append([way, len(mine), sum(not finding.wrong for finding in mine), f"{slowest:.2f}", f"{messages:,}"])
    table(["way", "trials", "passed", "slowest end s", "messages read"], rows)
    for finding in findings:
        if finding.wrong:
            trial = finding.trial
            moment = f"{trial.after_s:.3f} s after {'its start' if trial.while_starting else 'it ran'}"
            print(f"trial {trial.number}, {trial.way} {moment}: {finding.wrong}")


def main(trials: int = TRIALS, seed: int = SEED) -> int:
    """Run the trials; the exit code is 1 if one was not passed."""
    ctypes.CDLL(None).prctl(_CHILD_SUBREAPER, 1, 0, 0, 0)
    deadline = time.monotonic() + _ALL_TIMEOUT_S
    findings: list[Finding] = []
    with TemporaryDirectory(prefix="volery-trials-") as runs:
        for trial in plan(trials, seed):
            if time.monotonic() > deadline:
                break
            findings.append(attempt(trial, Path(runs)))
    report(findings)
    failed = any(finding.wrong for finding in findings) or len(findings) < trials
    print(f"seed {seed}: {len(findings)} of {trials} trials, {'NOT all passed' if failed else 'all passed'}")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(*(int(word) for word in sys.argv[1:])))
