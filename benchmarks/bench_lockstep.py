"""Lockstep pace: how much faster than real time flying arrays run over Zenoh, and what memory their processes take."""

from __future__ import annotations

from measuring import fresh, medians, table, verdict

CASES = {
    "16 agents, 20 Hz": ["duration=10 s"],
    "64 agents, 10 Hz": ["duration=5 s", "topology.hexagonal=64", "agents.rate=10 Hz", "world.rate=10 Hz"],
}
TRIED = {"16 agents, 20 Hz": 7.0, "64 agents, 10 Hz": 4.0}
REPETITIONS = 3
PSS_BOUND_MB = 15.0


def main() -> None:
    """Measure and print."""
    print("dfa16 and its like; beside it the speed at which a plain consensus agent once ran in lockstep on 2 cores")
    rows, largest = [], 0.0
    for name, overrides in CASES.items():
        middle = medians([fresh("swarms:lockstep", scenario="dfa16", overrides=overrides) for _ in range(REPETITIONS)])
        largest = max(largest, middle["pss_mb"])
        speeds = [f"{middle['speed']:.1f}", f"{TRIED[name]:.0f}"]
        rows.append([name, *speeds, f"{middle['frames_per_s']:,.0f}", f"{middle['pss_mb']:.1f}"])
    table(["case", "× real time", "tried before", "frames/s", "PSS MB per agent"], rows)
    verdict("PSS of an agent in MB", largest, PSS_BOUND_MB)


if __name__ == "__main__":
    main()
