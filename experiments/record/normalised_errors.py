"""Errors against the covariances that were reported with them: NEES of estimates, NIS of innovations."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

from ...estimators.error_measures import nees
from ...estimators.information import unpack_covariance
from ...quantities import Floats
from ..evaluation.evaluation import Series


def standard_deviations(reports: Series, covariances: Series, size: int) -> Floats:
    """Those of the components of each report's error, (n, size), NaN where no covariance belongs to it.

    Raises:
        BadInput: the covariance is that of another number of components.
    """
    found = np.full((len(reports.sample), size), np.nan)
    for row, matrix in _matrices(reports, covariances, size):
        variances = matrix.diagonal()
        found[row] = np.sqrt(np.where(variances >= 0.0, variances, np.nan))
    return found


def normalised_squares(reports: Series, errors: Floats, covariances: Series) -> Floats:
    """The normalised square eᵀ P⁻¹ e of each report's error, (n,); of a consistent filter it is χ² distributed.

    Infinite where the error is, or where P is singular; NaN where either is not known.

    Args:
        reports: whose errors these are.
        errors: of each, (n, m).
        covariances: reports of P; those of the same instant and index belong together, in their order.
    Raises:
        BadInput: as `standard_deviations`.
    """
    found = np.full(len(reports.sample), np.nan)
    for row, matrix in _matrices(reports, covariances, errors.shape[1]):
        error = errors[row]
        if np.isnan(error).any() or np.isnan(matrix).any():
            continue
        try:
            found[row] = nees(error, matrix) if np.isfinite(error).all() else np.inf
        except np.linalg.LinAlgError:
            found[row] = np.inf
    return found


def _matrices(reports: Series, covariances: Series, size: int) -> Iterator[tuple[int, Floats]]:
    """The rows of reports to which a covariance belongs, and that."""
    known = dict(zip(_keys(covariances), covariances.value, strict=True))
    for row, key in enumerate(_keys(reports)):
        if (numbers := known.get(key)) is not None:
            yield row, unpack_covariance(numbers, size)


def _keys(series: Series) -> Iterator[tuple[int, int, int]]:
    """Instant and index of each report, and how many of the same came before it."""
    before: Counter[tuple[int, int]] = Counter()
    for key in zip(series.time_ns.tolist(), series.sample.tolist(), strict=True):
        yield (*key, before[key])
        before[key] += 1
