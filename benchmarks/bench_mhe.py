"""A step of moving horizon estimation: volery beside do-mpc on the same flight; the quadratic program apart."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

from measuring import in_turn, median_ratio, medians, table, verdict

REPETITIONS = 5
BOUND = 0.1


def main() -> None:
    """Measure and print."""
    print(
        "a quadrotor rolls: 10 steps, a state of 8 numbers, 6 bounded disturbances a step, 10 measured values a point"
    )
    sides: dict[str, dict[str, Any]] = {
        "volery, 7 errors": {"function": "mhe_sides:volery"},
        "volery, 10 errors (gyroscope bias)": {"function": "mhe_sides:volery", "gyroscope_bias": True},
    }
    if find_spec("do_mpc") is not None:
        sides["do-mpc"] = {"function": "mhe_sides:do_mpc_mhe"}
    samples = in_turn(sides, REPETITIONS)
    rows = []
    for name, taken in samples.items():
        middle = medians(taken)
        rows.append([name, f"{middle['step_us']:,.0f}", f"{middle['roll_mrad']:.3f}"])
    table(["side", "step µs", "roll error mrad"], rows)
    middle = medians(samples["volery, 7 errors"])
    print(
        f"quadratic program of 67 unknowns, {middle['at_bounds']:.0f} of them at a bound: "
        f"daqp {middle['daqp_us']:,.0f} µs, piqp {middle['piqp_us']:,.0f} µs"
    )
    if "do-mpc" not in samples:
        print("do-mpc is not installed: `pip install do-mpc` to compare")
        return
    for name in list(sides)[:2]:
        verdict(f"step, {name} over do-mpc", median_ratio(samples[name], samples["do-mpc"], "step_us"), BOUND)


if __name__ == "__main__":
    main()
