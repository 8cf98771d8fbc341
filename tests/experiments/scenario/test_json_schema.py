"""The JSON Schema of scenarios: an editor accepts what volery accepts, and refuses what volery refuses."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from volery.errors import BadInput
from volery.experiments.scenario.explaining import read
from volery.experiments.scenario.library import new_scenario_text, scenario_text
from volery.experiments.scenario.load import load_scenario, resolved_yaml
from volery.experiments.scenario.schema import Scenario, json_schema
from volery.experiments.scenario.yaml_document import parse

from ...surroundings import BUILT_IN
from .conftest import TEXT
from .test_resolved import EVERY_FAULT

PLANE = "world: {kind: plane, altitude: 0.2 m"


@cache
def validator() -> Draft202012Validator:
    """Of the schema, as an editor gets it."""
    schema = json.loads(json.dumps(json_schema()))
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


def refused(text: str) -> list[str]:
    """What a validator says against a scenario."""
    data = parse(text, "a scenario")
    return [f"{error.json_path}: {error.message[:200]}" for error in validator().iter_errors(data)]


@pytest.mark.parametrize("name", BUILT_IN)
def test_built_in_scenarios_are_valid(name: str) -> None:
    """As they are written, and as they are resolved, with every default."""
    assert refused(scenario_text(name)) == []
    assert refused(resolved_yaml(load_scenario(name).scenario)) == []


GOOD = {
    "template": new_scenario_text("mine"),
    "example": TEXT,
    "faults": f"{TEXT}{EVERY_FAULT}",
    "flat": TEXT.replace("{line: 3}", "{line: 3, spacing: 0.5}"),
    "grid": TEXT.replace("{line: 3}", "{grid: [2, 3], spacing: 2 m}"),
    "schedule": TEXT.replace("{line: 3}", "{schedule: [{from: 0 s, ring: 6}, {from: 1 s, edges: [1-2, 2-3]}]}"),
    "spans": TEXT.replace("{line: 3}", "{edges: {1-2: always, 2-3: [[0 s, 2 s], [5 s]]}}"),
    "proximity": TEXT.replace("{line: 3}", "{proximity: 30 m}"),
    "preset": TEXT.replace(
        "  overhead: 4 B", "  preset: lora\n  only: [{where: 1, preset: lora, medium: {access: csma}}]"
    ),
    "steps": f"{TEXT}{PLANE}, pitch: {{steps: {{0 s: 0}}}}}}",
    "ramp": f"{TEXT}{PLANE}, roll: {{ramp: {{from: 0, to: 5 deg, at: 1 s, over: 2 s}}}}}}",
    "losses": TEXT.replace("loss: {gil", "corruption: [0.1, {bernoulli: 0.1}, {trace: loss.csv}]\n  loss: {gil"),
    "own class": TEXT.replace("rate: 20 Hz", "anything: {at: all}"),
}


@pytest.mark.parametrize("text", GOOD.values(), ids=GOOD)
def test_every_notation_is_valid(text: str) -> None:
    """Short forms, changing graphs, presets, signals, models, faults, and parameters of a class of one's own."""
    assert refused(text) == []


def changed(old: str, new: str) -> str:
    """The example, with the parameters of a kind that the schema knows, and something wrong."""
    beacons = TEXT.replace("tiny_agents:Talker", "beacon")
    assert old in beacons
    return beacons.replace(old, new)


def added(line: str) -> str:
    """The example with another line."""
    return changed("links:\n", f"{line}\nlinks:\n")


WRONG = {
    "unknown field at the top": added("sed: 3"),
    "seed below 0": changed("seed: 7", "seed: -1"),
    "seed that is text": changed("seed: 7", "seed: seven"),
    "duration without a unit": changed("10 s", "10"),
    "duration in metres": changed("10 s", "10 m"),
    "no duration": changed("duration: 10 s\n", ""),
    "truth value that is text": added("overload: yes please"),
    "topology that is text": changed("{line: 3}", "line"),
    "unknown topology": changed("{line: 3}", "{lime: 3}"),
    "topology of two kinds": changed("{line: 3}", "{line: 3, ring: 3}"),
    "count that is text": changed("{line: 3}", "{line: three}"),
    "count of 0": changed("{line: 3}", "{line: 0}"),
    "unknown field beside a topology": changed("{line: 3}", "{line: 3, spacings: 1 m}"),
    "unknown field below a topology": changed("{line: 3}", "{line: {count: 3, side: 1 m}}"),
    "grid of one number": changed("{line: 3}", "{grid: 3}"),
    "cells of three numbers": changed("{line: 3}", "{cells: [[0, 0, 0], [1, 0, 0]]}"),
    "probability above 1": changed("{line: 3}", "{erdos-renyi: {count: 9, probability: 2}}"),
    "topology without a radius": changed("{line: 3}", "{geometric: {count: 5}}"),
    "epoch without a begin": changed("{line: 3}", "{schedule: [{line: 3}]}"),
    "span of three instants": changed("{line: 3}", "{edges: {1-2: [[0 s, 1 s, 2 s]]}}"),
    "no kind of agents": changed("kind: beacon\n  ", ""),
    "unknown kind of agents": changed("beacon", "becon"),
    "unknown parameter of agents": changed("  rate: 20 Hz", "  raet: 20 Hz"),
    "parameter of another kind": changed("  rate: 20 Hz", "  rounds: 3"),
    "parameter in another unit": changed("  rate: 20 Hz", "  rate: 20 ms"),
    "rate below 0": changed("  rate: 20 Hz", "  rate: -20 Hz"),
    "rounds below 1": added("  x: 1").replace("kind: beacon", "kind: dfa-module").replace("  x: 1", "  rounds: 0"),
    "share of a processor above 1": changed("cut: 1-2", "hog: 2, share: 2"),
    "choice that is none": changed("  rate: 20 Hz", "  pattern: erratic"),
    "unknown medium": changed("kind: half-duplex", "kind: half-dupleks"),
    "unknown access": changed("tdma:", "tmda:"),
    "field of an access": changed("cycle: 60 Hz", "cycles: 60 Hz"),
    "rate in bytes": changed("115.2 kbit/s", "115.2 kB"),
    "unknown latency": changed("{normal: {mean", "{gama: {mean"),
    "latency without a mean": changed("mean: 2 ms, ", ""),
    "two losses in one": changed("{bernoulli: 0.5}", "{bernoulli: 0.5, markov: {mean_up: 1 s, mean_down: 1 s}}"),
    "loss above 1": changed("{bernoulli: 0.5}", "{bernoulli: 1.5}"),
    "probability below 0": changed("to_bad: 0.05", "to_bad: -0.05"),
    "unknown preset": changed("  overhead: 4 B", "  preset: lorra"),
    "override without a place": changed("  overhead: 4 B", "  only: [{loss: 0.5}]"),
    "overhead in bits": changed("overhead: 4 B", "overhead: 32 bit"),
    "queue without room": changed("  overhead: 4 B", "  queue: {limit: 0}"),
    "rate of 0": changed("  rate: 20 Hz", "  rate: 0.00 kHz"),
    "rate of 0 without a unit": changed("  rate: 20 Hz", "  rate: 0"),
    "duration below 0": changed("10 s", "-10 s"),
    "duration of 0": changed("10 s", "0 min"),
    "link of 0 bit/s": changed("115.2 kbit/s", "0 bit/s"),
    "latency below 0": changed("mean: 2 ms", "mean: -2 ms"),
    "correlation of 1": changed("mean: 2 ms", "correlation: 1, mean: 2 ms"),
    "slot below 0": changed("guard: 0.2 ms", "guard: -1 ms"),
    "backoff exponent above 30": changed(
        "per: edge, access: {tdma: {cycle: 60 Hz, guard: 0.2 ms}}",
        "per: node, access: {csma: {max_be: 31}}",
    ),
    "part of a medium without a preset": changed("kind: half-duplex, per: edge, access", "access"),
    "part of a bucket without a preset": changed("  overhead: 4 B", "  bucket: {rate: 1 kbit/s}"),
    "part of a bucket in a fault": changed("{loss: {bernoulli: 0.5}}", "{bucket: {rate: 1 kbit/s}}"),
    "fault of two kinds": changed("cut: 1-2", "cut: 1-2, kill: 3"),
    "fault of no kind": changed(", cut: 1-2", ""),
    "fault without a start": changed("at: 3 s, until: 4 s, cut", "until: 4 s, cut"),
    "fault that ends twice": changed("until: 4 s, cut", "until: 4 s, for: 1 s, cut"),
    "detail of another fault": changed("cut: 1-2", "cut: 1-2, share: 0.5"),
    "settings without a place": changed("where: all, ", ""),
    "sensor without a trouble": changed("cut: 1-2", "sensor: 2.distance"),
    "sensor with two troubles": changed("cut: 1-2", "sensor: 2.distance, failed: true, stuck: true"),
    "clock that is right": changed("cut: 1-2", "clock: 2"),
    "formation of two shapes": added("world: {kind: formation, start: {ring: 1 m, line: 1 m}}"),
    "formation of no shape": added("world: {kind: formation, start: {turned: 90 deg}}"),
    "formation without extent": added("world: {kind: formation, start: {ring: 0 m}}"),
    "unknown field of a fault": changed("cut: 1-2", "cuts: 1-2"),
    "setting of a link that is none": changed("set: {loss", "set: {los"),
    "sensor fault that is text": changed("cut: 1-2", "sensor: 2.distance, bias: much"),
    "fault that is false": changed("cut: 1-2", "sensor: 2.distance, stuck: 3"),
    "random fraction above 1": changed("cut: 1-2", "cut: {random: 2}"),
    "no kind of world": added("world: {altitude: 0.2 m}"),
    "unknown kind of world": added("world: {kind: plain}"),
    "world without an altitude": added("world: {kind: plane}"),
    "unknown field of a world": added(f"{PLANE}, rol: 5 deg}}"),
    "angle in metres": added(f"{PLANE}, roll: 5 m}}"),
    "unknown signal": added(f"{PLANE}, roll: {{step: {{0 s: 0}}}}}}"),
    "sine without a frequency": added(f"{PLANE}, roll: {{sine: {{amplitude: 1 deg}}}}}}"),
    "camera with an unknown field": added("world: {kind: formation, start: {ring: 1 m}, camera: {fov: 60 deg}}"),
    "shape that is none": added("world: {kind: formation, start: {rng: 1 m}}"),
    "sensor that is none": added("world: {kind: quadrotor, sensors: {1: [gyroscop]}}"),
    "obstacle that is none": added(
        "world: {kind: altitude, flight: {waypoints: [[0, 0], [1 m, 0]]}, sensors: {1: imu}, obstacles: [{sofa: {}}]}"
    ),
    "three moments of which one is missing": added(
        "world: {kind: rigid-body, units: {1: {}}, inertia: [1 kg m², 1 kg m²]}"
    ),
}


@pytest.mark.parametrize("text", WRONG.values(), ids=WRONG)
def test_what_is_wrong_is_refused_by_both(text: str, tmp_path: Path) -> None:
    """By a validator that knows the schema, and by volery, which names the place."""
    assert refused(text) != []
    path = tmp_path / "wrong.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(BadInput, match=r"wrong\.yaml:\d+:\d+: \w+"):
        load_scenario(path)


def _open_objects(node: Any, place: str = "") -> list[str]:
    """Where anything may be written."""
    if isinstance(node, dict):
        own = [place] if node.get("additionalProperties") is True else []
        return own + [found for key, child in node.items() for found in _open_objects(child, f"{place}/{key}")]
    if isinstance(node, list):
        return [found for index, child in enumerate(node) for found in _open_objects(child, f"{place}/{index}")]
    return []


def test_nothing_is_open_but_parameters_of_a_class_of_ones_own() -> None:
    """All others know all their fields."""
    assert all("OwnKind" in place for place in _open_objects(json_schema()))
    assert json_schema()["required"] == ["duration", "topology", "agents"]


def test_fields_are_described_with_their_units_and_bounds() -> None:
    """An editor shows what a field means, and what may be written."""
    plane = json_schema()["$defs"]["PlaneSettings"]["properties"]
    assert plane["rate"]["description"] == "of all sensors."
    assert plane["rate"]["default"] == "20 Hz"
    text, nothing = plane["rate"]["anyOf"]
    assert text["description"] == "number and unit: mHz, Hz, kHz"
    assert (nothing, plane["rate"]["exclusiveMinimum"]) == ({"const": 0}, 0.0)
    duplication = json_schema()["$defs"]["Links"]["properties"]["duplication"]
    assert (duplication["minimum"], duplication["maximum"]) == (0.0, 1.0)


def test_a_value_of_an_annotated_type_names_its_place() -> None:
    """What tests, documents and live faults read goes through the same types."""
    with pytest.raises(BadInput, match=r"^seed: seed is -1, it must be at least 0; duration: is missing; "):
        read(Scenario, {"name": "x", "seed": -1})
