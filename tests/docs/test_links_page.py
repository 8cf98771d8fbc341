"""docs/links.md: a figure, a command and its numbers for each parameter of a link."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import fields
from io import StringIO
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from volery.experiments.scenario.load import load_scenario
from volery.experiments.scenario.presets import presets
from volery.transport.latency_settings import LATENCIES
from volery.transport.links import LinkSettings
from volery.transport.loss_settings import LOSSES
from volery.transport.media_settings import ACCESSES

from .conftest import DOCS, blocks, typed

PAGE = "links.md"
TEXT = (DOCS / PAGE).read_text("utf-8")
CODE = " ".join(re.findall(r"```.*?```|`[^`\n]*`", TEXT, re.DOTALL))
IN_CODE = {*re.findall(r"[\w-]+", CODE), *re.findall(r"[\w-]+(?:\.\w+)+", CODE)}
FIGURES = re.findall(r"\]\(images/links/(\w+)\.png\)", TEXT)
SMALL_BYTES = 80_000
BASE = {
    "duration": "5 s",
    "topology": {"line": 3},
    "agents": {"kind": "beacon", "talkers": [1]},
    "links": {"rate": "100 kbit/s"},
}


def test_every_parameter_and_model_is_explained() -> None:
    """Fields of links, accesses, models of loss and latency, and presets."""
    names = {
        *(field.name for field in fields(LinkSettings)),
        *ACCESSES.names(),
        *LOSSES.names(),
        *LATENCIES.names(),
        *presets(),
    }
    assert names - IN_CODE == set()


def test_every_figure_has_its_command_and_picture() -> None:
    """One command a figure, in order; every picture is small, and none is left over."""
    assert typed(PAGE) == [f".venv/bin/python docs/links.py {name}" for name in FIGURES]
    pictures = DOCS / "images" / "links"
    assert sorted(picture.stem for picture in pictures.iterdir()) == sorted(FIGURES)
    assert all(0 < picture.stat().st_size < SMALL_BYTES for picture in pictures.iterdir())


@pytest.mark.long
def test_the_page_quotes_what_the_script_prints(tmp_path: Path) -> None:
    """All numbers stand in the page as they are printed, and every figure is drawn."""
    words = [sys.executable, str(DOCS / "links.py"), "all", "--out", str(tmp_path)]
    printed = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    quoted = [line for block in blocks(PAGE, "console") for line in block.splitlines() if not line.startswith("$ ")]
    assert sorted(printed.splitlines()) == sorted(quoted)
    assert sorted(picture.stem for picture in (tmp_path / "links").iterdir()) == sorted(FIGURES)


@pytest.mark.parametrize("fragment", blocks(PAGE, "yaml"))
def test_what_is_shown_can_be_loaded(fragment: str, tmp_path: Path) -> None:
    """Each block in a small scenario of beacons."""
    yaml = YAML(typ="safe")
    text = StringIO()
    yaml.dump(BASE | yaml.load(fragment), text)
    path = tmp_path / "shown.yaml"
    path.write_text(text.getvalue(), "utf-8")
    assert load_scenario(path).plan.name == "shown"
