"""Consensus on information of ten nodes: processor time of a sample beside filterpy's InformationFilter per node."""

from __future__ import annotations

from importlib.util import find_spec

from measuring import in_turn, median_ratio, medians, table, verdict

SAMPLES = 420
REPETITIONS = 9
COST_BOUND = 0.8
PATTERN = "10 nodes, 4 states, 3 rounds: predict, correct, average 3 times, mean and covariance of each node"


def main() -> None:
    """Measure and print."""
    print(PATTERN)
    sides = ("own", "filterpy") if find_spec("filterpy") else ("own",)
    calls = {side: {"function": f"information_steps:{side}", "samples": SAMPLES} for side in sides}
    samples = in_turn(calls, REPETITIONS)
    timed = {side: [{"microseconds": one["microseconds"]} for one in taken] for side, taken in samples.items()}
    rows = [[side, f"{medians(taken)['microseconds']:.0f}"] for side, taken in timed.items()]
    table(["side", "CPU µs per sample of all nodes"], rows)
    if "filterpy" not in sides:
        print("filterpy is not installed here: nothing beside it (pip install filterpy)")
        return
    apart = max(
        abs(mine - other)
        for own, theirs in zip(samples["own"][0]["means"], samples["filterpy"][0]["means"], strict=True)
        for mine, other in zip(own, theirs, strict=True)
    )
    print(f"largest difference of the two sides' means: {apart:.1e} m and m/s")
    verdict(
        "time of a sample over filterpy's", median_ratio(timed["own"], timed["filterpy"], "microseconds"), COST_BOUND
    )


if __name__ == "__main__":
    main()
