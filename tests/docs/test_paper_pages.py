"""Pages about papers and models, and what belongs to them: their commands, their numbers and their pictures."""

from __future__ import annotations

import runpy
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from .conftest import DOCS, blocks, typed


class Page(NamedTuple):
    """`told`: what its script prints without a figure. `quick`: what takes a moment; `longer`: what takes more."""

    figures: tuple[str, ...]
    quick: tuple[str, ...]
    longer: tuple[str, ...] = ()
    told: tuple[str, ...] = ()
    largest_bytes: int = 250_000


PAGES = {
    "kriegleder": Page(("fig4", "fig5", "fig7", "fig8", "fig9", "async"), ("fig4", "fig7", "fig8")),
    "naegeli": Page(
        ("fig6", "fig7", "burst", "delay", "loss", "nees", "death"), ("algebra", "death"), (), ("algebra",), 310_000
    ),
    "bavle": Page(("fig3", "fig4", "fig5", "tuning", "loss", "lossy"), (), ("lossy",)),
    "betanzos": Page(("fig4", "fig5", "fig6", "gain", "loss", "trust"), ("algebra",), ("fig4",), ("algebra",)),
    "bassolillo": Page(
        ("fig2", "fig3", "fig4", "altitude", "sign", "ranges", "bounds", "bias", "links"), (), ("bounds",)
    ),
    "csma": Page(("throughput", "saturation"), (), ("throughput", "saturation"), largest_bytes=80_000),
}


class OnePicture(NamedTuple):
    """A page with one picture, whose script is as quick as to be run whole."""

    script: str
    parts: tuple[str, ...]
    picture: str
    largest_bytes: int
    is_long: bool = True


ONE_PICTURE = {
    "formation-world": OnePicture(
        "formation_world", ("motion", "view", "passage"), "formation-world.png", 160_000, is_long=False
    ),
    "averages": OnePicture("averages", ("contraction", "one-way"), "averages-one-way.png", 160_000),
    "so3": OnePicture("so3", ("bounds", "noise", "anchor"), "so3-consensus.png", 120_000),
}


def cases(quick: Iterable[Any], longer: Iterable[Any]) -> list[Any]:
    """Parameters of tests, the longer ones marked."""
    return [*map(pytest.param, quick), *(pytest.param(each, marks=pytest.mark.long) for each in longer)]


@pytest.mark.parametrize(
    "name",
    cases(
        (name for name, page in ONE_PICTURE.items() if not page.is_long),
        (name for name, page in ONE_PICTURE.items() if page.is_long),
    ),
)
def test_a_page_with_one_picture_quotes_what_its_script_prints(name: str, tmp_path: Path) -> None:
    """Each part has its command, and its numbers as they are printed; the picture is small and shown."""
    page = ONE_PICTURE[name]
    assert typed(f"{name}.md") == [f".venv/bin/python docs/{page.script}.py {part}" for part in page.parts]
    words = [sys.executable, str(DOCS / f"{page.script}.py"), "all", "--out", str(tmp_path)]
    printed = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    assert printed == "".join(block.partition("\n")[2] for block in blocks(f"{name}.md", "console"))
    assert (tmp_path / page.picture).stat().st_size > 0
    assert f"](images/{page.picture})" in (DOCS / f"{name}.md").read_text("utf-8")
    assert 0 < (DOCS / "images" / page.picture).stat().st_size < page.largest_bytes


@pytest.mark.parametrize("name", PAGES)
def test_every_figure_has_its_command_and_picture(name: str) -> None:
    """One command a figure, in order, whose lines begin with its name; every picture is small and shown."""
    page = PAGES[name]
    asked = (*page.told, *page.figures)
    assert typed(f"{name}.md") == [f".venv/bin/python docs/{name}.py {which}" for which in asked]
    text = (DOCS / f"{name}.md").read_text("utf-8")
    for which, block in zip(asked, blocks(f"{name}.md", "console"), strict=True):
        assert all(line.startswith(f"{which}: ") for line in block.splitlines()[1:])
    for figure in page.figures:
        picture = f"images/{name}-{figure}.png"
        assert f"]({picture})" in text
        assert 0 < (DOCS / picture).stat().st_size < page.largest_bytes


@pytest.mark.parametrize(
    "part",
    cases(
        (f"{name} {which}" for name, page in PAGES.items() for which in page.quick),
        (f"{name} {which}" for name, page in PAGES.items() for which in page.longer),
    ),
)
def test_the_page_quotes_what_the_script_prints(
    part: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The numbers stand in the page as they are printed."""
    name, _, which = part.partition(" ")
    monkeypatch.setattr(sys, "argv", [f"{name}.py", which, "--out", str(tmp_path)])
    monkeypatch.syspath_prepend(str(DOCS))
    runpy.run_path(str(DOCS / f"{name}.py"), run_name="__main__")
    printed = capsys.readouterr().out
    command = f"$ .venv/bin/python docs/{name}.py {which}\n"
    quoted = next(block for block in blocks(f"{name}.md", "console") if block.startswith(command))
    assert printed == quoted.removeprefix(command)
    drawn = {f"{name}-{which}.png"} if which in PAGES[name].figures else set()
    assert {path.name for path in tmp_path.iterdir()} == drawn
