"""Delay error, delivered minus requested: volery beside bare relays of UDP packets."""

from __future__ import annotations

from typing import Any

from measuring import in_turn, median_ratio, medians, table, verdict

SHAPE: dict[str, Any] = {"agents": 20, "degree": 2, "rate": 50.0, "seconds": 4.0, "latency_ms": 20.0}
REPETITIONS = 5
P50_BOUND, P99_BOUND = 1.5, 3.0


def main() -> None:
    """Measure and print."""
    total = SHAPE["agents"] * SHAPE["degree"] * SHAPE["rate"]
    print(f"{SHAPE['agents']} processes, {total:,.0f} frames/s in all, {SHAPE['latency_ms']:g} ms requested")
    samples = in_turn(
        {
            "volery over Zenoh": {"function": "swarms:delay", **SHAPE},
            "UDP, timerfd": {"function": "bare:relay", "kind": "timerfd", **SHAPE},
            "UDP, call_at": {"function": "bare:relay", "kind": "call_at", **SHAPE},
        },
        REPETITIONS,
    )
    rows = []
    for name, taken in samples.items():
        middle = medians(taken)
        least = min(sample["min"] for sample in taken)
        rows.append([name, f"{least:.0f}", f"{middle['p50']:.0f}", f"{middle['p99']:.0f}", f"{middle['frames']:,.0f}"])
    table(["side", "least µs", "p50 µs", "p99 µs", "frames"], rows)
    own, relay = samples["volery over Zenoh"], samples["UDP, timerfd"]
    verdict("least delay error in µs: never early", min(sample["min"] for sample in own), 0, at_least=True)
    verdict("p50, volery over timerfd relay", median_ratio(own, relay, "p50"), P50_BOUND)
    verdict("p99, volery over timerfd relay", median_ratio(own, relay, "p99"), P99_BOUND)


if __name__ == "__main__":
    main()
