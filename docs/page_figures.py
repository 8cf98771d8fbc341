"""The command line that the scripts of pages share: draw a figure, print what it shows."""

# ruff: noqa: T201, TID251 - it prints what it found, and is a user of the package
from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from matplotlib import style
from matplotlib.figure import Figure

from volery.experiments.figures.run_figures import STYLE

Tell = Callable[[], Iterator[str]]
Draw = Callable[[Figure], Iterator[str]]


def draw_asked(
    page: str,
    about: str,
    drawn: Mapping[str, Draw],
    told: Mapping[str, Tell] | None = None,
    *,
    pictures: str | None = None,
    dpi: float | None = None,
) -> None:
    """Draw what the command line asks for into `PAGE-NAME.png`, and print its lines, each after its name.

    Args:
        page: name of the page.
        about: what `--help` says.
        drawn: name → what draws a figure and gives its lines.
        told: name → what gives lines without a figure; these come first.
        pictures: what stands before NAME instead of `PAGE-`, such as the folder `links/`.
        dpi: resolution of the pictures, instead of that of all figures.
    """
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("which", choices=[*(told or {}), *drawn, "all"])
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "images", help="folder of the pictures")
    asked = parser.parse_args()
    for name, tell in (told or {}).items():
        if asked.which in (name, "all"):
            print(*(f"{name}: {line}" for line in tell()), sep="\n", flush=True)
    for name, draw in drawn.items():
        if asked.which in (name, "all"):
            with style.context(STYLE):
                figure = Figure(layout="constrained")
                print(*(f"{name}: {line}" for line in draw(figure)), sep="\n", flush=True)
                picture: Path = asked.out / f"{pictures or f'{page}-'}{name}.png"
                picture.parent.mkdir(parents=True, exist_ok=True)
                figure.savefig(picture, dpi=dpi)
