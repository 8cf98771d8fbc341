"""Processor time beside an earlier commit, side by side in one run: `make bench-base` puts it into .bench-base.

Exact pace by the wall clock and lockstep over the lockstep of before, and the twin over the twin of before.
"""

from __future__ import annotations

import sys
from pathlib import Path

from measuring import in_turn, median_ratio, medians, table, verdict

BASE = Path(__file__).parents[1] / ".bench-base"
SCENARIO = "dfa16-lossy"
TWINS = ("dfa16-lossy", "tracker", "mav3")
REPETITIONS = 3
EXACT_BOUND, BEHIND_BOUND_S = 0.5, 0.05


def main() -> int:
    """Measure and print; 1 without the earlier commit."""
    if not BASE.exists():
        print(f"{BASE} is missing: run make bench-base")
        return 1
    base = str(BASE / "src")
    swarm = {"function": "base_sides:swarm", "scenario": SCENARIO}
    sides = {
        "base, lockstep": {**swarm, "pace": "lockstep", "path": base},
        "lockstep": {**swarm, "pace": "lockstep"},
        "exact": {**swarm, "pace": "exact"},
    }
    samples = in_turn(sides, REPETITIONS)
    rows = []
    for name, taken in samples.items():
        middle = medians(taken)
        rows.append([name, *(f"{middle[field]:.2f}" for field in ("cpu_s", "wall_s", "behind_s")), middle["promises"]])
    print(f"{SCENARIO}, 10 s, over Zenoh")
    table(["side", "processor s, all processes", "wall s", "behind at the end, s", "bare promises"], rows)
    for scenario in TWINS:
        call = {"function": "base_sides:twin", "scenario": scenario}
        twins = in_turn({"base": {**call, "path": base}, "now": call}, REPETITIONS)
        print(
            f"twin of {scenario}: {median_ratio(twins['now'], twins['base'], 'cpu_s'):.2f} of the base's processor time"
        )
    before = samples["base, lockstep"]
    print(f"lockstep: {median_ratio(samples['lockstep'], before, 'cpu_s'):.2f} of the base's lockstep")
    verdict("exact pace over the base's lockstep", median_ratio(samples["exact"], before, "cpu_s"), EXACT_BOUND)
    verdict("behind the clock at the end, s", medians(samples["exact"])["behind_s"], BEHIND_BOUND_S)
    return 0


if __name__ == "__main__":
    sys.exit(main())
