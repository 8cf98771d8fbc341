"""volery: an asynchronous networked agent emulator over Eclipse Zenoh.

`run` runs a scenario, `run_async` does so where an event loop runs, `load` reads a run from its folder; all return a
`volery.experiments.run_arrays.Run`. `sweep` runs a scenario over ranges of its fields and returns a
`volery.experiments.sweeps.sweep_results.Sweep`. `connect` connects to a running swarm, to inject faults.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .experiments.python_api import connect, load, run, run_async, sweep

__all__ = ["connect", "load", "run", "run_async", "sweep"]
__version__ = "0.1.0"


def __getattr__(name: str) -> Any:
    """Load the functions when they are asked for: agents' processes import this package too, and need none of them."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.experiments.python_api"), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
