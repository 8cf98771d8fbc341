"""What the bits of a run depend on besides its scenario: versions, BLAS and the processor's features."""

from __future__ import annotations

import platform
import subprocess
from collections.abc import Mapping
from contextlib import AbstractContextManager
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import scipy
import scipy.linalg  # loads scipy's own BLAS, so that every process lists the same libraries
from threadpoolctl import threadpool_info, threadpool_limits

from ...agents.plan import Plan
from ...agents.registry import find

_GIT_S = 5.0


def one_blas_thread() -> AbstractContextManager[Any]:
    """As in an agent's process: the bits of a large product depend on how many threads share it."""
    limits: AbstractContextManager[Any] = threadpool_limits(1, user_api="blas")
    return limits


def fingerprint() -> dict[str, Any]:
    """Versions and features of this machine, for run.json."""
    blas = [{key: pool.get(key) for key in ("internal_api", "version", "architecture")} for pool in threadpool_info()]
    return {
        "platform": platform.platform(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "blas": sorted(blas, key=str),
        "simd": sorted(np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])),
    }


def git_state(folder: Path) -> dict[str, Any] | None:
    """Commit of the git repository that a folder is in, and whether files differ from it; None where there is none."""

    def git(*words: str) -> str:
        command = ["git", "-C", str(folder), *words]
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=_GIT_S)  # noqa: S603
        return done.stdout.strip()

    try:
        return {"commit": git("rev-parse", "HEAD"), "dirty": bool(git("status", "--porcelain"))}
    except (OSError, subprocess.SubprocessError):
        return None


def libraries(plan: Plan) -> dict[str, str]:
    """Versions of what the agents' bits come from, besides NumPy and SciPy."""
    used = {name for agent in plan.agents for name in find(agent.kind).libraries(agent.parameters)}
    return {name: version(name) for name in sorted(used)}


def differences(info: Mapping[str, Any], plan: Plan) -> list[str]:
    """What was different where a run was recorded, of all that its bits depend on."""
    here = {**fingerprint(), "libraries": libraries(plan)}
    return [
        f"{name} {info[name]} there, {here[name]} here"
        for name in ("numpy", "scipy", "blas", "simd", "libraries")
        if name in info and info[name] != here[name]
    ]
