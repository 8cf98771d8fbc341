"""A target from the `world:` mapping of a scenario: `kind: target`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ...errors import BadInput
from ...topologies import Position
from ..written import at, check_keys, choice, quantity
from .target_world import COORDINATES, TargetWorld

_KEYS = ("kind", "rate", "manoeuvre", "noise", "position", "velocity", "sees")
_NOTHING = "nothing"
_CYCLE = (*COORDINATES, _NOTHING)


def build_target(
    spec: Mapping[str, Any], _positions: Mapping[str, Position], seed: int, agents: Sequence[str]
) -> TargetWorld:
    """A target in the plane.

    - `rate: 2 Hz`: of all sensors
    - `manoeuvre: 0.7 m/s/√s`: by how much the velocity wanders, as a standard deviation after one second
    - `noise: 2 m`: of a measurement
    - `position: 10 m`, `velocity: 2 m/s`: standard deviations of where and how fast the target begins
    - `sees: [x, y, nothing]`: what the first, second, third agent sees, and so on round and round; or
      `{1: x, 4: y}`, where all others see nothing

    Args:
        spec: the mapping.
        seed: of the run.
        agents: those of the topology, in natural order.
    Raises:
        BadInput: with the place of the first thing that is wrong, and the remedy.
    """
    check_keys(spec, _KEYS, "world")
    sees = _sees(spec.get("sees", _CYCLE), agents)
    sizes = {
        name: quantity(spec.get(name, default), unit, f"world.{name}")
        for name, default, unit in (
            ("rate", "2 Hz", "Hz"),
            ("manoeuvre", "0.7 m/s/√s", "m/s/√s"),
            ("noise", "2 m", "m"),
            ("position", "10 m", "m"),
            ("velocity", "2 m/s", "m/s"),
        )
    }
    with at("world"):
        return TargetWorld(sees, seed, **sizes)


def _sees(spec: Any, agents: Sequence[str]) -> dict[str, str]:
    place = "world.sees"
    if isinstance(spec, Mapping):
        named = {str(agent): what for agent, what in spec.items()}
        for agent in named:
            if agent not in agents:
                raise BadInput(f"{place}: there is no agent {agent!r}: the topology has {', '.join(agents)}")
    elif isinstance(spec, list | tuple) and spec:
        named = {agent: spec[number % len(spec)] for number, agent in enumerate(agents)}
    else:
        raise BadInput(f"{place}: {spec!r} is neither a list, as [x, y, nothing], nor a mapping, as {{1: x, 4: y}}")
    for agent, what in named.items():
        choice(what, _CYCLE, f"{place}.{agent}" if isinstance(spec, Mapping) else place)
    return {agent: what for agent, what in named.items() if what != _NOTHING}
