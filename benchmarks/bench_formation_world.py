"""The world of a formation: processor time per nominal second, and how it grows with the number of vehicles."""

from __future__ import annotations

from measuring import in_turn, median_ratio, medians, table, verdict

FEW, MANY = 3, 30
SECONDS = 10.0
REPETITIONS = 5


def main() -> None:
    """Measure and print."""
    function = "formation_flights:flight"
    sides = {str(n): {"function": function, "vehicles": n, "seconds": SECONDS} for n in (FEW, MANY)}
    samples = in_turn(sides, REPETITIONS)
    rows = []
    for vehicles, taken in samples.items():
        middle = medians(taken)
        cost = middle["ms_per_second"]
        rows.append([vehicles, f"{middle['seen']:.1f}", f"{cost:.1f}", f"{1000.0 / cost:.0f}"])
    table(["vehicles", "in view of each", "ms per nominal second", "times real time"], rows)
    growth = median_ratio(samples[str(MANY)], samples[str(FEW)], "ms_per_second")
    verdict(f"cost of {MANY} vehicles over that of {FEW}, as their number grows", growth, MANY / FEW)


if __name__ == "__main__":
    main()
