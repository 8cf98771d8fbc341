"""Random rotations and vectors for the property-based tests."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def vectors(largest: float) -> st.SearchStrategy[Floats]:
    """Vectors whose length is at most `largest`, zero and the axes among them."""
    each = st.floats(-1.0, 1.0).map(lambda x: 0.0 if abs(x) < 1e-100 else x)
    return st.tuples(each, each, each).map(lambda v: np.array(v) * (largest / max(1.0, float(np.linalg.norm(v)))))


def quaternions() -> st.SearchStrategy[Floats]:
    """Unit quaternions of both signs, exact half turns and the identity among them."""
    each = st.floats(-1.0, 1.0)
    some = st.tuples(each, each, each, each).map(np.array)
    return some.filter(lambda q: bool(np.linalg.norm(q) > 0.1)).map(lambda q: q / np.linalg.norm(q))
