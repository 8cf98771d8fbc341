"""Start-up and memory: a swarm beside bare processes that open a session and declare a token."""

from __future__ import annotations

from measuring import in_turn, median_ratio, medians, table, verdict

AGENTS, SECONDS = 64, 4.0
REPETITIONS = 3
TIME_BOUND, PSS_BOUND_MB = 1.3, 15.0


def main() -> None:
    """Measure and print."""
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
