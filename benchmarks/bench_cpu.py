"""Processor time per frame, put to handled, beside a bare Zenoh put and asyncio receive of the same bytes."""

from __future__ import annotations

from measuring import in_turn, median_ratio, medians, table, verdict

AGENTS, DEGREE, SECONDS, LATENCY_MS = 20, 4, 3.5, 2.0
RATES = (2000, 5000)
REPETITIONS = 4
BOUND = 1.5


def main() -> None:
    """Measure and print."""
    print(f"{AGENTS} processes through one router, each to {DEGREE} neighbours; volery's links take {LATENCY_MS:g} ms")
    rows, ratios = [], {}
    for total in RATES:
        shape = {"agents": AGENTS, "degree": DEGREE, "rate": total / AGENTS / DEGREE, "seconds": SECONDS}
        samples = in_turn(
            {
                "volery": {"function": "swarms:cpu", "latency_ms": LATENCY_MS, **shape},
                "bare Zenoh": {"function": "bare:cpu", **shape},
            },
            REPETITIONS,
        )
        ratios[total] = median_ratio(samples["volery"], samples["bare Zenoh"], "cpu_us")
        for name, taken in samples.items():
            middle = medians(taken)
            handled = middle["frames"] / (SECONDS - 0.55)
            rows.append([name, f"{total:,}", f"{handled:,.0f}", f"{middle['cpu_us']:.1f}"])
    table(["side", "frames/s asked", "handled", "CPU µs per frame"], rows)
    for total, ratio in ratios.items():
        verdict(f"CPU per frame at {total:,} frames/s, volery over bare", ratio, BOUND)


if __name__ == "__main__":
    main()
