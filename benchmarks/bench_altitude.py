"""One step of the altitude filter, prediction and update: processor time beside filterpy's extended Kalman filter."""

from __future__ import annotations

from importlib.util import find_spec

from measuring import in_turn, median_ratio, medians, table, verdict

REPETITIONS = 7
BOUND = 1.0
VARIANTS = ("as_printed", "gate", "gate_and_floor")
ROUNDING = 1e-9
"""Metres by which the altitudes may differ after thousands of steps with the same equations in another order."""


def main() -> None:
    """Measure and print."""
    print("10 states; inertial measurement unit with 5 values at 100 Hz, barometer and range finder at 20 Hz")
    if find_spec("filterpy") is None:
        print("filterpy is not installed here: nothing to compare with (pip install filterpy)")
        return
    ours = {
        f"volery, {variant}": {"function": "altitude_sides:volery_side", "variant": variant} for variant in VARIANTS
    }
    samples = in_turn({**ours, "filterpy": {"function": "altitude_sides:filterpy_side"}}, REPETITIONS)
    middles = {name: medians(taken) for name, taken in samples.items()}
    rows = [[name, f"{each['us']:.1f}", f"{each['steps']:,.0f}"] for name, each in middles.items()]
    table(["side", "CPU µs per step", "steps"], rows)
    apart = abs(middles["volery, as_printed"]["altitude"] - middles["filterpy"]["altitude"])
    verdict("altitudes at the end apart, in m", apart, ROUNDING)
    for name in ours:
        verdict(f"step of {name} over filterpy's", median_ratio(samples[name], samples["filterpy"], "us"), BOUND)


if __name__ == "__main__":
    main()
