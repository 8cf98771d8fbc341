"""Parts of pages that take long, shortened: fewer points, the first lines; what is left is as the page quotes it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import islice
from types import ModuleType
from typing import Any, NamedTuple

import pytest
from matplotlib.figure import Figure

from volery.topologies import complete, ring, star

from .conftest import DOCS

LINKS_AT_LENGTH = {"loss", "time_loss", "distance", "latency"}


class Part(NamedTuple):
    """A part of a page by script and name; how many of a constant's entries are kept, and how many lines are told."""

    script: str
    name: str
    tell: Callable[[ModuleType], Iterator[str]]
    kept: dict[str, int]
    lines: int | None = None


PARTS = (
    Part("csma", "throughput", lambda csma: csma.throughput(Figure()), {"LOADS": 1}),
    Part("csma", "saturation", lambda csma: csma.saturation(Figure()), {"COUNTS": 1}),
    Part("averages", "contraction", lambda averages: averages.contractions(), {"GRAPHS": 1}),
    Part("averages", "one-way", lambda averages: averages.figure(Figure()), {"LOOKS": 2}),
    Part("so3", "bounds", lambda so3: so3.bounds(Figure().subplots()), {}),
    Part("so3", "noise", lambda so3: so3.noise(Figure().subplots()), {"GRAPHS": 1}),
    Part("bavle", "lossy", lambda bavle: bavle.lossy(Figure()), {}, 1),
    Part("betanzos", "fig4", lambda betanzos: betanzos.fig4(Figure()), {}),
    Part("bassolillo", "bounds", lambda bassolillo: bassolillo.bounds(Figure()), {}, 2),
)


@pytest.mark.parametrize("part", PARTS, ids=[f"{part.script} {part.name}" for part in PARTS])
def test_what_is_left_of_a_part_is_as_the_page_quotes_it(
    part: Part, script: Callable[[str], ModuleType], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Line by line."""
    module = script(part.script)
    for name, count in part.kept.items():
        entries: Any = getattr(module, name)
        kept = list(islice(entries.items() if isinstance(entries, dict) else entries, count))
        monkeypatch.setattr(module, name, type(entries)(kept))
    quoted = (DOCS / f"{part.script}.md").read_text("utf-8").splitlines()
    prefix = "" if part.script == "so3" else f"{part.name}: "
    told = [prefix + line for line in islice(part.tell(module), part.lines)]
    assert told
    assert [line for line in told if line not in quoted] == []


def test_figures_of_links_that_take_a_moment(script: Callable[[str], ModuleType]) -> None:
    """All but four: the lines are those of the page."""
    quoted = (DOCS / "links.md").read_text("utf-8").splitlines()
    drawn = {name: draw for name, draw in script("links").DRAWN.items() if name not in LINKS_AT_LENGTH}
    told = [f"{name}: {line}" for name, draw in drawn.items() for line in draw(Figure())]
    assert len(told) > len(drawn) > 10
    assert [line for line in told if line not in quoted] == []


@pytest.mark.parametrize("count", [3, 8])
def test_normalised_connectivity_in_closed_form(count: int, script: Callable[[str], ModuleType]) -> None:
    """Complete graph: N/(N − 1). Star: 1. Ring: 1 − cos(2π/N)."""
    expected = {complete: count / (count - 1), star: 1.0, ring: 1 - math.cos(2 * math.pi / count)}
    connectivity = script("kriegleder").normalised_connectivity
    assert {make: connectivity(make(count)) for make in expected} == pytest.approx(expected, abs=1e-12)
