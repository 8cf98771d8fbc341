"""`volery.run` and `volery.load`."""

from __future__ import annotations

import doctest
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

import volery as package
from volery.errors import BadInput
from volery.experiments import python_api

from .conftest import SCENARIO, Volery


def test_example_of_the_docstring(volery: Volery) -> None:
    """The example in `volery.run` is true."""
    assert volery is not None
    assert doctest.testmod(python_api) == doctest.TestResults(failed=0, attempted=8)


def test_a_mapping_is_a_scenario_like_its_file(volery: Volery) -> None:
    """The same fields as mapping, as file and over the command line give the same run, bit for bit."""
    fields = YAML(typ="safe", pure=True).load(SCENARIO)
    of_mapping = package.run(fields, engine="twin", overrides=["links.loss.bernoulli=0.2"])
    of_file = package.run("short.yaml", engine="twin", overrides=["links.loss.bernoulli=0.2"])
    volery("run", "short.yaml", "--engine", "twin", "--set", "links.loss.bernoulli=0.2", "--name", "third")
    for other in (of_file, package.load("runs/third")):
        assert np.array_equal(of_mapping.samples().estimate, other.samples().estimate, equal_nan=True)
        assert of_mapping.frames["fate"].tolist() == other.frames["fate"].tolist()
    assert set(of_mapping.frames["fate"].tolist()) == {"delivered", "loss", "cut"}
    assert of_mapping.problems == ()
    assert of_mapping.quantities == ("estimate",)


def test_paths_in_a_mapping_start_here(volery: Volery) -> None:
    """A graph's file is found from the working directory, and again when the run is loaded."""
    assert volery is not None
    Path("graph.json").write_text('{"edges": [["1", "2"], ["2", "3"], ["1", "3"]]}', "utf-8")
    with pytest.raises(BadInput) as caught:
        package.run({"duration": "1 s", "topology": {"file": "grph.json"}, "agents": {"kind": "dfa-module"}})
    assert str(Path("grph.json").resolve()) in str(caught.value)


def test_bad_input_is_raised_and_leaves_nothing(volery: Volery) -> None:
    """Fields that do not exist, values that are no data, an option that does not fit, a run that is not there."""
    assert volery is not None
    fields = YAML(typ="safe", pure=True).load(SCENARIO)
    with pytest.raises(BadInput, match="did you mean 'duration'"):
        package.run({**fields, "durations": "1 s"}, engine="twin")
    with pytest.raises(BadInput, match=r"world: <object object at .*> has no place in a scenario"):
        package.run({**fields, "world": object()}, engine="twin")
    with pytest.raises(BadInput, match="realtime pace only"):
        package.run(fields, engine="twin", speed=2)
    with pytest.raises(BadInput, match="cannot be read"):
        package.load("runs/none")
    assert not Path("runs").exists()


def test_figures_of_a_loaded_run(own_run: Path) -> None:
    """`plot` draws what it is asked for and says where."""
    assert package.load(own_run).plot("links", formats=["svg"]) == [own_run / "figures/links.svg"]
