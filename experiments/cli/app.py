"""The command line `volery`: its commands, each loaded when it is called, and how it ends."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Sequence

from cyclopts import App, CycloptsError, Group, Parameter

from ...errors import VoleryError
from .output import print_error

USAGE_ERROR = 2
INTERRUPTED = 130
_BESIDE_A_SWARM = {"status", "watch", "fault", "stop"}
_LEAST_PRIORITY = 19
_SHOWN = 60

_HELP = """Swarms of agents that talk to their neighbours over links that fail: what does this estimator do then?

Exit codes: 0 fine, 1 the run failed, 2 bad input, 3 not certified (verify, and run --strict).
"""
_SCENARIOS, _RUNS, _LIVE, _RESULTS = (
    Group.create_ordered(title) for title in ("Scenarios", "Runs", "Running swarms", "Results")
)
_COMMANDS = {
    "list": (_SCENARIOS, "scenario_commands:list_scenarios", "List the scenarios that come with volery."),
    "show": (_SCENARIOS, "scenario_commands:show", "Print the YAML of a scenario."),
    "new": (_SCENARIOS, "scenario_commands:new", "Write a commented scenario to start from."),
    "validate": (
        _SCENARIOS,
        "scenario_commands:validate",
        "Check a scenario and say what it asks of links and machine.",
    ),
    "links": (_SCENARIOS, "links_command:links", "Show the links of a scenario as they are resolved."),
    "run": (_RUNS, "run_command:run", "Run a scenario to its metrics and figures."),
    "sweep": (_RUNS, "sweep_command:sweep", "Run a scenario over ranges of its fields, many times each."),
    "status": (_LIVE, "live_commands:status", "Say how the swarms are that run now."),
    "watch": (_LIVE, "live_commands:watch", "Watch a running swarm until it ends."),
    "fault": (_LIVE, "fault_commands:fault", "Inject faults into a running swarm, and undo them."),
    "stop": (_LIVE, "live_commands:stop", "End a running swarm early; what was recorded is kept."),
    "metrics": (_RESULTS, "result_commands:metrics", "Compute and print the metrics of runs."),
    "evaluate": (_RESULTS, "evaluate_command:evaluate", "Compare a run with truth and central estimate, once more."),
    "compare": (_RESULTS, "compare_command:compare", "Say who is better, of runs or of sweeps, and how sure that is."),
    "trace": (_RESULTS, "trace_command:trace_run", "Print what became of the frames of a run, line by line."),
    "plot": (_RESULTS, "result_commands:plot_run", "Draw the figures of a run or a sweep."),
    "export": (_RESULTS, "result_commands:export_run", "Write a run as tables or arrays for other programs."),
    "verify": (_RESULTS, "result_commands:verify_run", "Replay a run in the twin and compare bit for bit."),
    "recover": (_RESULTS, "result_commands:recover_run", "Make a record readable that was cut off."),
}

app = App(
    name="volery",
    help=_HELP,
    default_parameter=Parameter(negative=()),
    suppress_keyboard_interrupt=False,
    exit_on_error=False,
    result_action="return_value",
)
for _name, (_group, _place, _help) in _COMMANDS.items():
    app.command(f"{__package__}.{_place}", name=_name, help=_help, group=_group)


def main(words: Sequence[str] | None = None) -> int:
    """Carry out a command line, by default that of the process; the exit code."""
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
