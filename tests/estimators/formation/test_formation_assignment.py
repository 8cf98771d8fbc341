"""Who tracks whom, and what is observable from it, against the rank of the observability matrix."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from volery.errors import BadInput
from volery.estimators.formation.assignment import assignment, check_observable, observability, occlusions
from volery.estimators.formation.model import FormationModel, Pair
from volery.randomness import stream

RING = [(0, 1), (1, 2), (2, 0)]


def rank(vehicles: int, pairs: list[Pair]) -> int:
    """Of [C; C A]: two steps tell all that a double integrator can."""
    model = FormationModel(vehicles)
    if not pairs:
        return 0
    C = model.output_map(pairs)
    return int(np.linalg.matrix_rank(np.vstack([C, C @ model.transition(1.0)])))


def test_each_vehicle_alone_observes_six_of_twelve_and_all_together_twelve() -> None:
    """Three vehicles in a ring; any two of them observe everything."""
    assert [observability(3, [pair]).rank for pair in RING] == [6, 6, 6]
    assert observability(3, RING).rank == observability(3, RING[:2]).rank == observability(3, RING).size == 12


@settings(max_examples=60)
@given(
    vehicles=st.integers(2, 7),
    chosen=st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), max_size=9),
)
def test_rank_and_what_is_lost_are_those_of_the_observability_matrix(vehicles: int, chosen: list[Pair]) -> None:
    """For any pairs: r_i is lost exactly if measuring it too would raise the rank."""
    pairs = [(i, j) for i, j in chosen if i != j and max(i, j) < vehicles]
    found = observability(vehicles, pairs)
    assert found.rank == rank(vehicles, pairs)
    lost = [i for i in range(vehicles - 1) if rank(vehicles, [*pairs, (i, i + 1)]) > found.rank]
    assert list(found.lost) == lost
    assert sorted(i for group in found.groups for i in group) == list(range(vehicles))


def test_a_dead_vehicle_neither_sees_nor_is_seen() -> None:
    """In a ring of four the others stay joined; a second death, opposite, cuts them apart; what is lost is named."""
    ring = [(0, 1), (1, 2), (2, 3), (3, 0)]
    one = observability(4, ring, dead=[1])
    assert one.complete
    assert one.groups == ((0, 2, 3),)
    assert one.lost == (0, 1)
    two = observability(4, ring, dead=[1, 3])
    assert not two.complete
    assert (two.rank, two.size, two.groups, two.lost) == (0, 6, ((0,), (2,)), (0, 1, 2))
    assert two.describe(["a", "b", "c", "d"]) == "no measured pair joins vehicles a with c"


def test_a_check_names_the_vehicles_that_are_cut_off() -> None:
    """By their names, with the rank."""
    check_observable(3, RING)
    with pytest.raises(BadInput, match=r"rank 12 of 18: no measured pair joins vehicles a b with c d"):
        check_observable(4, [(0, 1), (1, 0), (2, 3), (3, 2)], ["a", "b", "c", "d"])
    with pytest.raises(BadInput, match="no pair here"):
        observability(3, [(0, 3)])


def scattered(vehicles: int, seed: int) -> NDArray[np.float64]:
    """Positions in a square of 4 m."""
    draws = stream(seed, "test", "assignment")
    return np.array([[4 * draws.uniform(2 * i), 4 * draws.uniform(2 * i + 1), 0.0] for i in range(vehicles)])


def test_three_that_see_each_other_track_in_a_ring() -> None:
    """Agent 1 measures r_1, agent 2 r_2, agent 3 −r_1 − r_2: Nägeli 2014, Sec. IV-B."""
    assert assignment([[0.0, 0.0, 0.0], [0.9, 0.0, 0.0], [0.45, 0.78, 0.0]], 2.0) == (1, 2, 0)


@settings(max_examples=60)
@given(vehicles=st.integers(2, 12), seed=st.integers(0, 1000), camera_range=st.floats(1.0, 6.0))
def test_whoever_is_tracked_is_in_sight_and_the_formation_is_observable(
    vehicles: int, seed: int, camera_range: float
) -> None:
    """Or there is no such assignment: then nobody is reached by all others over arcs in sight."""
    places = scattered(vehicles, seed)
    apart = np.linalg.norm(places[:, np.newaxis] - places, axis=-1)
    occluded = [(i, (i + 1) % vehicles) for i in range(0, vehicles, 3)]
    sight = (apart <= camera_range) & ~np.eye(vehicles, dtype=np.bool_)
    for i, j in occluded:
        sight[i, j] = False
    try:
        tracked = assignment(places, camera_range, occluded)
    except BadInput:
        reach = np.linalg.matrix_power(sight.astype(float) + np.eye(vehicles), vehicles) > 0
        roots = [i for i in range(vehicles) if reach[:, i].all() and sight[i].any()]
        assert not roots
    else:
        assert all(sight[i, j] for i, j in enumerate(tracked))
        assert observability(vehicles, list(enumerate(tracked))).complete


def test_a_line_that_sees_only_the_next_gives_each_its_neighbour() -> None:
    """No ring is in sight: a tree from the middle outwards or from an end, N − 1 different pairs."""
    tracked = assignment([[k, 0, 0] for k in range(5)], 1.2)
    assert {frozenset(pair) for pair in enumerate(tracked)} == {frozenset((k, k + 1)) for k in range(4)}


def test_a_vehicle_hides_what_is_behind_it_from_both_sides_and_nothing_else() -> None:
    """On a line, two in one place among them, then 0.3 m aside: hidden where the sphere is larger than that."""
    line = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [3.0, 0.0, 0.0]]
    hidden = {(0, 3), (3, 0), (1, 3), (3, 1)}
    assert occlusions(line, 0.2) == hidden
    aside = [[0.0, 0.0, 0.0], [1.0, 0.3, 0.0], [3.0, 0.0, 0.0]]
    assert occlusions(aside, 0.29) == set()
    assert occlusions(aside, 0.31) == {(0, 2), (2, 0)}


def test_an_assignment_that_cannot_be_is_refused_with_who_is_cut_off() -> None:
    """Two pairs far apart; a lone vehicle; all that would track one vehicle are blinded."""
    far = [[0, 0, 0], [1, 0, 0], [9, 0, 0], [10, 0, 0]]
    with pytest.raises(BadInput, match="joins vehicles a b with c d"):
        assignment(far, 2.0, names=["a", "b", "c", "d"])
    with pytest.raises(BadInput, match="2 vehicles or more"):
        assignment([[0, 0, 0]], 2.0)
    with pytest.raises(BadInput, match="each must be able to track"):
        assignment([[0, 0, 0], [1, 0, 0], [2, 0, 0]], 5.0, [(0, 1), (0, 2), (2, 0), (2, 1)])
