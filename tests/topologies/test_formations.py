"""Reference shapes of formations."""

from __future__ import annotations

import math
from itertools import combinations
from typing import Any

import numpy as np
import pytest

from volery.errors import BadInput

from ..surroundings import build_formation as formation

ROUNDING = 1e-12


def nearest(places: np.ndarray) -> float:
    """The smallest distance of two places."""
    return min(math.dist(a, b) for a, b in combinations(places.tolist(), 2))


@pytest.mark.parametrize(
    ("spec", "count"),
    [
        ({"triangle": "0.9 m"}, 3),
        ({"line": "0.9 m"}, 2),
        ({"line": "0.9 m"}, 7),
        ({"ring": "90 cm"}, 3),
        ({"ring": "0.9 m"}, 9),
        ({"grid": "0.9 m"}, 2),
        ({"grid": "0.9 m"}, 30),
        ({"vee": "0.9 m"}, 8),
        ({"places": [["0 m", "0 m", "0 m"], ["0.9 m", "0 m"], [0, 2.5, 1.5]]}, 3),
    ],
)
def test_a_shape_has_its_number_its_spacing_and_its_centroid(spec: dict[str, Any], count: int) -> None:
    """N places of three coordinates, the nearest two one length apart, about the origin."""
    places = formation(spec, count)
    assert places.shape == (count, 3)
    assert nearest(places) == pytest.approx(0.9, abs=ROUNDING)
    assert places.mean(axis=0) == pytest.approx(np.zeros(3), abs=ROUNDING)


def test_the_triangle_is_equilateral_with_the_first_ahead() -> None:
    """All sides alike, anticlockwise from the vehicle that is furthest along x."""
    places = formation({"triangle": "0.9 m"}, 3)
    assert [math.dist(a, b) for a, b in combinations(places.tolist(), 2)] == pytest.approx([0.9] * 3)
    assert places[0] == pytest.approx([0.9 / math.sqrt(3), 0.0, 0.0])
    assert places[1, 1] > 0.0 > places[2, 1]


def test_a_vee_points_ahead_with_arms_at_a_right_angle() -> None:
    """The first is at the tip, the others by turns on the left and on the right, 45 degrees back."""
    places = formation({"vee": "1 m"}, 5)
    arms = places[1:] - places[0]
    assert np.degrees(np.arctan2(arms[:, 1], arms[:, 0])) == pytest.approx([135.0, -135.0, 135.0, -135.0])
    assert np.linalg.norm(arms, axis=1) == pytest.approx([1.0, 1.0, 2.0, 2.0])


def test_changes_are_applied_one_after_the_other() -> None:
    """Places are dealt out anew, then some are moved, then all turned, about the centroid."""
    plain = formation({"line": "1 m"}, 3)
    swapped = formation({"line": "1 m", "order": [2, 1, 3]}, 3)
    assert swapped == pytest.approx(plain[[1, 0, 2]])
    moved = formation({"line": "1 m", "order": [2, 1, 3], "moved": {1: ["45 cm", "0 m", "0 m"]}}, 3)
    assert moved[0] - moved[1] == pytest.approx(swapped[0] - swapped[1] + [0.45, 0.0, 0.0])
    assert moved[1] - moved[2] == pytest.approx(swapped[1] - swapped[2])
    turned = formation({"line": "1 m", "turned": "90 deg"}, 3)
    assert turned == pytest.approx(plain[:, [1, 0, 2]] * [-1.0, 1.0, 1.0], abs=ROUNDING)


@pytest.mark.parametrize(
    ("spec", "count", "said"),
    [
        ({"triangle": "0.9 m"}, 4, "triangle has 3 vehicles, not 4"),
        ({"ring": "1 m"}, 2, "use line"),
        ({"line": "1 m"}, 1, "at least 2 vehicles, not 1"),
        ({"line": "0 m"}, 2, "above 0"),
        ({"line": "1 kg"}, 2, "reference.line: '1 kg' is not a quantity"),
        ({"line": "1 m", "ring": "1 m"}, 3, "line and ring"),
        ({}, 3, "no shape"),
        ({"lyne": "1 m"}, 3, "reference.lyne: unknown field (did you mean 'line'?)"),
        ("line", 3, "reference: should be a mapping of fields, not 'line'"),
        ({"places": [[0, 0, 0]]}, 2, "1 places for 2 vehicles"),
        ({"places": "1 m"}, 2, "reference.places: should be a list, not '1 m'"),
        ({"places": [[0, 0, 0], [0]]}, 2, "reference.places.1"),
        (
            {"places": [[0, 0, 0], [0, 0, float("inf")]]},
            2,
            "reference.places.1.2: inf has no unit: write it with one of mm, cm, m, km",
        ),
        ({"places": [[0, 0, 0], [0, 0, 0]]}, 2, "vehicles 1 and 2 are in one place"),
        ({"line": "1 m", "order": [1, 1, 2]}, 3, "each number from 1 to 3"),
        ({"line": "1 m", "moved": {4: ["1 m", "0 m", "0 m"]}}, 3, "none of the vehicles 1 to 3"),
        ({"line": "1 m", "moved": ["1 m"]}, 3, "reference.moved: should be a mapping of fields, not ['1 m']"),
        ({"line": "1 m", "turned": 90}, 3, "reference.turned: 90 has no unit"),
    ],
)
def test_bad_input_is_refused_with_its_place(spec: Any, count: int, said: str) -> None:
    """The message names the field, what is wrong and what to write."""
    with pytest.raises(BadInput) as refused:
        formation(spec, count, "reference")
    assert said in str(refused.value)
    assert str(refused.value).startswith("reference")
