"""The command line `volery`: its commands, each loaded when it is called, and exit codes."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Sequence
from typing import Any

from cyclopts import App, CycloptsError, Group, Parameter

from ...errors import VoleryError
from .output import print_error

USAGE_ERROR = 2
INTERRUPTED = 130
_BESIDE_A_SWARM = {"status", "watch", "fault", "stop"}
_LEAST_PRIORITY = 19
_SHOWN = 60

_HELP = """Emulate swarms of agents that talk to their neighbours over unreliable links, and measure their estimators.

A first run: `volery run dfa4`. `volery COMMAND --help` shows options and examples of a command.

Exit codes: 0 success, 1 the run failed, 2 invalid input, 3 not certified (verify, and run --strict).
"""
_SCENARIOS, _RUNS, _LIVE, _RESULTS = (
    Group.create_ordered(title) for title in ("Scenarios", "Runs", "Running swarms", "Results")
)
_COMMANDS: dict[str, tuple[Group, str, str, tuple[str, ...]]] = {
    "list": (_SCENARIOS, "list_command:list_scenarios", "List the built-in scenarios.", ()),
    "show": (
        _SCENARIOS,
        "scenario_commands:show",
        "Print the YAML of a scenario.",
        ("show dfa16-lossy", "show dfa4 --resolved --set 'duration=2 s'"),
    ),
    "new": (_SCENARIOS, "scenario_commands:new", "Write a commented scenario to start from.", ("new mine",)),
    "validate": (
        _SCENARIOS,
        "scenario_commands:validate",
        "Check a scenario and show the load of its media: airtime utilisation, frames per second.",
        ("validate mine.yaml", "validate dfa16 --set 'links.rate=57.6 kbit/s'", "validate --schema > schema.json"),
    ),
    "links": (
        _SCENARIOS,
        "links_command:links",
        "Show the links of a scenario: medium, airtime, queue, loss, latency, and their faults.",
        ("links dfa16-lossy", "links --presets"),
    ),
    "run": (
        _RUNS,
        "run_command:run",
        "Run a scenario, print its metrics, and draw its figures.",
        (
            "run dfa4",
            "run dfa16 --engine twin --set links.loss.bernoulli=0.3",
            "run mine.yaml --pace lockstep --name first",
            "run dfa16 --set 'duration=1 min' --detach --name demo",
        ),
    ),
    "sweep": (
        _RUNS,
        "sweep_command:sweep",
        "Run a scenario over ranges of its fields, several times each, and compare.",
        (
            "sweep dfa16-lossy --over links.loss.bernoulli=0:0.6:0.2 --repeat 5",
            "sweep dfa16 --over agents.rounds=1,3,5 --repeat 10",
        ),
    ),
    "status": (_LIVE, "live_commands:status", "Show the state of the running swarms.", ("status", "status demo")),
    "watch": (_LIVE, "live_commands:watch", "Watch a running swarm until it ends; Ctrl-C leaves it running.", ()),
    "fault": (_LIVE, "fault_commands:fault", "Inject faults into a running swarm, and undo them.", ()),
    "stop": (_LIVE, "live_commands:stop", "End a running swarm early, keeping what was recorded.", ("stop demo",)),
    "metrics": (
        _RESULTS,
        "result_commands:metrics",
        "Compute and print the metrics of runs, and write them to metrics.json.",
        ("metrics last", "metrics first demo --threshold 0.01", "metrics last --json"),
    ),
    "evaluate": (
        _RESULTS,
        "evaluate_command:evaluate",
        "Repeat the evaluation of a run: truth and central estimate from its record.",
        ("evaluate last",),
    ),
    "compare": (
        _RESULTS,
        "compare_command:compare",
        "Compare runs or sweeps: means with confidence intervals, and paired tests.",
        ("compare first demo", "compare mysweep --by agents.estimator"),
    ),
    "trace": (
        _RESULTS,
        "trace_command:trace_run",
        "Print the fate of every frame of a run, one line each, with faults and deaths in between.",
        ("trace last --link 3-7 --from 2s --until 2.5s", "trace last --fate lost --limit 20"),
    ),
    "plot": (
        _RESULTS,
        "result_commands:plot_run",
        "Draw the figures of a run or a sweep, a space-time diagram, or an animation, and print their paths.",
        ("plot last", "plot last --space-time --from 2s --until 2.2s", "plot last --animate", "plot mysweep curves"),
    ),
    "export": (
        _RESULTS,
        "result_commands:export_run",
        "Write the estimates and frames of a run as tables or arrays for other programs.",
        ("export last --csv", "export last --parquet --out data"),
    ),
    "verify": (
        _RESULTS,
        "result_commands:verify_run",
        "Replay a run in the twin and compare every estimate and every frame's fate bit for bit.",
        ("verify last",),
    ),
    "recover": (_RESULTS, "result_commands:recover_run", "Repair a record that was cut off.", ("recover last",)),
}


def _shown_default(value: Any) -> str | None:
    """A default in the help; None for those that say nothing."""
    if value in ((), False, None):
        return None
    return ", ".join(map(str, value)) if isinstance(value, tuple) else str(value)


app = App(
    name="volery",
    help=_HELP,
    default_parameter=Parameter(negative=(), show_default=_shown_default),
    suppress_keyboard_interrupt=False,
    help_format="plaintext",
    exit_on_error=False,
    result_action="return_value",
)
for _name, (_group, _place, _purpose, _examples) in _COMMANDS.items():
    _shown = "\n".join(["Examples:", "", *(f"    volery {example}" for example in _examples)])
    _epilogue = {"help_epilogue": _shown} if _examples else {}
    app.command(f"{__package__}.{_place}", name=_name, help=_purpose, group=_group, **_epilogue)


def main(words: Sequence[str] | None = None) -> int:
    """Run a command line, by default that of the process; the exit code."""
    if words is None and set(sys.argv[1:2]) & _BESIDE_A_SWARM:
        os.nice(_LEAST_PRIORITY)  # looking at a swarm must not make its frames late
    try:
        code: int | None = app(words)
    except CycloptsError:
        return USAGE_ERROR
    except VoleryError as error:
        print_error(str(error))
        return error.exit_code
    except OSError as error:
        if error.errno != errno.ENAMETOOLONG:
            raise
        print_error(f"{str(error.filename)[:_SHOWN]}…: a name in this path is too long for a file")
        return USAGE_ERROR
    except KeyboardInterrupt:
        return INTERRUPTED
    return code or 0
