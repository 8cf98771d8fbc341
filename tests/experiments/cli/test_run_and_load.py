"""`volery.run` and `volery.load`."""

from __future__ import annotations

import doctest
import sys
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
    volery(
        "run", "short.yaml", "--engine", "twin", "--set", "links.loss.bernoulli=0.2", "--no-figures", "--name", "third"
    )
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
    with pytest.raises(BadInput, match="the twin and lockstep run as fast as they can"):
        package.run(fields, engine="twin", speed=2)
    with pytest.raises(BadInput, match="it is not the folder of a run"):
        package.load("runs/none")
    assert not Path("runs").exists()


def test_figures_of_a_loaded_run(own_run: Path) -> None:
    """`plot` draws what it is asked for, shows it in a notebook, and saves it where it is told to."""
    run = package.load(own_run)
    figures = run.plot("links", "estimates")
    assert repr(figures) == "Figures: links, estimates"
    assert figures["links"].axes[0].get_xlabel() == "to agent"
    assert figures._repr_html_().count('<img src="data:image/png;base64,iVBOR') == 2
    assert not (own_run / "figures").exists()
    run.plot("links", out=own_run / "figures", formats=["svg"])
    assert [path.name for path in (own_run / "figures").iterdir()] == ["links.svg"]


def test_what_stands_at_a_prompt_is_short(own_run: Path) -> None:
    """A few lines, not all that was recorded; in a notebook a small table."""
    run = package.load(own_run)
    first, estimate, folder = repr(run).splitlines()
    assert first == "Run short: finished, twin, 4 agents, 1 s"
    assert estimate == "Samples of 'estimate': 19 samples of 4 agents; altitude [m], roll [deg], pitch [deg]"
    assert folder == "folder runs/short"
    html = run._repr_html_()
    assert html.startswith("<b>Run short: finished, twin, 4 agents, 1 s</b><table>")
    assert html.count("<tr>") == 4
    shown = (run.record, run.record.plan, run.record.evaluation, run.metrics, run.samples())
    assert {len(repr(each).splitlines()) for each in shown} == {1}
    assert max(len(repr(each)) for each in shown) < 200


def test_estimates_in_pandas_and_xarray(own_run: Path) -> None:
    """One number a place, in the units of people, which stand beside."""
    seen = package.load(own_run).samples()
    frame = seen.to_dataframe()
    assert list(frame.columns[:5]) == ["time_s", "index", "agent", "altitude", "altitude_oracle"]
    assert frame.attrs["units"] == {"time_s": "s"} | {
        f"{name}{end}": unit
        for name, unit in (("altitude", "m"), ("roll", "deg"), ("pitch", "deg"))
        for end in ("", "_oracle", "_truth")
    }
    of_two = frame[frame.agent == "2"]
    assert np.array_equal(of_two.altitude, seen.estimate[:, 1, 0])
    data = package.load(own_run).to_xarray()
    assert data.attrs == {"quantity": "estimate"}
    assert data["roll"].attrs == {"units": "deg"}
    assert np.array_equal(data["roll"].sel(agent="2"), np.degrees(seen.estimate[:, 1, 1]))
    assert np.array_equal(data.time, seen.time_ns / 1e9)


def test_without_pandas_the_extra_is_named(own_run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What to install, instead of a missing module."""
    seen = package.load(own_run).samples()
    for name in ("pandas", "xarray"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(BadInput, match=r"pandas, which is not installed: pip install 'volery\[data\]'"):
        seen.to_dataframe()
    with pytest.raises(BadInput, match="xarray, which is not installed"):
        seen.to_xarray()
