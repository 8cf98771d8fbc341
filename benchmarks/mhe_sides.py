"""Moving horizon estimation of the same flight by volery and by do-mpc: samples for bench_mhe.py."""

from __future__ import annotations

import math
from time import perf_counter
from typing import Any

import numpy as np

HORIZON, WARM, STEPS, STEP_S = 10, 30, 120, 0.01
BOUNDS = (0.05, 0.05, 0.05, 1.0, 1.0, 1.0)
GUESS = (0.05, 0.05, 0.05, 0.1, 0.1, 0.1, 0.1)


def flight() -> tuple[Any, Any, Any]:
    """Inputs (K, 6), measured values (K, 10) and true states (K, 8) of a roll of 0.1 rad that begins at 0.4 s."""
    from volery.experiments.scenario.explaining import read
    from volery.worlds.world_kinds import AnyWorld

    carried = {
        "imu": ["gyroscope", "accelerometer", "magnetometer"],
        "flow": ["flow"],
        "ranges": [f"range_{place}" for place in ("centre", "front", "right", "back", "left")],
    }
    roll = {"steps": {"0 s": 0, "400 ms": "0.1 rad"}}
    world = read(AnyWorld, {"kind": "quadrotor", "roll": roll, "sensors": carried}).build({}, 7, list(carried))
    points = range(WARM + STEPS)
    seen = [
        np.concatenate([world.measure(agent, sensor, k) for agent in carried for sensor in carried[agent]])
        for k in points
    ]
    truth = np.array([world.truth(k * 10_000_000) for k in points])
    rows = np.array(seen)
    return rows[:, :6], rows[:, 6:], truth


def _summary(seconds: list[float], rolls: list[float], truth: Any) -> dict[str, float]:
    from volery.rotations import quaternion_to_euler

    true = [quaternion_to_euler(state[:4])[0] for state in truth[WARM:]]
    return {
        "step_us": 1e6 * float(np.median(seconds[WARM:])),
        "roll_mrad": 1e3 * math.sqrt(np.mean((np.array(rolls[WARM:]) - true) ** 2)),
    }


def volery(gyroscope_bias: bool = False) -> dict[str, float]:
    """A point and its window, and what the quadratic program of the last window takes with each solver."""
    from volery.estimators.horizon.moving_horizon import MovingHorizon
    from volery.estimators.horizon.quadrotor_model import QuadrotorModel
    from volery.rotations import quaternion_to_euler

    inputs, measured, truth = flight()
    model = QuadrotorModel(step_s=STEP_S, gyroscope_bias=gyroscope_bias)
    spread = np.array([*GUESS, *([0.02] * (model.size - 7))])
    moving = MovingHorizon(model, HORIZON, model.start(np.array([1.0, 0.0, 0.0, 0.0]), 10.0), np.diag(spread**2))
    moving.take_inputs(0, slice(None), inputs[0])
    moving.take(0, slice(None), measured[0])
    seconds, rolls = [], []
    for k in range(len(inputs)):
        started = perf_counter()
        if k:
            moving.advance(inputs[k], measured[k])
        estimated = moving.estimate()
        seconds.append(perf_counter() - started)
        rolls.append(quaternion_to_euler(estimated.state[:4])[0])
    return {**_summary(seconds, rolls, truth), **_programs(moving)}


def _programs(moving: Any) -> dict[str, float]:
    """Microseconds of the window's program, with bounds at a third of what the window found so that many are active."""
    from dataclasses import replace

    from volery.estimators.horizon.quadratic_programs import solve
    from volery.estimators.horizon.windows import program_of, smooth

    window = moving.window()
    found = abs(smooth(window).disturbances)
    tight = replace(window, bounds=np.broadcast_to(found.max(axis=0) / 3.0, window.bounds.shape))
    program = program_of(tight)
    took: dict[str, float] = {}
    for solver in ("daqp", "piqp"):
        samples = []
        for _ in range(50):
            started = perf_counter()
            solution = solve(program, solver)
            samples.append(perf_counter() - started)
        took[f"{solver}_us"] = 1e6 * float(np.median(samples))
        took["at_bounds"] = int((abs(abs(solution) - program.upper) < 1e-6).sum())
    return took


def _do_mpc_model() -> Any:
    """The quadrotor in CasADi: states q, V, z; w is an input that is measured as 0, measured ω and a are parameters."""
    import casadi as ca
    import do_mpc

    model = do_mpc.model.Model("discrete", "SX")
    q, v, z = (model.set_variable("_x", name, (size, 1)) for name, size in (("q", 4), ("v", 3), ("z", 1)))
    w, u = model.set_variable("_u", "w", (6, 1)), model.set_variable("_tvp", "u", (12, 1))
    rate, force = u[0:3] - w[0:3], u[3:6] - w[3:6]

    def product(a: Any, b: Any) -> Any:
        return ca.vertcat(
            a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
            a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
            a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
            a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
        )

    def turn(vector: Any) -> Any:
        angle = ca.sqrt(ca.sumsqr(vector) + 1e-16)
        return ca.vertcat(ca.cos(angle / 2), ca.sin(angle / 2) / angle * vector)

    def matrix(a: Any) -> Any:
        s, x, y, k = a[0], a[1], a[2], a[3]
        return ca.vertcat(
            ca.horzcat(1 - 2 * (y * y + k * k), 2 * (x * y - s * k), 2 * (x * k + s * y)),
            ca.horzcat(2 * (x * y + s * k), 1 - 2 * (x * x + k * k), 2 * (y * k - s * x)),
            ca.horzcat(2 * (x * k - s * y), 2 * (y * k + s * x), 1 - 2 * (x * x + y * y)),
        )

    pushed = matrix(product(q, turn(0.5 * STEP_S * rate))) @ force + ca.DM([0, 0, 9.81])
    turned = product(q, turn(STEP_S * rate))
    model.set_rhs("q", turned / ca.norm_2(turned))
    model.set_rhs("v", v + STEP_S * pushed)
    model.set_rhs("z", z + STEP_S * v[2] + 0.5 * STEP_S**2 * pushed[2])
    R, place = matrix(q), ca.DM([0.1, 0.05, 0.0])
    model.set_meas("magnetometer", R.T @ ca.DM([0.24, 0.02, 0.39]), meas_noise=True)
    model.set_meas("flow", (R.T @ v + ca.cross(u[6:9], place))[0:2], meas_noise=True)
    arms = 0.7 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])
    model.set_meas("ranges", ca.vertcat(*(-(z + R[2, :] @ arm) / R[2, 2] for arm in arms)), meas_noise=True)
    model.set_meas("w", w, meas_noise=True)
    model.setup()
    return model


def do_mpc_mhe() -> dict[str, float]:
    """The same with do-mpc: the same horizon, weights and bounds, the whole nonlinear program by IPOPT in each step."""
    import do_mpc

    from volery.rotations import normalised, quaternion_to_euler

    inputs, measured, truth = flight()
    model = _do_mpc_model()
    mhe = do_mpc.estimator.MHE(model, [])
    mhe.settings.n_horizon, mhe.settings.t_step, mhe.settings.store_full_solution = HORIZON, STEP_S, False
    mhe.settings.meas_from_data = True
    mhe.settings.supress_ipopt_output()
    variances = [2.5e-7] * 3 + [1e-6] * 2 + [2.6e-7] * 5 + [6e-6] * 3 + [2.5e-3] * 3
    prior = np.array([1e-7] * 4 + [4e-7, 4e-7, 2e-6, 1e-8])
    mhe.set_default_objective(P_x=np.diag(1.0 / prior), P_v=np.diag(1.0 / np.array(variances)))
    mhe.bounds["lower", "_u", "w"], mhe.bounds["upper", "_u", "w"] = -np.array(BOUNDS), np.array(BOUNDS)
    mhe.bounds["upper", "_x", "z"] = 0.0
    given, now = mhe.get_tvp_template(), [0]

    def parameters(_: float) -> Any:
        for m in range(HORIZON + 1):
            k = max(0, now[0] - HORIZON + m)
            after = min(k + 1, len(inputs) - 1)
            given["_tvp", m] = np.concatenate([0.5 * (inputs[k] + inputs[after]), inputs[k]])
        return given

    mhe.set_tvp_fun(parameters)
    mhe.setup()
    mhe.x0 = np.array([1.0, 0, 0, 0, 0, 0, 0, -10.0])
    mhe.set_initial_guess()
    seconds, rolls = [], []
    for k in range(len(inputs)):
        now[0] = k
        started = perf_counter()
        state = mhe.make_step(np.concatenate([measured[k], np.zeros(6)]).reshape(-1, 1)).ravel()
        seconds.append(perf_counter() - started)
        rolls.append(quaternion_to_euler(normalised(state[:4]))[0])
    return _summary(seconds, rolls, truth)
