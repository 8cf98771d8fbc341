"""A sweep on one process and on two: how much faster, with the start of the processes and the table counted."""

from __future__ import annotations

from measuring import in_turn, median_ratio, medians, table, verdict
from sweeps import CELLS

REPEAT = 6
REPETITIONS = 5
BOUND = 1.7


def main() -> None:
    """Measure and print."""
    print(f"{CELLS * REPEAT} twin runs of 10 flying-array modules, 0.5 s each")
    sides = {
        f"{workers} process{'es' if workers > 1 else ''}": {
            "function": "sweeps:whole_sweep",
            "workers": workers,
            "repeat": REPEAT,
        }
        for workers in (1, 2)
    }
    samples = in_turn(sides, REPETITIONS)
    rows = []
    for name, taken in samples.items():
        middle = medians(taken)
        rows.append([name, f"{middle['seconds']:.1f}", f"{middle['runs'] / middle['seconds']:.1f}"])
    table(["side", "seconds", "runs per second"], rows)
    one, two = samples.values()
    verdict("speed-up on two processes", median_ratio(one, two, "seconds"), BOUND, at_least=True)


if __name__ == "__main__":
    main()
