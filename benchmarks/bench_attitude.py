"""A step of a measurement unit, LQS and dynamic consensus, beside the matching filters of ahrs on the same data."""

from __future__ import annotations

from importlib.util import find_spec

from measuring import in_turn, median_ratio, medians, table, verdict

REPETITIONS = 7
BOUND = 1.0
AHRS = {"ahrs ROLEQ, with true rates": "roleq", "ahrs Davenport": "davenport"}


def main() -> None:
    """Measure and print."""
    print("two directions a sample, noise of 0.02 rad; volery: one unit with a mounting and two neighbours")
    sides = {"volery": {"function": "attitude_sides:volery"}}
    if find_spec("ahrs") is not None:
        sides |= {name: {"function": f"attitude_sides:{side}"} for name, side in AHRS.items()}
    samples = in_turn(sides, REPETITIONS)
    rows = []
    for name, taken in samples.items():
        middle = medians(taken)
        rows.append([name, f"{middle['step_us']:.1f}", f"{middle['error_deg']:.2f}"])
    table(["side", "step µs", "error deg"], rows)
    if len(samples) == 1:
        print("ahrs is not installed: `pip install ahrs` to compare")
        return
    for name in AHRS:
        verdict(f"step, volery over {name}", median_ratio(samples["volery"], samples[name], "step_us"), BOUND)


if __name__ == "__main__":
    main()
