"""Latency is a pipe: the mean delay of a link in realtime pace does not depend on how many frames it carries."""

from __future__ import annotations

from measuring import in_turn, medians, table, verdict

RATES = (10, 100, 1000, 2000)
LATENCY_MS, SECONDS = 20.0, 6.0
REPETITIONS = 3
BOUND_US = 100.0


def main() -> None:
    """Measure and print."""
    print(f"two processes over Zenoh, a link with {LATENCY_MS:g} ms latency in each direction")
    samples = in_turn(
        {
            f"{rate:,} frames/s": {
                "function": "swarms:pipe",
                "rate": float(rate),
                "seconds": SECONDS,
                "latency_ms": LATENCY_MS,
            }
            for rate in RATES
        },
        REPETITIONS,
    )
    middles = {name: medians(taken) for name, taken in samples.items()}
    rows = [
        [name, f"{middle['delay_us'] / 1e3:.3f}", f"{middle['p99_us'] / 1e3:.3f}", f"{middle['frames']:,.0f}"]
        for name, middle in middles.items()
    ]
    table(["each direction", "mean delay ms", "p99 ms", "frames"], rows)
    means = [middle["delay_us"] for middle in middles.values()]
    verdict(f"mean delay in µs, largest less smallest, {RATES[0]} to {RATES[-1]:,}", max(means) - min(means), BOUND_US)


if __name__ == "__main__":
    main()
