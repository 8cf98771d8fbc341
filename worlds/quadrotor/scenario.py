"""A quadrotor from the `world:` mapping of a scenario: `kind: quadrotor`."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from ...errors import BadInput
from ...topologies import Position
from ..written import at, check_keys, choice, quantity, required
from ..written_signals import signal
from .flight import Airframe, Manoeuvre
from .quadrotor_sensors import AS_PRINTED, DEVIATIONS, QuadrotorWorld

_KEYS = (
    "kind",
    "roll",
    "pitch",
    "yaw",
    "altitude",
    "sensors",
    "rate",
    "rates",
    "noise",
    "arm",
    "flow_at",
    "as_printed",
)


def build_quadrotor(
    spec: Mapping[str, Any], _positions: Mapping[str, Position], seed: int, agents: Sequence[str] = ()
) -> QuadrotorWorld:
    """A quadrotor with its sensors.

    `sensors: {imu: [gyroscope, accelerometer, magnetometer], flow: flow, …}` says which agent carries what, and is
    needed. `roll`, `pitch`, `yaw` (0) and `altitude` (10 m) are signals that its controller follows. `rate` (100 Hz) is
    that of all sensors, `rates` that of some. `noise` (1) is a factor on Table I, `arm` 0.7 m, `flow_at`
    [0.1 m, 0.05 m, 0 m] the place of the camera, `as_printed` a list of `accelerometer` and `range`.

    Args:
        spec: the mapping, quantities as text with units.
        seed: of the run.
        agents: those of the topology.
    Raises:
        BadInput: with the place of the first thing that is wrong, and the remedy.
    """
    check_keys(spec, _KEYS, "world")
    asked = {name: signal(spec.get(name, 0), "rad", f"world.{name}") for name in ("roll", "pitch", "yaw")}
    altitude = signal(spec.get("altitude", "10 m"), "m", "world.altitude")
    place = spec.get("flow_at", ["0.1 m", "0.05 m", 0])
    if not isinstance(place, Sequence) or isinstance(place, str) or len(place) != 3:
        raise BadInput(f"world.flow_at: {place!r} must be three lengths, as in [0.1 m, 0.05 m, 0 m]")
    x, y, z = (quantity(length, "m", "world.flow_at") for length in place)
    with at("world"):
        carriers = _carriers(required(spec, "sensors", "world"), agents)
        _check_carried(spec, {sensor for carried in carriers.values() for sensor in carried})
        return QuadrotorWorld(
            Manoeuvre(**asked, altitude=altitude),
            carriers,
            seed,
            _rates(spec),
            Airframe(arm=quantity(spec.get("arm", "0.7 m"), "m", "world.arm")),
            _factor(spec.get("noise", 1.0)),
            (x, y, z),
            tuple(_words(spec.get("as_printed", []), AS_PRINTED, "world.as_printed")),
        )


def _carriers(spec: Any, agents: Sequence[str]) -> dict[str, tuple[str, ...]]:
    if not isinstance(spec, Mapping) or not spec:
        raise BadInput("sensors: write at least one agent and what it carries, as in {flow: [flow]}")
    for agent in spec:
        choice(str(agent), agents, "sensors")
    return {str(agent): tuple(_words(carried, DEVIATIONS, f"sensors.{agent}")) for agent, carried in spec.items()}


def _check_carried(spec: Mapping[str, Any], carried: Collection[str]) -> None:
    """Refuse what is said of a sensor that nobody carries."""
    said = [(sensor, f"rates.{sensor}") for sensor in spec.get("rates", {}) if sensor in DEVIATIONS]
    for sensor, place in (*said, *((("flow", "flow_at"),) if "flow_at" in spec else ())):
        if sensor not in carried:
            raise BadInput(f"{place} is of a sensor that no agent carries: leave it out, or add {sensor} to sensors")


def _words(spec: Any, known: Sequence[str] | Mapping[str, Any], place: str) -> list[str]:
    words = [spec] if isinstance(spec, str) else spec
    if not isinstance(words, Sequence):
        raise BadInput(f"{place}: {spec!r} must be a list of {', '.join(known)}")
    for word in words:
        choice(word, tuple(known), place)
    return list(words)


def _rates(spec: Mapping[str, Any]) -> dict[str, float]:
    rates = dict.fromkeys(DEVIATIONS, quantity(spec.get("rate", "100 Hz"), "Hz", "rate"))
    own = spec.get("rates", {})
    if not isinstance(own, Mapping):
        raise BadInput(f"rates: {own!r} must be a mapping, as in {{flow: 50 Hz}}")
    check_keys(own, tuple(DEVIATIONS), "rates")
    return {**rates, **{sensor: quantity(rate, "Hz", f"rates.{sensor}") for sensor, rate in own.items()}}


def _factor(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise BadInput(f"noise: {value!r} must be a plain number, a factor on the noise of Table I")
    return float(value)
