"""Scenario files: what is refused, where the message points, and what it proposes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from volery.errors import BadInput
from volery.experiments.scenario.compile import compile_plan
from volery.experiments.scenario.load import load_scenario, resolved_yaml
from volery.experiments.scenario.yaml_document import read_document
from volery.topologies.graph_settings import FromFile
from volery.transport.faults import LinkFault
from volery.transport.latency_settings import Normal
from volery.transport.loss_settings import GilbertElliott
from volery.transport.media_settings import HalfDuplex, Tdma

from .conftest import TEXT, Load, Refusal


def test_every_part_is_read(load: Load) -> None:
    """Quantities come out in base units, models as the transport's own dataclasses."""
    scenario = load()
    base = scenario.links.base
    assert scenario.duration == 10_000_000_000
    assert scenario.agents.parameters.rate == 20.0
    assert scenario.agents.compute == 1_000_000
    assert base.medium == HalfDuplex("edge", Tdma(60.0, 200_000))
    assert (base.rate, base.bits_per_byte, base.overhead) == (115_200.0, 10, 4)
    assert base.latency == Normal(2_000_000, 500_000)
    assert base.loss == (GilbertElliott(0.05, 0.3, 0.9),)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("seed: 7", "sed: 7", "example.yaml:2:1: sed: unknown field (did you mean 'seed'?)"),
        ("  rate: 115.2", "  raet: 115.2", "example.yaml:10:3: links.raet: unknown field (did you mean 'rate'?)"),
        ("  rate: 20 Hz", "  rat: 20 Hz", "example.yaml:7:3: agents.rat: unknown field (did you mean 'rate'?)"),
        (
            "sd: 0.5 ms",
            "ds: 0.5 ms",
            "example.yaml:13:34: links.latency.normal.ds: unknown field (known: correlation, mean, min, sd)",
        ),
        ("cut: 1-2", "cutt: 1-2", "example.yaml:16:27: faults.0.cutt: unknown field (did you mean 'cut'?)"),
        ("duration: 10 s", "duration: 10 Hz", "example.yaml:3:11: duration: '10 Hz' is not a quantity here"),
        ("duration: 10 s", "duration: 10", "example.yaml:3:11: duration: 10 has no unit: write it with one of ns"),
        ("duration: 10 s", "duration: 0 s", "example.yaml:3:11: duration: duration is 0 s, it must be above 0"),
        ("duration: 10 s", "", "example.yaml:1:1: duration: is missing"),
        ("seed: 7", 'seed: "7"', "example.yaml:2:7: seed: should be a valid integer, not '7'"),
        ("seed: 7", "seed: true", "example.yaml:2:7: seed: should be a valid integer, not True"),
        ("seed: 7", "seed: -1", "example.yaml:2:7: seed: seed is -1, it must be at least 0"),
        ("name: example", "name: a/b", "example.yaml:1:7: name: 'a/b' cannot name a run"),
        (
            "{gilbert-elliott:",
            "{gilbert-eliot:",
            "links.loss: unknown loss model 'gilbert-eliot' (did you mean 'gilbert-elli",
        ),
        (
            "{kind: half-duplex",
            "{kind: half-dupleks",
            "links.medium.kind: unknown medium 'half-dupleks' (did you mean 'half-d",
        ),
        ("to_bad: 0.05", "to_bad: -0.05", "links.loss.gilbert-elliott: to_bad is -0.05, a probability lies between 0"),
        (
            "{bernoulli: 0.5}",
            "{bernoulli: 1.5}",
            "17:61: faults.1.set.loss.bernoulli: loss probability is 1.5, a proba",
        ),
        ("{bernoulli: 0.5}", "-0.5", "example.yaml:17:49: faults.1.set.loss: loss probability is -0.5, a probability"),
        ("mean: 2 ms, ", "", "example.yaml:13:21: links.latency.normal.mean: is missing"),
        ("{line: 3}", "{lime: 3}", "example.yaml:4:18: topology.lime: unknown kind 'lime' (did you mean 'line'"),
        ("{line: 3}", "{cells: [[0, 0], [0, 0]]}", "example.yaml:4:19: topology.cells: cell [0, 0] is taken"),
        ("{line: 3}", "{cells: [[0, 0], [5, 0]]}", "topology.cells: the topology is not connected"),
        ("cut: 1-2", "kill: 01", "example.yaml:16:33: 01 is the number 1 to YAML: write 1, or '01' in quotes for a"),
        ("cut: 1-2", "kill: [0x1F]", "example.yaml:16:34: 0x1F is the number 31 to YAML: write 31, or '0x1F'"),
        ("faults:", "groups: {01: [1]}\nfaults:", "example.yaml:15:10: 01 is the number 1 to YAML"),
        ("name: example", f"name: {'a' * 201}", "1:7: name: the name aaaaaaaaaaaaaaaaaaaaaaaaaaaaaa… has 201 bytes"),
        ("{line: 3}", f"{{edges: [a-{'b' * 300}]}}", "topology.edges: the agent's name bbbbbb"),
        ("{line: 3}", "line", "example.yaml:4:11: topology: should be a mapping of fields, not 'line'"),
        ("Talker", "Walker", "example.yaml:6:9: agents.kind: agent kind 'tiny_agents:Walker' cannot be loaded"),
        (
            "  rate: 20 Hz",
            "  estimator: meen",
            "agents.estimator: 'meen' is none of mean, median (did you mean 'mean'?)",
        ),
        ("  rate: 20 Hz", "  compute: -1 ms", "agents.compute: compute is -1 ms, it must be at least 0"),
        (
            "  rate: 20 Hz",
            "  gain: {reech: 1 m}",
            "example.yaml:7:10: agents.gain.reech: unknown field (did you mean 'reach'?)",
        ),
        ("  rate: 20 Hz", "  rounds: 13", "example.yaml:6:3: agents: 13 rounds are unlucky: take 12"),
        ("cut: 1-2", "cut: 1-3", "example.yaml:16:32: faults.0.cut: 1-3: 1 and 3 have no link; neighbours of 1: 2"),
        ("cut: 1-2", "cut: 1-9", "faults.0.cut: 1-9: there is no agent '9'; agents: 1, 2, 3"),
        ("cut: 1-2", "kill: 9", "faults.0.kill: there is no agent '9'; agents: 1, 2, 3"),
        (
            "cut: 1-2",
            "kill: 1, pause: 2",
            "example.yaml:16:5: faults.0: a fault is exactly one of cut, hold, partition, set",
        ),
        (
            "at: 3 s",
            "at: 4 s",
            "example.yaml:16:22: faults.0.until: until is 4 s and at 4 s: a fault ends after it start",
        ),
        ("at: 3 s, until: 4 s", "at: 10 s", "example.yaml:16:10: faults.0.at: starts at 10 s, the run ends at 10 s"),
        ("at: 3 s", "at: -3 s", "faults.0.at: -3 s is before the run: a fault starts at 0 or later"),
        ("for: 1 s", "for: 0 s", "faults.1.for: for is 0 s: a fault lasts longer than 0"),
        ("for: 1 s", "for: 1 s, until: 8 s", "faults.1: write until or for, not both"),
        ("where: all, ", "", "faults.1: set and where belong together"),
        ("set: {loss: {bernoulli: 0.5}}", "set: {}", "faults.1: set is empty"),
        (
            "overhead: 4 B",
            "mtu: 45 B",
            "example.yaml:12:8: links.mtu: a payload of 46 B is larger than the MTU of 45 B",
        ),
        (
            "rate: 115.2 kbit/s",
            "rate: 50 kbit/s",
            "links.medium: a frame of 10.000 ms airtime does not fit a tdma slot",
        ),
        (
            "faults:",
            "world: {kind: plain}\nfaults:",
            "example.yaml:15:15: world.kind: unknown world kind 'plain' (did you mean 'plane'?)",
        ),
        (
            "",
            "  - {at: 1 s, kill: 2}\n  - {at: 2 s, kill: 2}\n",
            "faults.3.kill: agent 2 is down then already, by fault t3",
        ),
    ],
)
def test_bad_input_is_refused_where_it_stands(refusal: Refusal, old: str, new: str, message: str) -> None:
    """A message has file, line, column, field, what is wrong, and what was probably meant."""
    assert message in refusal(replacing=(old, new))


def test_all_errors_come_at_once(refusal: Refusal) -> None:
    """One reading lists every field that is wrong, a line each, in the order of the model."""
    lines = refusal("seed=x", "agents.rounds=many", "links.mtu=5", "faults.0.at=soon").splitlines()
    assert [line.split(":")[0] for line in lines] == [
        "--set seed",
        "--set agents.rounds",
        "--set links.mtu",
        "--set faults.0.at",
    ]


def test_fields_of_agents_and_parameters_of_their_kind_are_checked_together(refusal: Refusal) -> None:
    """They stand in one mapping, and what is wrong with them is listed at once."""
    lines = refusal("agents.compute=-1 ms", "agents.raet=3 Hz").splitlines()
    assert [line.split(": ")[0] for line in lines] == ["--set agents.compute", "--set agents.raet"]


def test_all_misfits_come_at_once(refusal: Refusal) -> None:
    """What does not fit together is listed together too."""
    lines = refusal("faults.0.cut=7-8", "faults.1.where=[1>3]", "world={kind: target, sees: {9: x}}").splitlines()
    assert [line.split(": ")[0] for line in lines] == ["--set faults.0.cut", "--set faults.1.where", "--set world"]


def test_a_fault_that_the_links_cannot_bear_is_refused_at_the_fault(refusal: Refusal) -> None:
    """Slots and sizes are checked for the settings that faults bring as well."""
    assert "--set faults.1.set.rate: a frame of" not in refusal("faults.1.set.mtu=45 B")
    assert refusal("faults.1.set.mtu=45 B").startswith("--set faults.1.set.mtu: a payload of 46 B is larger")
    assert "example.yaml:17:42: faults.1.set: a frame of 50.000 ms" in refusal(
        replacing=("set: {loss: {bernoulli: 0.5}}", "set: {rate: 10 kbit/s}")
    )


def test_a_loop_without_any_delay_is_refused(refusal: Refusal) -> None:
    """Compute, airtime and shortest latency may not all be 0."""
    message = refusal("agents.compute=0", "links.latency=0", "links.medium=full-duplex", "links.rate=null")
    assert "compute, airtime and shortest latency add up to 0" in message


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "s.yaml: the file is empty"),
        ("- 1\n- 2\n", "s.yaml:1:1: a scenario is a mapping"),
        ("seed: 7\nname: [", "s.yaml:2:8: not YAML"),
        ("seed: 7\n\tname: x\n", "s.yaml:2:1: not YAML"),
        ("seed: 7\nseed: 8\n", "s.yaml:2:1: not YAML: found duplicate key"),
        ("name: !!python/name:os.system x\n", "s.yaml:1:7: tag:yaml.org,2002:python/name:os.system has no place here"),
        ("1: a\n'1': b\n", "s.yaml:1:1: one of the keys 1 occurs twice"),
        ("name: \x00\n", "s.yaml: not YAML"),
    ],
)
def test_what_is_not_a_mapping_in_yaml_is_refused(tmp_path: Path, text: str, message: str) -> None:
    """Empty files, other types, broken YAML, duplicate keys and tags are each named."""
    path = tmp_path / "s.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(BadInput, match=r"s\.yaml") as caught:
        load_scenario(path)
    assert message in str(caught.value)


def test_a_file_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    """Missing files, folders and other encodings are named with the reason."""
    with pytest.raises(BadInput, match=r"none\.yaml: cannot be read: No such file"):
        load_scenario(str(tmp_path / "none.yaml"))
    with pytest.raises(BadInput, match="cannot be read: Is a directory"):
        load_scenario(tmp_path)
    (tmp_path / "latin.yaml").write_bytes("name: Nägeli".encode("latin-1"))
    with pytest.raises(BadInput, match="the byte at 7 is not UTF-8"):
        load_scenario(tmp_path / "latin.yaml")


def test_an_unknown_name_proposes_the_nearest() -> None:
    """A built-in scenario is found by name, a near miss is named."""
    with pytest.raises(BadInput, match=r"there is no scenario 'dfa16-losy' .did you mean 'dfa16-lossy'"):
        load_scenario("dfa16-losy")


def test_long_names_of_scenarios_are_refused() -> None:
    """No name of a file has more than 255 bytes; the system's own error would be no message."""
    with pytest.raises(BadInput, match=r"the scenario's name a+… has 300 bytes: it may have at most 255"):
        load_scenario("a" * 300)


def test_quoted_digits_are_names(load: Load) -> None:
    """`01` in quotes is the agent 01, which is not the agent 1."""
    scenario = load("faults.0.cut='01'", replacing=("{line: 3}", "{edges: ['01-2', 2-3, 3-01]}"))
    (fault,) = compile_plan(replace(scenario, faults=scenario.faults[:1])).faults
    assert isinstance(fault, LinkFault)
    assert set(fault.links) == {("01", "2"), ("2", "01"), ("01", "3"), ("3", "01")}


def test_a_byte_order_mark_before_a_scenario_is_no_part_of_it(tmp_path: Path) -> None:
    """Editors of Windows write one."""
    path = tmp_path / "s.yaml"
    path.write_text(f"\ufeff{TEXT}", "utf-8")
    assert load_scenario(path).scenario.name == "example"


@pytest.mark.parametrize(
    ("topology", "note"),
    [
        (
            "{schedule: [{from: 0 s, line: 3}, {from: 5 s, ring: 3}, {from: 7 s, line: 3}]}",
            "topology.schedule.2 is left out: starts at 7 s, the run ends at 6 s",
        ),
        (
            "{edges: {1-2: always, 2-3: [[0 s, 8 s], [9 s]], 1-3: [[7 s, 8 s]]}}",
            "topology.edges.2-3.1 is left out: starts at 9 s, the run ends at 6 s",
        ),
    ],
)
def test_an_override_shortens_graphs_that_change(tmp_path: Path, topology: str, note: str) -> None:
    """What starts after the new end is left out with a note, where the file says the duration itself refused."""
    path = tmp_path / "s.yaml"
    path.write_text(TEXT.replace("{line: 3}", topology).partition("faults:")[0], "utf-8")
    shortened = load_scenario(path, ["duration=6 s"])
    assert note in shortened.notes
    assert read_document(resolved_yaml(shortened.scenario), "").data["duration"] == "6 s"
    presence = shortened.plan.presence
    assert all(end <= 6 * 10**9 for spans in presence.values() for _, end in spans)
    path.write_text(path.read_text("utf-8").replace("duration: 10 s", "duration: 6 s"), "utf-8")
    with pytest.raises(BadInput, match="is not within the run, which lasts 6 s"):
        load_scenario(path)


def test_the_name_is_by_default_the_file(tmp_path: Path) -> None:
    """A scenario without a name is called as its file."""
    path = tmp_path / "mine.yaml"
    path.write_text(TEXT.replace("name: example\n", ""), encoding="utf-8")
    assert load_scenario(path).plan.name == "mine"


def test_the_file_of_a_graph_is_found_beside_the_scenario(
    load: Load, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A relative path starts at the scenario's folder, on the command line at the current one, and is kept absolute."""
    for folder, edges in (("", "1 2\n2 3\n"), ("elsewhere", "1 2\n2 4\n")):
        (tmp_path / folder).mkdir(exist_ok=True)
        (tmp_path / folder / "graph.edgelist").write_text(edges, encoding="utf-8")
    monkeypatch.chdir(tmp_path / "elsewhere")
    beside = load(replacing=("{line: 3}", "{file: graph.edgelist}"))
    assert beside.topology == FromFile(str(tmp_path / "graph.edgelist"))
    here = load("topology.file=graph.edgelist")
    assert here.topology == FromFile(str(tmp_path / "elsewhere" / "graph.edgelist"))
