"""docs/scenario.md names every field that a scenario may have, and everything that it shows can be loaded."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import fields
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from volery import topologies
from volery.agents.altitude.altitude_ekf_settings import AltitudeEkfParameters
from volery.agents.attitude.attitude_unit_settings import AttitudeParameters
from volery.agents.beacon import BeaconParameters
from volery.agents.dfa.dfa_settings import DfaParameters
from volery.agents.dfa.kalman import DfaKalmanParameters
from volery.agents.fusion.tracker import TrackerParameters
from volery.agents.mav.mav_settings import Filtering, Frames, Leg, MavParameters, Messages
from volery.agents.mhe.mhe_settings import MheParameters
from volery.agents.sensor_node import SensorNodeParameters
from volery.errors import BadInput
from volery.estimators.altitude.components import Barometer, Ground, Imu, RangeFinder, Robot
from volery.estimators.altitude.modular_filter import GroundJumps
from volery.estimators.horizon.quadrotor_model import Deviations
from volery.experiments.scenario.link_schema import ACCESSES
from volery.experiments.scenario.load import json_schema, load_scenario
from volery.worlds.scenario import build

from .conftest import DOCS, blocks

PAGE = "scenario.md"
TEXT = (DOCS / PAGE).read_text("utf-8")
EXAMPLE, *FRAGMENTS = blocks(PAGE, "yaml")
CODE = " ".join(re.findall(r"```.*?```|`[^`\n]*`", TEXT, re.DOTALL))
IN_CODE = {*re.findall(r"[\w-]+", CODE), *re.findall(r"[\w-]+(?:\.\w+)+", CODE)}


KINDS = (
    AltitudeEkfParameters,
    AttitudeParameters,
    Barometer,
    BeaconParameters,
    Deviations,
    DfaKalmanParameters,
    DfaParameters,
    Ground,
    GroundJumps,
    Imu,
    Filtering,
    Frames,
    Leg,
    MavParameters,
    Messages,
    MheParameters,
    RangeFinder,
    Robot,
    SensorNodeParameters,
    TrackerParameters,
)
"""What kinds of agents have as parameters, and what stands in those."""


def schema_names(node: Any) -> Iterator[str]:
    """Every name of a field, and every word to choose from, in a JSON Schema."""
    if isinstance(node, dict):
        yield from node.get("properties", ())
        yield from (word for word in node.get("enum", ()) if isinstance(word, str))
        for child in node.values():
            yield from schema_names(child)
    elif isinstance(node, list):
        for child in node:
            yield from schema_names(child)


def known(message: str) -> list[str]:
    """The names that an error message lists: those that are known, in parentheses, or after the words `one of`."""
    return re.split(r", | and ", re.split(r"one of |\(known: ", message)[-1].removesuffix(")"))


def test_every_field_of_the_schema_is_explained() -> None:
    """Fields and choices of the JSON Schema, of slots, and of the module's parameters stand in the page as code."""
    names = {
        *schema_names(json_schema()),
        *(field.name for kind in KINDS for field in fields(kind)),
    }
    names |= {*ACCESSES, *(field.name for access in ACCESSES.values() for field in fields(access))}
    assert len(names) > 50
    assert names - IN_CODE == set()


def told(build: Callable[..., Any], *asked: Any) -> list[str]:
    """The names in the message with which a reader refuses what it is asked for."""
    with pytest.raises(BadInput) as refused:
        build(*asked)
    return known(str(refused.value))


def test_every_topology_is_explained() -> None:
    """What the reader of `topology:` knows, by what it says when it is asked for something else."""
    kinds = told(topologies.build, {}, 0)
    assert len(kinds) == 14
    assert set(kinds) - IN_CODE == set()


def test_every_shape_of_a_formation_is_explained() -> None:
    """What the reader of formations knows, likewise."""
    shapes = told(topologies.formation, {"qqqq": 1}, 2)
    assert len(shapes) == 9
    assert set(shapes) - IN_CODE == set()


START = {"start": {"line": "1 m"}}
FLIGHT = {"flight": {"waypoints": [[0, 0], ["1 m", 0]]}}


@pytest.mark.parametrize(
    ("spec", "count"),
    [
        ({"kind": "plane", "qqqq": 1}, 8),
        ({"kind": "moving", "qqqq": 1}, 5),
        ({"kind": "quadrotor", "qqqq": 1}, 12),
        ({"kind": "quadrotor", "sensors": {"a": "qqqq"}}, 9),
        ({"kind": "target", "qqqq": 1}, 7),
        ({"kind": "rigid-body", "qqqq": 1}, 7),
        ({"kind": "rigid-body", "units": {"a": {"qqqq": 1}}}, 3),
        ({"kind": "formation", "qqqq": 1}, 15),
        ({"kind": "formation", **START, "vehicle": {"qqqq": 1}}, 9),
        ({"kind": "formation", **START, "camera": {"qqqq": 1}}, 9),
        ({"kind": "formation", **START, "imu": {"qqqq": 1}}, 9),
        ({"kind": "formation", **START, "turbulence": {"qqqq": 1}}, 3),
        ({"kind": "formation", **START, "gusts": {"qqqq": 1}}, 3),
        ({"kind": "formation", **START, "gusts": [{"qqqq": 1}]}, 3),
        ({"kind": "altitude", "qqqq": 1}, 4),
        ({"kind": "altitude", "flight": {"qqqq": 1}}, 9),
        ({"kind": "altitude", **FLIGHT, "obstacles": [{"qqqq": {}}]}, 3),
        ({"kind": "altitude", **FLIGHT, "obstacles": [{"table": {"qqqq": 1}}]}, 4),
        ({"kind": "altitude", **FLIGHT, "sensors": {"a": "qqqq"}}, 3),
        ({"kind": "altitude", **FLIGHT, "sensors": {"a": {"imu": {"qqqq": 1}}}}, 7),
        ({"kind": "altitude", **FLIGHT, "sensors": {"a": {"barometer": {"qqqq": 1}}}}, 6),
        ({"kind": "altitude", **FLIGHT, "sensors": {"a": {"range": {"qqqq": 1}}}}, 4),
    ],
)
def test_every_world_is_explained(spec: dict[str, Any], count: int) -> None:
    """What the readers of `world:` know, likewise."""
    names = told(build, spec, {"1": (0.0, 0.0)}, 0, ["a", "b"])
    assert len(names) == count
    assert set(names) - IN_CODE == set()


@pytest.mark.parametrize("fragment", [{}, *FRAGMENTS], ids=range(len(FRAGMENTS) + 1))
def test_what_is_shown_can_be_loaded(fragment: str, tmp_path: Path) -> None:
    """The example as it stands, and with each of the other blocks in its place."""
    yaml = YAML(typ="safe")
    changed = yaml.load(EXAMPLE) | (yaml.load(fragment) if fragment else {})
    text = StringIO()
    yaml.dump(changed, text)
    path = tmp_path / "example.yaml"
    path.write_text(text.getvalue() if fragment else EXAMPLE, "utf-8")
    assert load_scenario(path).plan.name == "example"


def test_the_error_that_is_shown(tmp_path: Path) -> None:
    """The page's example of a message is what volery says."""
    (scenario,) = blocks("own-agent.md", "yaml")
    path = tmp_path / "room.yaml"
    path.write_text(scenario.replace("latency", "latncy").replace("my_agent:Thermometer, rate: 20 Hz", "dfa-module"))
    (said,) = re.findall(r"`(room\.yaml:.*?)`", TEXT, re.DOTALL)
    with pytest.raises(BadInput) as refused:
        load_scenario(path)
    assert str(refused.value).removeprefix(f"{tmp_path}/") == " ".join(said.split())
