"""Start-up: commands that only print beside an import of numpy; a swarm beside bare processes, and its memory."""

from __future__ import annotations

import resource
import subprocess
import sys
from collections.abc import Sequence

from measuring import in_turn, median_ratio, medians, table, verdict

AGENTS, SECONDS = 64, 4.0
REPETITIONS = 3
TIME_BOUND, PSS_BOUND_MB = 1.3, 15.0
COMMAND_REPETITIONS = 11
COMMAND_BOUNDS = {"--help": 2.0, "list": 3.0}


def processor_time(words: Sequence[str]) -> dict[str, float]:
    """Processor time of one Python process with these arguments, in seconds."""
    subprocess.run([sys.executable, *words], check=True, stdout=subprocess.DEVNULL)
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return {"cpu_s": usage.ru_utime + usage.ru_stime}


def commands() -> None:
    """Measure and print commands that run nothing."""
    sides = {"import numpy": ["-c", "import numpy"]} | {name: ["-m", "volery", name] for name in COMMAND_BOUNDS}
    calls = {name: {"function": "bench_startup:processor_time", "words": words} for name, words in sides.items()}
    samples = in_turn(calls, COMMAND_REPETITIONS)
    table(["side", "CPU ms"], [[name, f"{1000 * medians(taken)['cpu_s']:.0f}"] for name, taken in samples.items()])
    for name, bound in COMMAND_BOUNDS.items():
        ratio = median_ratio(samples[name], samples["import numpy"], "cpu_s")
        verdict(f"processor time, volery {name} over an import of numpy", ratio, bound)


def main() -> None:
    """Measure and print."""
    commands()
    print(f"{AGENTS} processes, from nothing until all are alive; the fork server and its preload count on both sides")
    samples = in_turn(
        {
            "volery": {"function": "swarms:startup", "agents": AGENTS, "seconds": SECONDS},
            "bare processes": {"function": "bare:startup", "agents": AGENTS},
        },
        REPETITIONS,
    )
    rows = []
    for name, taken in samples.items():
        middle = medians(taken)
        rows.append([name, f"{middle['alive_s']:.2f}", f"{middle['pss_mb']:.1f}"])
    table(["side", "alive after s", "PSS MB per process"], rows)
    verdict("time, volery over bare", median_ratio(samples["volery"], samples["bare processes"], "alive_s"), TIME_BOUND)
    verdict("PSS of a running agent in MB", medians(samples["volery"])["pss_mb"], PSS_BOUND_MB)


if __name__ == "__main__":
    main()
