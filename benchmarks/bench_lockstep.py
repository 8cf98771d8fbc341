"""Lockstep pace over Zenoh: how much faster than real time, at what cost, and with how few bare promises.

A plain consensus agent, which sends to every neighbour once a period, through the full pipeline; and flying arrays,
with three rounds a period, for comparison and for the memory that their processes take.
"""

from __future__ import annotations

from measuring import fresh, medians, table, verdict

CASES = {
    "16 agents, 20 Hz": {"agents": 16, "degree": 4, "rate": 20.0, "seconds": 10.0},
    "64 agents, 10 Hz": {"agents": 64, "degree": 4, "rate": 10.0, "seconds": 5.0},
}
BOUNDS = {"16 agents, 20 Hz": 4.0, "64 agents, 10 Hz": 2.0}
ARRAYS = {
    "16 arrays, 20 Hz": ["duration=10 s"],
    "64 arrays, 10 Hz": ["duration=5 s", "topology.hexagonal=64", "agents.rate=10 Hz", "world.rate=10 Hz"],
}
REPETITIONS = 3
PSS_BOUND_MB = 15.0


def plain() -> None:
    """Each agent to 4 neighbours."""
    print("to 4 neighbours once a period; TDMA, rate, Gilbert-Elliott loss, normal latency of at least 10 ms")
    rows, speeds = [], {}
    for name, case in CASES.items():
        middle = medians([fresh("swarms:lockstep", **case) for _ in range(REPETITIONS)])
        speeds[name] = middle["speed"]
        cost = [f"{middle['cpu_us']:.0f}", f"{middle['cpu_share']:.2f}"]
        rows.append([name, f"{middle['speed']:.1f}", *cost, f"{middle['promises']:.3f}"])
    table(["case", "× real time", "CPU µs per frame", "CPU s per nominal s", "promises per frame"], rows)
    for name, speed in speeds.items():
        verdict(f"× real time, {name}", speed, BOUNDS[name], at_least=True)


def arrays() -> None:
    """dfa16 and its like."""
    print("\nflying arrays: dfa16 and its like")
    rows, largest = [], 0.0
    for name, overrides in ARRAYS.items():
        call = {"scenario": "dfa16", "overrides": overrides}
        middle = medians([fresh("swarms:lockstep_scenario", **call) for _ in range(REPETITIONS)])
        largest = max(largest, middle["pss_mb"])
        rows.append([name, f"{middle['speed']:.1f}", f"{middle['promises']:.3f}", f"{middle['pss_mb']:.1f}"])
    table(["case", "× real time", "promises per frame", "PSS MB per agent"], rows)
    verdict("PSS of an agent in MB", largest, PSS_BOUND_MB)


if __name__ == "__main__":
    plain()
    arrays()
