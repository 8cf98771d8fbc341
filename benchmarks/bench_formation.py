"""The filter of a formation: processor time of a step of 12 states beside FilterPy, and how it grows with vehicles."""

from __future__ import annotations

from importlib.util import find_spec

from formation_filters import Sample, step_us
from measuring import fresh, median_ratio, table, verdict

RATIO_BOUND, COMPILED_BOUND = 0.8, 0.25
VEHICLES = (3, 9, 15, 30)
MORE, FEWER = 60, 30


def main() -> None:
    """Measure and print."""
    print("one predict and update, three vehicles: a sighting, then with two messages of position and velocity too")
    forms = {"joseph": RATIO_BOUND} | ({"compiled": COMPILED_BOUND} if find_spec("numba") else {})
    rows, ratios = [], {}
    for form in forms:
        for what, heard in (("sighting", 0), ("and two messages", 2)):
            own, theirs = fresh("formation_filters:twelve_states", heard=heard, form=form)
            ratios[form, heard] = _ratio(own, theirs)
            rows.append([form, what, f"{step_us(own):.1f}", f"{step_us(theirs):.1f}", f"{ratios[form, heard]:.2f}"])
    table(["12 states", "in a step", "volery µs", "FilterPy µs", "ratio"], rows)
    for form, bound in forms.items():
        verdict(f"{form}: cost of a step with a sighting, as a share of FilterPy's", ratios[form, 0], bound)
    if "compiled" not in forms:
        print("compiled: not measured, the extra volery[fast] is not installed")
    print("one predict and update with a sighting, by the number of vehicles, beside dense matrices in NumPy")
    taken: dict[int, list[list[Sample]]] = {n: fresh("formation_filters:many_states", vehicles=n) for n in VEHICLES}
    table(
        ["vehicles", "states", "volery µs", "dense µs", "ratio"],
        [
            [n, 6 * (n - 1), *(f"{step_us(side):.1f}" for side in (own, dense)), f"{_ratio(own, dense):.3f}"]
            for n, (own, dense) in taken.items()
        ],
    )
    growth = _ratio(*fresh("formation_filters:two_sizes", fewer=FEWER, more=MORE))
    verdict(f"cost at {MORE} vehicles over that at {FEWER}, as N² grows", growth, ((MORE - 1) / (FEWER - 1)) ** 2)


def _ratio(own: list[Sample], other: list[Sample]) -> float:
    return median_ratio(own, other, "step_us")


if __name__ == "__main__":
    main()
