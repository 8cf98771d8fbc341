"""Compare the journals of all built-in scenarios in the twin with those that `journals.json` keeps as digests.

    python benchmarks/trials_journals.py              all built-in scenarios
    python benchmarks/trials_journals.py dfa4 mav3    some of them
    python benchmarks/trials_journals.py --keep mav3  keep what they are now, after a change of arithmetic

Digests are of the reports and frames of each incarnation of each agent, of each true quantity that a coupled world
recorded, and of the central estimates and the truth of each reported quantity. journals.json is of commit 93240e7, but
for changes of arithmetic since, which leave the frames as they were:

- mav*: the filter of a formation keeps positions about the first vehicle, and updates P by W Wᵀ.

Bits
depend on NumPy, SciPy, BLAS and the kernels that BLAS chooses for the processor: the kept ones are of OpenBLAS's
kernels for SkylakeX, which OPENBLAS_CORETYPE=SkylakeX chooses on any processor with AVX-512.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path
from typing import Any

import msgpack
from threadpoolctl import threadpool_info

from volery.experiments.record.record import Record
from volery.experiments.record.samples import samples
from volery.experiments.scenario.library import builtin_scenarios
from volery.experiments.scenario.load import load_scenario
from volery.experiments.twin import recorded

KEPT = Path(__file__).with_name("journals.json")
KEPT_KERNELS = "SkylakeX"
_DIGITS = 16


def digest(content: bytes) -> str:
    """The first digits of a SHA-256."""
    return sha256(content).hexdigest()[:_DIGITS]


def digests(record: Record) -> dict[str, Any]:
    """`journal`: life → (reports, frames); `world`: quantity → truth; `references`: quantity → central and truth."""
    world_agents = {agent.name for agent in record.plan.world_agents}
    journal: dict[str, list[str]] = {}
    world: dict[str, list[tuple[Any, ...]]] = {}
    for (name, incarnation), batch in record.batches.items():
        if name in world_agents:
            for estimate in batch.estimates:
                world.setdefault(estimate.quantity, []).append(tuple(estimate))
            continue
        frames = [sorted(map(tuple, entries)) for entries in (batch.sent, batch.heard, batch.dropped)]
        reports = list(map(tuple, batch.estimates))
        journal[f"{name}#{incarnation}"] = [digest(msgpack.packb(part)) for part in (reports, frames)]
    references = {}
    for quantity in record.quantities():
        seen = samples(record, quantity)
        references[quantity] = {"central": digest(seen.oracle.tobytes()), "truth": digest(seen.truth.tobytes())}
    return {
        "journal": journal,
        "world": {quantity: digest(msgpack.packb(rows)) for quantity, rows in world.items()},
        "references": references,
    }


def different(kept: dict[str, Any], found: dict[str, Any]) -> Iterator[str]:
    """The differences of one scenario, in words."""
    for part, before in kept.items():
        for name in sorted(before.keys() | found[part].keys()):
            if before.get(name) != found[part].get(name):
                what = _which(before[name], found[part][name]) if name in before and name in found[part] else ""
                yield f"{part} of {name}{what}"


def _which(before: Any, found: Any) -> str:
    """Which of the digests of a journal differ."""
    if not isinstance(before, list):
        return ""
    parts = zip(("reports", "frames"), before, found, strict=True)
    return f" ({' and '.join(part for part, old, new in parts if old != new)})"


def main(names: list[str]) -> int:
    """Compare; 1 where a journal differs."""
    keep = "--keep" in names
    names = [name for name in names if name != "--keep"]
    kept = json.loads(KEPT.read_text("utf-8"))
    if other := {blas.get("architecture") for blas in threadpool_info()} - {KEPT_KERNELS}:
        print(f"BLAS has kernels for {', '.join(map(str, other))} here: start with OPENBLAS_CORETYPE={KEPT_KERNELS}")
    failed = False
    for name in names or [scenario.name for scenario in builtin_scenarios()]:
        found = digests(recorded(load_scenario(name).plan))
        differences = list(different(kept[name], found))
        kept[name] = found
        failed |= any(not text.startswith("references") for text in differences)
        print(f"{name}: {'; '.join(differences) or 'as kept'}", flush=True)
    if keep:
        KEPT.write_text(json.dumps(kept, indent=1), "utf-8")
    return int(failed and not keep)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
