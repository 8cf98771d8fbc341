"""The contest of distributed filters: runs it, keeps its numbers in contest.csv, and shows them for contest.md.

Usage: python docs/contest.py run [--repeat 20] [--runs runs]      run it, or go on with it; write the CSV
       python docs/contest.py show [--out docs/images]             print the table and the findings, draw the figures
       python docs/contest.py zenoh                                part of it again over Zenoh, beside the CSV
       python docs/contest.py own my_filter:MyFilter [--repeat 2]  a filter of your own, beside those in the CSV
"""

# ruff: noqa: T201, TID251 - it prints what it found, and is a user of the package
from __future__ import annotations

import argparse
import csv
import math
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import volery
from volery import topologies
from volery.errors import BadInput
from volery.experiments.scenario.explaining import read as read_settings
from volery.experiments.sweeps.sweep_results import Sweep
from volery.topologies.over_time import Topology

HERE = Path(__file__).parent
TABLE = HERE / "contest.csv"
FILTERS = {
    "local only": "local",
    "Kalman consensus 2007": "kalman-consensus-2007",
    "Kalman consensus 2009": "kalman-consensus-2009",
    "diffusion": "diffusion",
    "on measurements": "consensus-on-measurements",
    "on measurements, running sums": "consensus-on-measurements/running-sum",
    "on measurements, flow updating": "consensus-on-measurements/flow-updating",
    "on information": "consensus-on-information",
    "hybrid, ω = N": "hybrid",
    "hybrid by contributions": "hybrid-contributions",
    "information-weighted": "information-weighted",
    "covariance intersection": "covariance-intersection",
    "event-triggered": "event-triggered",
}
"""Contender → its name in a scenario; `local only` is a reference, the centralised filter is in every run."""
LOSSY_BURSTS = "{gilbert-elliott: {to_bad: 0.03, to_good: 0.06, loss_bad: 0.9}}"
CONDITIONS = {
    "no loss": ["links.loss={bernoulli: 0}"],
    "loss 0.3": ["links.loss={bernoulli: 0.3}"],
    "loss 0.6": ["links.loss={bernoulli: 0.6}"],
    "bursts 0.3": [f"links.loss={LOSSY_BURSTS}"],
    "one-way 0.6": [],
    "late": ["links.latency={uniform: {low: 0 ms, high: 1500 ms}}"],
    "radio": ["links.medium={kind: half-duplex, per: node, access: csma}", "links.rate=250 kbit/s"],
}
"""What the links do; `one-way` loses 0.6 from the lower to the higher name and nothing back; airtime counts on the
`radio`, where a link is as good as the contention around it lets it be."""
GRAPHS: dict[str, Mapping[str, Any]] = {
    "geometric": {"geometric": {"count": 10, "radius": 0.5, "seed": 3}},
    "hexagonal": {"hexagonal": 10, "seed": 1},
    "ring": {"ring": 10},
    "star": {"star": 10},
}
SCENARIO: dict[str, Any] = {
    "name": "contest",
    "seed": 1,
    "duration": "30 s",
    "topology": GRAPHS["ring"],
    "agents": {"kind": "tracker", "rounds": 3},
    "world": {"kind": "target"},
    "links": {"latency": "20 ms", "paired": "50 ms", "overhead": "13 B"},
}
ERROR, BEST = "findings.position error", "findings.position error, centralised"
CONSISTENCY, BYTES = "findings.ANEES", "links.bytes_per_agent_s"
DELIVERED = "links.delivered_fraction"


@dataclass(frozen=True)
class Result:
    """One run: the position's error and that of the centralised filter [m], ANEES, payload of an agent [B/s]."""

    graph: str
    condition: str
    contender: str
    seed: int
    error: float
    best: float
    anees: float
    bytes_per_s: float
    delivered: float

    @property
    def ratio(self) -> float:
        """Error over that of the centralised filter on the same measurements."""
        return self.error / self.best


def one_way(graph: Mapping[str, Any]) -> str:
    """Loss in one direction of every edge of a graph."""
    links = [
        f"{first}>{second}"
        for first, second in topologies.edges(read_settings(Topology, graph).build(SCENARIO["seed"]))
    ]
    return f"links.only=[{{where: [{', '.join(links)}], loss: {{bernoulli: 0.6}}}}]"


def settings() -> dict[str, list[str]]:
    """Graph and condition → what they set."""
    found = {}
    for graph, spec in GRAPHS.items():
        for condition, changes in CONDITIONS.items():
            topology = str(dict(spec)).replace("'", "")
            more = [one_way(spec)] if condition.startswith("one-way") else []
            found[f"{graph}: {condition}"] = [f"topology={topology}", *changes, *more]
    return found


def axes(contenders: Mapping[str, str] = FILTERS) -> dict[str, Mapping[str, list[str]]]:
    """The axes of the sweep: who, and where."""
    return {"filter": {name: [f"agents.filter={kind}"] for name, kind in contenders.items()}, "setting": settings()}


def run(repeat: int, runs: str, workers: int | None) -> Sweep:
    """Carry the contest out, or go on with it."""
    return volery.sweep(SCENARIO, axes(), repeat=repeat, runs=runs, name="contest", workers=workers, progress=True)


def results(done: Sweep) -> Iterator[Result]:
    """A result for each row of the sweep."""
    for row in done.rows:
        contender, setting = done.plan.cells[row.cell].labels
        graph, _, condition = setting.partition(": ")
        found = {name: _number(row.values.get(name)) for name in (ERROR, BEST, CONSISTENCY, BYTES, DELIVERED)}
        yield Result(graph, condition, contender, row.seed, *found.values())


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def write(found: list[Result]) -> None:
    """Keep the numbers, six digits of each."""
    order = {name: place for place, name in enumerate((*GRAPHS, *CONDITIONS, *FILTERS))}
    rows = sorted(found, key=lambda one: (order[one.graph], order[one.condition], order[one.contender], one.seed))
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(
            ["graph", "condition", "filter", "seed", "error_m", "centralised_m", "anees", "bytes_s", "delivered"]
        )
        for one in rows:
            numbers = (one.error, one.best, one.anees, one.bytes_per_s, one.delivered)
            writer.writerow([one.graph, one.condition, one.contender, one.seed, *(f"{x:.6g}" for x in numbers)])


def read() -> list[Result]:
    """The numbers that were kept."""
    with TABLE.open(newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))[1:]
    return [
        Result(graph, condition, who, int(seed), *map(float, numbers)) for graph, condition, who, seed, *numbers in rows
    ]


def own(kind: str, repeat: int, runs: str, workers: int | None) -> Iterator[str]:
    """A filter of one's own everywhere with the seeds of the others, and its place among the contenders.

    Raises:
        BadInput: no such filter, or more seeds than were kept of the others.
    """
    import contest_report

    seeds = range(SCENARIO["seed"], SCENARIO["seed"] + repeat)
    kept = [one for one in read() if one.seed in seeds]
    if {one.seed for one in kept} != set(seeds):
        raise BadInput(
            f"--repeat {repeat}: {TABLE.name} has no such seeds of the others: run the contest with them first"
        )
    done = volery.sweep(SCENARIO, axes({kind: kind}), repeat=repeat, runs=runs, workers=workers, progress=True)
    everything = contest_report.Results([*kept, *results(done)])
    for condition in CONDITIONS:
        rank = everything.ranks(condition, also=kind)[kind]
        yield f"{condition}: {contest_report.cell(everything, kind, condition)}, place {rank} of {len(FILTERS)}"


def again_over_zenoh() -> Iterator[str]:
    """Some runs as ten processes over Zenoh in lockstep pace, beside those of the twin in the table."""
    contenders = {name: FILTERS[name] for name in ("hybrid by contributions", "event-triggered")}
    where = ("ring: loss 0.3", "star: late", "geometric: radio")
    over = {**axes(contenders), "setting": {name: settings()[name] for name in where}}
    kept = {(one.contender, f"{one.graph}: {one.condition}", one.seed): one for one in read()}
    done = volery.sweep(SCENARIO, over, engine="zenoh", runs="runs", name="contest-zenoh", fresh=True, progress=True)
    for one in results(done):
        twin = kept[one.contender, f"{one.graph}: {one.condition}", one.seed]
        same = all(
            f"{mine:.6g}" == f"{other:.6g}"
            for mine, other in ((one.error, twin.error), (one.anees, twin.anees), (one.delivered, twin.delivered))
        )
        verdict = "as in the twin" if same else f"NOT as in the twin, {twin.error:.6g} m"
        yield f"{one.contender}, {one.graph}, {one.condition}, seed {one.seed}: {one.error:.6g} m, {verdict}"


def main() -> None:
    """Do what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", choices=("run", "show", "zenoh", "own"))
    parser.add_argument("filter", nargs="?")
    parser.add_argument("--repeat", type=int, default=20)
    parser.add_argument("--runs", default="runs")
    parser.add_argument("--workers", type=int)
    parser.add_argument("--out", type=Path, default=HERE / "images")
    asked = parser.parse_args()
    if asked.part == "run":
        write(list(results(run(asked.repeat, asked.runs, asked.workers))))
    elif asked.part == "own":
        sys.path.insert(0, str(Path.cwd()))
        print(*own(asked.filter or "", asked.repeat, asked.runs, asked.workers), sep="\n")
    elif asked.part == "zenoh":
        print(*again_over_zenoh(), sep="\n")
    else:
        import contest_report

        print(*contest_report.show(read(), asked.out), sep="\n")


if __name__ == "__main__":
    main()
