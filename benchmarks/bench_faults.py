"""Live faults: from the command to their effect on every link at one nominal instant, 50 agents in exact pace."""

from __future__ import annotations

from measuring import fresh, medians, table, verdict

SHAPE = {"agents": 50, "degree": 4, "rate": 10.0, "faults": 100}
REPETITIONS = 3
P99_BOUND_MS = 100.0


def main() -> None:
    """Measure and print."""
    links = SHAPE["agents"] * SHAPE["degree"]
    print(f"{SHAPE['agents']} processes, {links:.0f} links all cut by each of {SHAPE['faults']} commands, from Python")
    samples = [fresh("injections:latency", **SHAPE) for _ in range(REPETITIONS)]
    rows = [[f"{one['p50']:.1f}", f"{one['p99']:.1f}", one["late"], one["stray"]] for one in samples]
    table(["p50 ms", "p99 ms", "late faults", "stray frames"], rows)
    middle = medians(samples)
    verdict("p99 from command to effect in ms", middle["p99"], P99_BOUND_MS)
    verdict("frames on the wrong side of the instant", max(one["stray"] for one in samples), 0)


if __name__ == "__main__":
    main()
