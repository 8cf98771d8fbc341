"""links."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from volery.experiments.scenario.load import load_scenario
from volery.transport.faults import LinkFault

from .conftest import Volery

ALL_ALIKE = ["--set", "faults=[]"]
BEACONS = ["--set", "world=null", "--set", "agents={kind: beacon}"]
_CORRELATED = "bernoulli probability=0.5 correlation=0.5, mean 50 %"
_TRACE = "trace times=[0s,1s] losses=[0,0.5], mean 50 %"
ODD = "links.only=[{where: 1>2, loss: 0.25, latency: {uniform: {low: 1 ms, high: 3 ms}}, duplication: 0.02}]"
CHANGING = "topology={edges: {1-2: always, 2-3: [[0 s, 0.25 s], [0.5 s]], 3-4: [[0.5 s]], 2-4: [[0 s, 0.5 s]]}}"


def rows(text: str) -> dict[str, list[list[str]]]:
    """Label → the cells of every table's row of that label; a cell of several lines is joined."""
    found: dict[str, list[list[str]]] = {}
    label = ""
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.replace("┃", "│").split("│")[1:-1]]
        if cells and cells[0]:
            label = cells[0]
            found.setdefault(label, []).append(cells[1:])
        elif cells and label:
            found[label][-1] = [f"{old} {new}".strip() for old, new in zip(found[label][-1], cells[1:], strict=True)]
    return found


def test_links_that_are_alike_stand_together(volery: Volery) -> None:
    """Five edges of one kind are one column; 44 B and 4 B of overhead at 10 bits a byte take 4.167 ms."""
    said = volery("links", "short.yaml", *ALL_ALIKE)
    assert said.code == 0
    table = rows(said.out)
    assert table["links"] == [["all 10 links"]]
    assert table["medium"] == [["half-duplex per edge, tdma cycle=60Hz guard=0.2ms"]]
    assert table["slot"] == [["2 in a cycle"]]
    assert table["rate"] == [["115.2 kbit/s, 10 bits a byte"]]
    assert table["largest payload"] == [["44 B, 4.167 ms on the air"]]
    assert (table["overhead"], table["MTU"]) == ([["4 B"]], [["1500 B"]])
    assert (table["queue"], table["loss"]) == ([["64 frames, drop-tail"]], [["none"]])
    assert table["latency"] == [["constant 2ms"]]
    assert table.keys().isdisjoint({"bucket", "corruption", "duplication", "there", "faults", "order", "state"})


def test_what_differs_and_what_faults_touch_stands_apart(volery: Volery) -> None:
    """The direction 1>2 has a model of its own, and both directions of 1-2 are cut for a while."""
    table = rows(volery("links", "short.yaml", "--set", ODD).out)
    assert table["links"] == [["1>2", "1-4, 2-3, 2-4, 3-4", "2>1"]]
    assert table["loss"] == [["bernoulli 0.25, mean 25 %", "none", "none"]]
    assert table["latency"] == [["uniform low=1ms high=3ms; shortest 1 ms, mean 2 ms", "constant 2ms", "constant 2ms"]]
    assert table["duplication"] == [["2 %", "–", "–"]]
    assert table["slot"] == [["1 of 2", "2 in a cycle", "2 of 2"]]
    assert table["faults"] == [["cut 1–2, 0.3 s to 0.5 s", "–", "cut 1–2, 0.3 s to 0.5 s"]]


def test_many_faults_of_a_link_are_counted(volery: Volery) -> None:
    """A random process may bring many: six are shown, and how many there are besides."""
    process = "faults=[{every: {mtbf: 20 ms, mttr: 10 ms}, cut: all}]"
    plan = load_scenario("short.yaml", [process]).plan
    count = sum(("1", "2") in fault.links for fault in plan.faults if isinstance(fault, LinkFault))
    table = rows(volery("links", "short.yaml", "--all", "--set", process).out)
    told = table["faults"][0][table["links"][0].index("1>2")]
    assert told.count("cut") == 6
    assert told.endswith(f"and {count - 6} more")


def test_every_link_on_request(volery: Volery) -> None:
    """Ten directions in columns of three."""
    table = rows(volery("links", "short.yaml", "--all").out)
    names = [name for row in table["links"] for name in row]
    assert names == ["1>2", "1>4", "2>1", "2>3", "2>4", "3>2", "3>4", "4>1", "4>2", "4>3"]
    assert [len(row) for row in table["slot"]] == [3, 3, 3, 1]
    assert table["slot"][0] == ["1 of 2", "1 of 2", "2 of 2"]


def test_links_that_come_and_go(volery: Volery) -> None:
    """How much of the second an edge is there: always, three quarters, and half of it."""
    table = rows(volery("links", "short.yaml", "--set", CHANGING, *BEACONS, *ALL_ALIKE).out)
    assert table["links"] == [["1-2", "2-3, 2-4, 3-4"]]
    assert table["there"] == [["always", "50 % to 75 % of the run"]]


def test_a_radio_has_the_slot_of_its_node(volery: Volery) -> None:
    """All four hear agent 2, so four slots; the ends of 1-2 have different ones."""
    medium = "links.medium={kind: half-duplex, per: node, access: {tdma: {cycle: 20 Hz}}}"
    table = rows(volery("links", "short.yaml", "--all", *BEACONS, "--set", medium).out)
    own = {
        name: slot
        for names, row in zip(table["links"], table["slot"], strict=True)
        for name, slot in zip(names, row, strict=True)
    }
    assert {slot.split(" of ")[1] for slot in own.values()} == {"4"}
    assert own["1>2"] == own["1>4"]
    assert len({own["1>2"], own["2>1"], own["3>2"], own["4>2"]}) == 4


def test_the_groups_as_json(volery: Volery) -> None:
    """Every setting as a scenario has it, and what follows from them."""
    groups: list[dict[str, Any]] = json.loads(volery("links", "short.yaml", "--set", ODD, "--json").out)
    odd, plain, _ = groups
    assert (odd["links"], len(plain["links"])) == (["1>2"], 8)
    assert {"low": "1 ms", "high": "3 ms"}.items() <= odd["settings"]["latency"]["uniform"].items()
    assert (odd["mean_loss"], plain["mean_loss"]) == ([0.25], [])
    assert (odd["shortest_latency_ns"], odd["mean_latency_ns"]) == (1_000_000, 2_000_000.0)
    assert (odd["largest_payload"], odd["airtime_ns"]) == (44, 4_166_667)
    assert (odd["slots"], odd["slot"], plain["slot"]) == (2, 0, None)
    assert odd["faults"] == {"t1": "cut 1–2, 0.3 s to 0.5 s"}
    assert plain["there"] == [1.0, 1.0]


@pytest.mark.parametrize(
    ("setting", "label", "text"),
    [
        ("links.bucket={rate: 10 kbit/s, burst: 100 B}", "bucket", "10 kbit/s, 100 B at once"),
        ("links.corruption=0.125", "corruption", "bernoulli 0.125, mean 12.5 %"),
        ("links.corruption={bit-error: 1e-5}", "corruption", "bit-error 1e-05, mean varies"),
        (
            "links.corruption={trace: {times: [0 s, 1 s, 2 s, 3 s, 4 s], losses: [0, 1, 0, 1, 0.5]}}",
            "corruption",
            "trace times=5 values losses=5 values, mean 50 %",
        ),
        ("links.loss={bernoulli: {probability: 0.5, correlation: 0.5}}", "loss", _CORRELATED),
        ("links.loss={bit-error: 1.0e-6}", "loss", "bit-error 1e-06, mean varies"),
        ("links.loss={frames: {lost: [1, 2, [5, 9]]}}", "loss", "frames [1,2,[5,9]], mean 0 %"),
        ("links.loss={trace: {times: [0 s, 1 s], losses: [0.0, 0.5]}}", "loss", _TRACE),
        ("links.reordering=false", "order", "kept"),
        ("links.paired=10 ms", "paired", "slots of 10 ms"),
        ("links.cut=true", "state", "cut"),
        ("links.rate=null", "largest payload", "44 B on the air"),
        ("links.queue={limit: 3, policy: latest}", "queue", "3 frames, latest"),
        ("links.medium=full-duplex", "medium", "full-duplex"),
    ],
)
def test_each_setting_has_its_row(volery: Volery, setting: str, label: str, text: str) -> None:
    """A row that is empty everywhere is left out, one that is not is there."""
    words = ["links", "short.yaml", "--set", "links.medium=full-duplex", *ALL_ALIKE]
    assert rows(volery(*words, "--set", setting).out)[label] == [[text]]


def test_presets_are_shown_with_their_sources(volery: Volery) -> None:
    """Every field of every preset with where it is from, in tables and as JSON."""
    presets = json.loads(volery("links", "--presets", "--json").out)
    text = " ".join(volery("links", "--presets").out.replace("│", " ").split())
    assert len(presets) >= 4
    for name, preset in presets.items():
        assert f"{name}: {preset['about']}" in text
        assert preset["sources"].keys() == preset["links"].keys() <= set(text.split())


def test_bad_input(volery: Volery) -> None:
    """A scenario that is none, or cannot be."""
    assert volery("links", "nothing-here").code == 2
    assert volery("links").code == 2
    Path("bad.yaml").write_text("name: bad\n", encoding="utf-8")
    assert volery("links", "bad.yaml").code == 2
