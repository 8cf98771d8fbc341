"""Loss and latency models of users' own in scenarios: how they are named, read, overridden, written and refused."""

from __future__ import annotations

import json
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator
from ruamel.yaml import YAML

from volery.agents.plan import Plan
from volery.agents.plan_codec import Opaque, decode_plan, encode_plan
from volery.errors import BadInput
from volery.experiments.scenario.fault_labels import fault_label
from volery.experiments.scenario.load import load_scenario, resolved_yaml
from volery.experiments.scenario.schema import json_schema
from volery.experiments.sweeps.sweep_plan import plan_sweep
from volery.kinds import _added

MS = 1_000_000
MODULE = '''
"""Models for the tests."""

from dataclasses import dataclass

from volery.transport.link_models import LatencyModel, LossModel
from volery.units import Metres, Nanoseconds, Probability


@dataclass(frozen=True)
class Fading(LossModel):
    reach: Metres
    floor: Probability = 0.0


class Fog(LossModel):
    pass


@dataclass(frozen=True)
class Relay(LatencyModel):
    least: Nanoseconds

    @property
    def minimum_ns(self):
        return self.least
'''
SCENARIO = """
name: air
duration: 2 s
topology: {line: 3}
agents: {kind: beacon}
links: {loss: [0.1, {"air_links.models:Fading": {reach: 30 m}}], latency: {"air_links.models:Relay": 5 ms}}
faults: [{at: 1 s, where: 1-2, set: {loss: "air_links.models:Fog"}}]
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with the scenario and a package of models."""
    package = tmp_path / "air_links"
    package.mkdir()
    (package / "__init__.py").write_text("", "utf-8")
    (package / "models.py").write_text(MODULE, "utf-8")
    (package / "broken.py").write_text(
        "import volery.transport.link_models as models\nclass X(models.LossModel):\n    mean: float\n", "utf-8"
    )
    (tmp_path / "air.yaml").write_text(SCENARIO, "utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path


def plan_of(*overrides: str) -> Plan:
    """Of the scenario."""
    return load_scenario("air.yaml", overrides).plan


def fading(plan: Plan) -> tuple[float, float]:
    """Reach and floor of the last loss model of a link."""
    model = plan.links["1", "2"].loss[-1]
    return getattr(model, "reach"), getattr(model, "floor")  # noqa: B009 - a class of the file above


def test_models_stand_in_lists_and_faults_alone_or_with_fields() -> None:
    """As built-in ones do, with units; what is written back reads equal, and a validator of the schema accepts it."""
    loaded = load_scenario("air.yaml")
    settings, (fault,) = loaded.plan.links["1", "2"], loaded.plan.faults
    assert [type(model).__name__ for model in settings.loss] == ["Bernoulli", "Fading"]
    assert (fading(loaded.plan), settings.lookahead_ns()) == ((30.0, 0.0), 5 * MS)
    assert fault_label(fault, 4) == "loss Fog 1–2"
    text = resolved_yaml(loaded.scenario)
    Path("again.yaml").write_text(text, "utf-8")
    assert load_scenario("again.yaml").scenario == loaded.scenario
    validator = Draft202012Validator(json.loads(json.dumps(json_schema())))
    for each in (SCENARIO, text):
        assert not list(validator.iter_errors(YAML(typ="safe", pure=True).load(each)))
    assert list(validator.iter_errors(YAML(typ="safe", pure=True).load(SCENARIO.replace("models:F", "models F"))))


def test_overrides_reach_parameters_of_models_in_packages() -> None:
    """The dots in a module's name separate no fields; another model takes the place of the first."""
    path = "links.loss.air_links.models:Fading"
    assert fading(plan_of(f"links.loss={{'{path[11:]}': {{reach: 30 m}}}}", f"{path}.floor=0.2")) == (30.0, 0.2)
    assert fading(plan_of("links.loss.1.air_links.models:Fading.reach=40 m")) == (40.0, 0.0)
    assert fading(plan_of(f"{path}.reach=50 m")) == (50.0, 0.0)
    assert plan_of("links.latency.air_links.models:Relay.least=7 ms").links["1", "2"].lookahead_ns() == 7 * MS


def test_a_package_gives_its_models_short_names(monkeypatch: pytest.MonkeyPatch) -> None:
    """By entry points, one group for losses and one for latencies."""
    points = {
        "volery.losses": [EntryPoint("fading", "air_links.models:Fading", "volery.losses")],
        "volery.latencies": [EntryPoint("relay", "air_links.models:Relay", "volery.latencies")],
    }
    monkeypatch.setattr("volery.kinds.entry_points", lambda group: points.get(group, []))
    _added.cache_clear()
    try:
        plan = plan_of("links.loss={fading: 25 m}", "links.latency={relay: {least: 3 ms}}")
    finally:
        _added.cache_clear()
    assert (fading(plan), plan.links["1", "2"].lookahead_ns()) == ((25.0, 0.0), 3 * MS)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        (
            "links.loss=air_link:Fog",
            "links.loss: loss model 'air_link:Fog' cannot be loaded: .*No module named",
        ),
        ("links.loss=air_links.models:Frog", "'air_links.models:Frog' cannot be loaded: .* no attribute 'Frog'"),
        ("links.loss={'air_links.models:Relay': 5 ms}", "not a subclass of volery.transport.link_models.LossModel"),
        ("links.loss=air_links.broken:X", "'air_links.broken:X' cannot be loaded: .*X.mean is a member of its base"),
        (
            "links.loss.air_links.models:Fading.rech=3 m",
            r"rech: unknown field \(did you mean 'reach'\?\)",
        ),
        ("links.loss.air_links.models:Fading.reach=3", r"Fading\.reach: .*3 has no unit"),
        ("links.loss.1.air_links.models:Fading.floor=1.5", "floor is 1.5, it must be at least 0 and at most 1"),
        ("links.loss.1.air_links.models:Fading.floor=.nan", "floor is nan, it must be at least 0 and at most 1"),
        ("links.loss=air_links.models:Fading", "reach: is missing"),
        ("links.latency={'air_links.models:Relay': -5 ms}", r"links\.latency: .*:Relay: minimum_ns is -5000000"),
        ("links.loss=fodding", "unknown loss model 'fodding' .*, or write package.module:Class"),
    ],
)
def test_what_is_wrong_is_refused_at_its_place(override: str, message: str) -> None:
    """Unknown modules and classes, others than models, wrong parameters, and numbers outside their bounds."""
    with pytest.raises(BadInput, match=message) as refusal:
        plan_of(override)
    assert str(refusal.value).startswith("--set links.l")


def test_readers_of_a_plan_import_no_model() -> None:
    """They get its class by name; faults are labelled alike."""
    plan = plan_of()
    read = decode_plan(encode_plan(plan), only_read=True)
    models: tuple[object, ...] = read.links["1", "2"].loss
    assert models[1] == Opaque("air_links.models:Fading", {"reach": 30.0, "floor": 0.0})
    assert len({read.links["1", "2"], read.links["2", "1"]}) == 1
    assert fault_label(read.faults[0], 4) == fault_label(plan.faults[0], 4)
    assert decode_plan(encode_plan(plan)) == plan


def test_a_sweep_goes_over_parameters_of_a_model() -> None:
    """Its results depend on the file of the model."""
    sweep = plan_sweep("air.yaml", [], ["links.loss.1.air_links.models:Fading.reach=25 m,40 m"], None, "twin")
    assert [fading(one.plan)[0] for one in sweep.loaded] == [25.0, 40.0]
    assert "air_links.models" in sweep.made_with["modules"]
