"""Assignment of cameras to vehicles, and observability of the formation from the measured pairs."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import BadInput
from ..checks import as_array
from .model import Pair, check_pair


@dataclass(frozen=True)
class Observability:
    """Observability of a formation from a set of measured pairs.

    groups: connected components of the living vehicles, joined by measured pairs; each ascending, the largest first.
        Within a group all relative positions and velocities are observable, between two groups none.
    rank: of the observability matrix, 6 (living − number of groups).
    size: of the state of the living vehicles, 6 (living − 1).
    lost: the i whose r_i = p_i − p_{i+1} is unobservable, including those of a dead vehicle.
    """

    groups: tuple[tuple[int, ...], ...]
    rank: int
    size: int
    lost: tuple[int, ...]

    @property
    def complete(self) -> bool:
        """Whether all living vehicles can be estimated relative to each other."""
        return self.rank == self.size

    def describe(self, names: Sequence[str] | None = None) -> str:
        """Describe which vehicles are cut off from which."""
        if not self.groups:
            return "there is nobody"
        if self.complete:
            return "all relative positions are observable"
        labels = [" ".join(str(i) if names is None else names[i] for i in group) for group in self.groups]
        return f"no measured pair joins vehicles {labels[0]} with {' nor with '.join(labels[1:])}"


def observability(vehicles: int, pairs: Iterable[Pair], dead: Collection[int] = ()) -> Observability:
    """Observability from measured pairs (observer, seen).

    Relative position and velocity of a pair follow from its measurements at two instants, and those of other pairs from
    sums along a path: the rank is 6 (living − number of groups), as that of [C; CA; …], Nägeli 2014, Sec. II-B.

    Args:
        vehicles: N.
        pairs: measured pairs, observer first.
        dead: vehicles that neither see nor are seen.
    Raises:
        BadInput: a pair of vehicles that do not exist.
    """
    group = list(range(vehicles))
    for i, j in pairs:
        check_pair(vehicles, (i, j))
        if i not in dead and j not in dead:
            group = [group[i] if g == group[j] else g for g in group]
    living = [i for i in range(vehicles) if i not in dead]
    labels = dict.fromkeys(group[i] for i in living)
    groups = sorted((tuple(i for i in living if group[i] == label) for label in labels), key=lambda g: (-len(g), g))
    lost = tuple(i for i in range(vehicles - 1) if i in dead or i + 1 in dead or group[i] != group[i + 1])
    return Observability(tuple(groups), 6 * (len(living) - len(groups)), 6 * (len(living) - 1), lost)


def check_observable(vehicles: int, pairs: Iterable[Pair], names: Sequence[str] | None = None) -> None:
    """Refuse an assignment from which the formation cannot be estimated.

    Args:
        vehicles: N.
        pairs: (observer, seen).
        names: of the vehicles, for the message.
    Raises:
        BadInput: it is unobservable; the message names the vehicles that are cut off, and the rank.
    """
    found = observability(vehicles, pairs)
    if not found.complete:
        raise BadInput(
            f"the formation is unobservable, rank {found.rank} of {found.size}: {found.describe(names)}; "
            f"let one of them track one of the others"
        )


def assignment(
    positions: ArrayLike,
    camera_range: float,
    occluded: Collection[Pair] = (),
    names: Sequence[str] | None = None,
) -> tuple[int, ...]:
    """Assign to each camera one visible vehicle to track, such that the formation is observable.

    A ring, in which each vehicle tracks the next and the last the first, if all of these are visible: it stays
    observable without any one pair, and for three vehicles it is that of Nägeli 2014, Sec. IV-B. Otherwise a tree in
    which each vehicle tracks its parent, built from the root by adding the nearest pair first; the root is the one with
    the smallest sum of distances, and tracks the vehicle that closes the longest ring.

    Args:
        positions: of the reference formation, shape (N, 3) [m].
        camera_range: range of the cameras [m].
        occluded: pairs (observer, seen) whose line of sight is blocked.
        names: of the vehicles, for the message.
    Returns:
        For each vehicle the one that it tracks.
    Raises:
        BadInput: fewer than two vehicles, or no assignment makes the formation observable; the message names the
            vehicles that are cut off.
    """
    places = as_array(positions, (None, 3), "positions of a formation")
    vehicles = len(places)
    if vehicles < 2:
        raise BadInput(f"a formation of {vehicles} has nobody to track: give 2 vehicles or more")
    distances = np.linalg.norm(places[:, np.newaxis] - places, axis=-1)
    hidden = (distances > camera_range) | np.eye(vehicles, dtype=np.bool_)
    for i, j in occluded:
        check_pair(vehicles, (i, j))
        hidden[i, j] = True
    distances[hidden] = np.inf
    ring = tuple((i + 1) % vehicles for i in range(vehicles))
    if np.isfinite(distances[range(vehicles), ring]).all():
        return ring
    trees = [tree for root in range(vehicles) if (tree := _tree(distances, root)) is not None]
    if not trees:
        seen = [(int(i), int(j)) for i, j in np.argwhere(np.isfinite(distances))]
        found = observability(vehicles, seen)
        reason = (
            "each must be able to track somebody on the way to all others" if found.complete else found.describe(names)
        )
        raise BadInput(
            f"nobody can track whom it takes within {camera_range:g} m: {reason}; move them closer, or see further"
        )
    return min(trees, key=lambda tree: sum(distances[i, j] for i, j in enumerate(tree)))


def occlusions(positions: ArrayLike, radius: float) -> set[Pair]:
    """Pairs (observer, seen) whose line of sight is occluded by another vehicle.

    Args:
        positions: shape (N, 3) [m].
        radius: of the sphere that represents a vehicle [m].
    """
    places = as_array(positions, (None, 3), "positions of a formation")
    found: set[Pair] = set()
    for i, apart in enumerate(places - places[:, np.newaxis]):
        distance = np.linalg.norm(apart, axis=1)
        seen = distance.nonzero()[0]
        sight = apart[seen] / distance[seen, np.newaxis]
        along = sight @ apart.T
        across = np.linalg.norm(apart - along[..., np.newaxis] * sight[:, np.newaxis], axis=-1)
        between = (along > 0) & (along < distance[seen, np.newaxis]) & (across < radius)
        between[range(len(seen)), seen] = False
        found |= {(i, j) for j in seen[between.any(axis=1)].tolist()}
    return found


def _tree(distances: NDArray[np.float64], root: int) -> tuple[int, ...] | None:
    """Parents in a tree built from its root, nearest pair first, and what the root tracks; None if there is no tree."""
    vehicles = len(distances)
    tracked = dict[int, int]()
    inside = np.zeros(vehicles, dtype=np.bool_)
    inside[root] = True
    while not inside.all():
        open_pairs = np.where(inside[np.newaxis, :] & ~inside[:, np.newaxis], distances, np.inf)
        i, j = divmod(int(open_pairs.argmin()), vehicles)
        if not np.isfinite(open_pairs[i, j]):
            return None
        tracked[i], inside[i] = j, True
    seen = [j for j in range(vehicles) if np.isfinite(distances[root, j])]
    if not seen:
        return None

    def depth(j: int) -> int:
        return 0 if j == root else 1 + depth(tracked[j])

    tracked[root] = max(seen, key=lambda j: (depth(j), -distances[root, j]))
    return tuple(tracked[i] for i in range(vehicles))
