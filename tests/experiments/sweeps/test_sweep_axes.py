"""Ranges of a sweep as they are written, and the cells that they span."""

from __future__ import annotations

import pytest

from volery.errors import BadInput
from volery.experiments.sweeps.axes import Axis, axis_of, grid, random_cells, read_axis, spanned


def labels(word: str) -> list[str]:
    """The values of an axis."""
    return [point.label for point in axis_of(word).points]


@pytest.mark.parametrize(
    ("written", "values"),
    [
        ("0:0.8:0.2", ["0", "0.2", "0.4", "0.6", "0.8"]),
        ("0:0.3:0.1", ["0", "0.1", "0.2", "0.3"]),
        ("0:1:0.3", ["0", "0.3", "0.6", "0.9"]),
        ("5:1:-2", ["5", "3", "1"]),
        ("2:2:1", ["2"]),
        ("1 ms:3 ms:1 ms", ["1 ms", "2 ms", "3 ms"]),
        ("0:3:1.5 ms", ["0 ms", "1.5 ms", "3 ms"]),
        ("1e-3:2e-3:5e-4", ["0.001", "0.0015", "0.002"]),
        ("lin(1, 2, 5)", ["1", "1.25", "1.5", "1.75", "2"]),
        ("lin(3 s, 1 s, 3)", ["3 s", "2 s", "1 s"]),
        ("log(1, 64, 7)", ["1", "2", "4", "8", "16", "32", "64"]),
        ("log(1 ms, 100 ms, 3)", ["1 ms", "10 ms", "100 ms"]),
        ("log(1, 10, 3)", ["1", "3.16228", "10"]),
        ("running-sum, flow-updating", ["running-sum", "flow-updating"]),
        ("{ring: 8}, {grid: [2, 4]}, none", ["{ring: 8}", "{grid: [2, 4]}", "none"]),
        ("0, 0.1:0.3:0.1, log(1, 100, 3)", ["0", "0.1", "0.2", "0.3", "1", "10", "100"]),
        ("1:2", []),
    ],
)
def test_ranges(written: str, values: list[str]) -> None:
    """Both ends belong to a range, decimals stay decimals, brackets hold commas together, and units stay."""
    assert labels(f"agents.rounds={written}") == values
    assert [point.overrides for point in axis_of(f"key={written}").points] == [(f"key={value}",) for value in values]


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("links.loss", "write KEY=RANGE"),
        ("=1,2", "write KEY=RANGE"),
        ("key=", "the range is empty"),
        ("key=3:1:1", "the range is empty: steps of 1 lead away from 1"),
        ("key=1:3:-1", "the range is empty"),
        ("key=1:3:0", "the step is 0"),
        ("key=0:1:1e-9", "values are too many"),
        ("key=1:2:3:4", "write from:to:step"),
        ("key=1 ms:1 s:1 ms", "the units ms, s are different"),
        ("key=log(0, 1, 3)", "starts above 0"),
        ("key=log(1, 2, 1)", "at least 2"),
        ("key=lin(1, 2, 3, 4)", "write lin(from, to, count)"),
        ("key=1,2,1", "the value 1 occurs twice"),
        ("key=0:1,5", "no step"),
        ("seed=1,2", "use --repeat"),
    ],
)
def test_what_is_no_range_is_refused(word: str, message: str) -> None:
    """The message has the key and says what is wrong."""
    with pytest.raises(BadInput) as refused:
        axis_of(word)
    assert message in str(refused.value)
    assert str(refused.value).startswith("--over ")


def test_values_and_named_points_from_python() -> None:
    """Values become YAML, and a named point may set several fields."""
    values = [0.1, True, None, [1, 2], {"ring": 8}]
    points = read_axis("key", values).points
    assert [point.overrides[0] for point in points] == [
        "key=0.1",
        "key=true",
        "key=null",
        "key=[1, 2]",
        "key={ring: 8}",
    ]
    named = read_axis("filter", {"plain": ["agents.rounds=1"], "fast": ["agents.rounds=3", "links.rate=1 Mbit/s"]})
    assert grid([named])[1].overrides == ("agents.rounds=3", "links.rate=1 Mbit/s")
    with pytest.raises(BadInput, match="empty"):
        read_axis("key", [])


def test_numbers_are_quantities_in_one_unit() -> None:
    """What a figure may put on a scale: all numbers, with the same unit or none."""
    assert axis_of("key=1 ms:3 ms:1 ms").numbers == ([1.0, 2.0, 3.0], "ms")
    assert axis_of("key=1,2.5").numbers == ([1.0, 2.5], "")
    assert axis_of("key=1 ms,1 s").numbers is None
    assert axis_of("key=1,none").numbers is None


def test_a_grid_is_every_combination() -> None:
    """In the order in which the axes are written, the last fastest; without axes it is the scenario itself."""
    cells = grid([axis_of("a=1,2"), axis_of("b=x,y,z")])
    assert [cell.overrides for cell in cells][:4] == [("a=1", "b=x"), ("a=1", "b=y"), ("a=1", "b=z"), ("a=2", "b=x")]
    assert len(cells) == 6
    assert [cell.overrides for cell in grid([])] == [()]
    with pytest.raises(BadInput, match="in which steps"):
        grid([axis_of("a=0:1")])


def test_random_cells_follow_from_the_seed() -> None:
    """The same seed draws the same, more cells begin with the fewer, and another key takes nothing away from one."""
    axes = [axis_of("a=0:1"), axis_of("b=log(1 ms, 100 ms)"), axis_of("c=x,y")]
    few, many = random_cells(axes, 10, 3), random_cells(axes, 200, 3)
    assert many[:10] == few
    assert random_cells(axes, 10, 4) != few
    assert [cell.points[0] for cell in random_cells(axes[:1], 10, 3)] == [cell.points[0] for cell in few]
    first, second, third = spanned(axes, many)
    assert first.numbers is not None
    assert second.numbers is not None
    assert first.numbers[0] == sorted(first.numbers[0])
    assert 0 < min(first.numbers[0]) < 0.05
    assert 0.95 < max(first.numbers[0]) < 1
    below_ten = sum(number < 10 for number in second.numbers[0])
    assert second.numbers[1] == "ms"
    assert 70 < below_ten < 130  # half of the way in the logarithm: 100 ± 7 of 200 at one standard deviation
    assert {point.label for point in third.points} == {"x", "y"}
    with pytest.raises(BadInput, match="at least one cell"):
        random_cells(axes, 0, 3)
    assert len(random_cells([axis_of("c=1:4:1"), axis_of("d=x,y")], 8, 3)) == 8
    with pytest.raises(BadInput, match="hardly more than 4 combinations"):
        random_cells([axis_of("c=1:4:1")], 5, 3)
    with pytest.raises(BadInput, match="at least one KEY=RANGE"):
        random_cells([], 5, 3)


def test_an_axis_is_named_in_its_points() -> None:
    """A drawn point sets the key of its axis."""
    (cell,) = random_cells([Axis("a", between=axis_of("a=2:2").between)], 1, 0)
    assert cell.overrides == ("a=2",)
