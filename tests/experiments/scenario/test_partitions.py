"""Partitions with names: which links each of them cuts."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.errors import BadInput
from volery.experiments.scenario.expansion import parse_fault
from volery.experiments.scenario.fault_places import Places
from volery.experiments.scenario.partitions import crossing, read_partition

NAMES = [str(number) for number in range(1, 8)]
COMPLETE = list(combinations(NAMES, 2))
PLACES = Places(COMPLETE, {"left": ("1", "2", "3")}, seed=3, fault_id="t1")


def heard(value: Any, places: Places = PLACES) -> dict[str, set[str]]:
    """Agent → whom it still hears on a complete graph, besides itself."""
    cut = set(crossing(read_partition(value), places))
    return {name: {other for other in places.agents if other != name and (other, name) not in cut} for name in NAMES}


def sides(value: Any) -> list[str]:
    """The sides as text, for partitions in which those who hear each other hear the same."""
    return sorted({"".join(sorted({name, *others})) for name, others in heard(value).items()})


@pytest.mark.parametrize(
    ("written", "expected"),
    [
        ("halves", ["123", "4567"]),
        ("isolate 5", ["123467", "5"]),
        ({"isolate": 5}, ["123467", "5"]),
        ({"isolate": [5, 6]}, ["12347", "5", "6"]),
        ([[1, 2], [3, 4, 5], [6, 7]], ["12", "345", "67"]),
        (["left", "rest"], ["123", "4567"]),
        ("1,2 rest", ["12", "34567"]),
    ],
)
def test_sides(written: Any, expected: list[str]) -> None:
    """Within a side all hear all, across none hears any."""
    assert sides(written) == expected


def test_a_bridge_hears_both_halves() -> None:
    """The halves are those of the others; only the bridge is heard on both sides, and hears both."""
    hears = heard("bridge 4")
    assert hears["4"] == set(NAMES) - {"4"}
    assert {name: hears[name] for name in ("1", "5")} == {"1": {"2", "3", "4"}, "5": {"4", "6", "7"}}


@pytest.mark.parametrize("count", [4, 5, 6, 7, 12])
def test_a_majority_ring_gives_each_its_own_majority(count: int) -> None:
    """Each hears more than half of all, itself counted, and no two hear the same ones."""
    names = [str(number) for number in range(1, count + 1)]
    places = Places(list(combinations(names, 2)), seed=3)
    cut = set(crossing(read_partition("majority-ring"), places))
    views = [frozenset(other for other in names if (other, name) not in cut) for name in names]
    assert all(len(view) == count // 2 + 1 for view in views)
    assert len(set(views)) == count


def test_random_halves_follow_from_the_seed_and_the_name_of_the_fault() -> None:
    """Two sides of three and four, the same for one seed and fault, others for another."""
    assert sorted(map(len, sides("random"))) == [3, 4]
    drawn = {crossing(read_partition("random"), Places(COMPLETE, seed=3, fault_id=f"t{n}")) for n in range(20)}
    assert len(drawn) > 10
    assert crossing(read_partition("random"), PLACES) == crossing(read_partition("random"), PLACES)


@given(st.sampled_from(["halves", "random", "isolate 3", "1,2 rest"]), st.sets(st.sampled_from(COMPLETE), min_size=1))
def test_on_any_graph_the_same_sides_are_parted(written: str, edges: set[tuple[str, str]]) -> None:
    """A sparser graph with all agents loses those of its edges that the complete graph loses, and no other."""
    path = [(str(number), str(number + 1)) for number in range(1, 7)]
    sparse = Places([*path, *edges], seed=3, fault_id="t1")
    cut = set(crossing(read_partition(written), PLACES))
    assert set(crossing(read_partition(written), sparse)) == cut & set(sparse.links)


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ([[1, 2], [2, 3], "rest"], "agent 2 is on two sides of the partition"),
        ([[1, 2], [3, 4]], "agent 5, 6, 7 is on no side of the partition: add `rest`"),
        ([[1, 99], "rest"], "there is no agent '99'"),
        ("halvs", "one group is no partition (did you mean 'halves'?)"),
        ({"isolates": 5}, "'isolates' is no partition (did you mean 'isolate'?)"),
        ("bridge 4,5", "a bridge is one agent, not 2"),
        ("isolate", "nothing is named"),
        (["all", "rest"], "this partition cuts no link"),
        (3, "3 is no partition"),
        ("", "one group is no partition"),
    ],
)
def test_a_partition_that_is_none(written: Any, message: str) -> None:
    """The message names the agent or the word."""
    with pytest.raises(BadInput) as caught:
        crossing(read_partition(written), PLACES)
    assert message in str(caught.value)


def test_a_partition_is_one_fault_at_one_instant() -> None:
    """It cuts all crossing links together, and what is written of it reads back equal."""
    (fault,) = parse_fault({"partition": "isolate 5", "for": "1 s"}, "f1", PLACES, 10**10)
    assert getattr(fault, "changes") == {"cut": True}  # noqa: B009 - a fault of links
    assert {frozenset(link) - {"5"} for link in getattr(fault, "links")} == {  # noqa: B009
        frozenset({name}) for name in NAMES if name != "5"
    }
    for written in ("halves", "isolate 5", "bridge 5", "majority-ring", [[1, 2], "rest"]):
        partition = read_partition(written)
        assert read_partition(partition.dump()) == partition
