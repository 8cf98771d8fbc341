"""Convex quadratic programs, solved by external packages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput, RunFailed

Floats = NDArray[np.float64]
Solver = Literal["daqp", "piqp"]

_UNBOUNDED = 1e30
_SOLVED = 1
_TOLERANCE = 1e-10


@dataclass(frozen=True)
class QuadraticProgram:
    """Minimise ½ zᵀ H z + fᵀ z subject to lower ≤ z ≤ upper and low ≤ E z ≤ high.

    hessian H (D, D), positive definite; gradient f, lower, upper (D,); rows E (k, D); low, high (k,). Missing bounds
    are infinite.

    Raises:
        BadInput: a lower bound above its upper bound.
    """

    hessian: Floats
    gradient: Floats
    lower: Floats
    upper: Floats
    rows: Floats
    low: Floats
    high: Floats

    def __post_init__(self) -> None:
        """Check that no lower bound is above its upper bound."""
        for below, above in ((self.lower, self.upper), (self.low, self.high)):
            empty = np.flatnonzero(~(below <= above))
            if empty.size:
                place = int(empty[0])
                raise BadInput(
                    f"bound {place} is from {below[place]:g} to {above[place]:g}, which leaves no value: "
                    "give a lower bound that is not above the upper one"
                )


def solve(program: QuadraticProgram, solver: Solver = "daqp") -> Floats:
    """The minimiser, (D,).

    Raises:
        BadInput: the solver is unknown or not installed.
        RunFailed: the solver found no solution.
    """
    if solver not in _SOLVERS:
        raise BadInput(f"solver {solver!r} is not known: use {' or '.join(_SOLVERS)}")
    try:
        return _SOLVERS[solver](program)
    except ImportError as error:
        raise BadInput(f"solver {solver} is not installed: `pip install {solver}`, or use another") from error


def _daqp(program: QuadraticProgram) -> Floats:
    """Solve by a dual active-set method (Arnström, Bemporad and Axehill 2022)."""
    import daqp

    upper = np.clip(np.concatenate([program.upper, program.high]), -_UNBOUNDED, _UNBOUNDED)
    lower = np.clip(np.concatenate([program.lower, program.low]), -_UNBOUNDED, _UNBOUNDED)
    kinds = np.zeros(len(upper), dtype=np.int32)
    found, _, flag, _ = daqp.solve(
        program.hessian, program.gradient, program.rows, upper, lower, kinds, primal_tol=_TOLERANCE
    )
    if flag != _SOLVED:
        raise RunFailed(f"daqp found no solution of a program of {len(program.gradient)} unknowns: exit flag {flag}")
    return np.asarray(found, dtype=np.float64)


def _piqp(program: QuadraticProgram) -> Floats:
    """Solve by a proximal interior-point method (Schwan, Jiang, Kuhn and Jones 2023)."""
    import piqp

    solver = piqp.DenseSolver()
    solver.settings.eps_abs = solver.settings.eps_rel = _TOLERANCE
    solver.setup(
        program.hessian,
        program.gradient,
        G=program.rows if len(program.rows) else None,
        h_l=program.low if len(program.rows) else None,
        h_u=program.high if len(program.rows) else None,
        x_l=program.lower,
        x_u=program.upper,
    )
    status = solver.solve()
    if status != piqp.PIQP_SOLVED:
        raise RunFailed(f"piqp found no solution of a program of {len(program.gradient)} unknowns: {status}")
    return np.array(solver.result.x, dtype=np.float64)


_SOLVERS: Mapping[str, Callable[[QuadraticProgram], Floats]] = MappingProxyType({"daqp": _daqp, "piqp": _piqp})
