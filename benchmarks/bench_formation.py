"""The filter of a formation: a step of 12 states beside FilterPy, and how its cost grows with the vehicles."""

from __future__ import annotations

from formation_filters import Sample, step_us
from measuring import fresh, median_ratio, table, verdict

RATIO_BOUND = 0.8
VEHICLES = (3, 9, 15, 30)
MORE, FEWER = 60, 30


def main() -> None:
    """Measure and print."""
    print("one predict and update, three vehicles: a sighting, then with two messages of position and velocity too")
    rows, ratios = [], []
    for what, heard in (("sighting", 0), ("and two messages", 2)):
        own, theirs = fresh("formation_filters:twelve_states", heard=heard)
        ratios.append(median_ratio(own, theirs, "step_us"))
        rows.append([what, f"{step_us(own):.1f}", f"{step_us(theirs):.1f}", f"{ratios[-1]:.2f}"])
    table(["12 states", "volery µs", "FilterPy µs", "ratio"], rows)
    verdict("cost of a step with a sighting, as a share of FilterPy's", ratios[0], RATIO_BOUND)
    print("one predict and update with a sighting, by the number of vehicles, beside dense matrices in NumPy")
    taken: dict[int, list[list[Sample]]] = {n: fresh("formation_filters:many_states", vehicles=n) for n in VEHICLES}
    table(
        ["vehicles", "states", "volery µs", "dense µs", "ratio"],
        [
            [
                n,
                6 * (n - 1),
                f"{step_us(own):.1f}",
                f"{step_us(dense):.1f}",
                f"{median_ratio(own, dense, 'step_us'):.3f}",
            ]
            for n, (own, dense) in taken.items()
        ],
    )
    growth = median_ratio(*fresh("formation_filters:two_sizes", fewer=FEWER, more=MORE), "step_us")
    verdict(f"cost at {MORE} vehicles over that at {FEWER}, as N² grows", growth, ((MORE - 1) / (FEWER - 1)) ** 2)


if __name__ == "__main__":
    main()
