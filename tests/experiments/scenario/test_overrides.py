"""Overrides from the command line: which value they replace, and how they are named in errors."""

from __future__ import annotations

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.errors import BadInput
from volery.experiments.scenario.yaml_document import assign, parse
from volery.topologies.over_time import GRAPHS
from volery.transport.latency_settings import Constant, Uniform
from volery.transport.loss_settings import Bernoulli, GilbertElliott
from volery.transport.media_settings import FullDuplex

from .conftest import Load, Refusal

_KEYS = st.sampled_from(["a", "b", "c", "0", "1"])


def test_a_value_is_replaced(load: Load) -> None:
    """VALUE is YAML and is validated as if it stood in the file."""
    scenario = load("seed=11", "duration=12.5 s", "agents.rounds=5", "links.medium=full-duplex")
    assert (scenario.seed, scenario.duration, scenario.agents.parameters.rounds) == (11, 12_500_000_000, 5)
    assert scenario.links.base.medium == FullDuplex()


def test_another_model_replaces_the_one_in_the_file(load: Load) -> None:
    """A path into a one-key choice chooses; a path into the model that is there changes that model."""
    chosen = load("links.loss.bernoulli=0.3", "links.latency.uniform={low: 1 ms, high: 2 ms}", "topology.ring=5")
    assert chosen.links.base.loss == (Bernoulli(0.3),)
    assert chosen.links.base.latency == Uniform(1_000_000, 2_000_000)
    assert chosen.topology == GRAPHS.find("ring")(count=5)
    changed = load("links.loss.gilbert-elliott.to_bad=0.2")
    assert changed.links.base.loss == (GilbertElliott(0.2, 0.3, 0.9),)


def test_what_stands_beside_a_choice_stays(load: Load) -> None:
    """The spacing of a topology is no choice of another one."""
    assert load("topology.spacing=0.3 m").topology == GRAPHS.find("line")(count=3, spacing=0.3)


def test_a_bare_value_chooses_the_simplest_model(load: Load) -> None:
    """A number is a Bernoulli loss, a quantity a constant latency, `none` no loss."""
    assert load("links.loss=0.3", "links.latency=4 ms").links.base.loss == (Bernoulli(0.3),)
    assert load("links.latency=4 ms").links.base.latency == Constant(4_000_000)
    assert load("links.loss=none").links.base.loss == ()
    assert len(load("links.loss=[0.1, {bernoulli: 0.2}]").links.base.loss) == 2


def test_an_index_reaches_into_a_list(load: Load) -> None:
    """Entries of a list are counted from 0."""
    assert load("faults.1.at=7 s").faults[1].at == 7_000_000_000


def test_the_later_override_wins(load: Load) -> None:
    """Also where it replaces what an earlier one has put below it."""
    assert load("seed=1", "seed=2").seed == 2
    assert load("links.loss.bernoulli=0.1", "links.loss=none").links.base.loss == ()


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("seed", "--set seed: write KEY=VALUE"),
        ("=3", "--set =3: write KEY=VALUE"),
        ("links..loss=3", "--set links..loss=3: write KEY=VALUE"),
        ("links.loss={", "--set links.loss:1:2: not YAML"),
        ("links.lss.bernoulli=0.3", "--set links.lss.bernoulli: links.lss: unknown field (did you mean 'loss'?)"),
        ("lniks.loss.bernoulli=0.3", "--set lniks.loss.bernoulli: lniks: unknown field (did you mean 'links'?)"),
        ("links.loss.bernuli=0.3", "--set links.loss.bernuli: links.loss: unknown loss model 'bernuli' (did you"),
        ("links.loss.bernoulli=1.3", "--set links.loss.bernoulli: loss probability is 1.3"),
        ("agents.roundz=3", "--set agents.roundz: unknown field (did you mean 'rounds'?)"),
        ("seed.x=3", "--set seed.x: seed: should be a valid integer, not {'x': 3}"),
        ("faults.2.at=3 s", "--set faults.2.at: 'faults' is a list of 2, '2' is no index"),
        ("faults.first.at=3 s", "--set faults.first.at: 'faults' is a list of 2, 'first' is no index"),
        ("duration=", "--set duration: None has no unit"),
        ("name=!x y", "--set name:1:1: !x has no place here"),
    ],
)
def test_an_error_names_the_override(refusal: Refusal, override: str, message: str) -> None:
    """What came from the command line is not looked for in the file."""
    assert message in refusal(override)


def test_an_error_elsewhere_keeps_its_line(refusal: Refusal) -> None:
    """An override beside a wrong value does not take the blame."""
    assert refusal("links.mtu=99 B", replacing=("0.3,", "3,")).startswith("example.yaml:14:")


@given(st.dictionaries(_KEYS, st.dictionaries(_KEYS, st.integers())), st.lists(_KEYS, min_size=1, max_size=4))
def test_what_was_put_is_found_and_all_else_stays(data: dict[str, object], path: list[str]) -> None:
    """An assignment changes its own path and nothing beside it, and leaves its argument alone."""
    before = repr(data)
    changed, keys = assign(data, [f"{'.'.join(path)}=fresh"])
    node: object = changed
    for part in path:
        assert isinstance(node, dict)
        node = node[part]
    assert node == "fresh"
    assert list(keys.values()) == [".".join(path)]
    assert all(tuple(path)[: len(new)] == new for new in keys)
    assert {key: changed[key] for key in data if key != path[0]} == {key: data[key] for key in data if key != path[0]}
    assert repr(data) == before


@given(st.text(alphabet="ab01 :-{}[],'\"#&*!|>%@`\n\t\\.~?", max_size=24))
def test_no_text_breaks_the_reader(text: str) -> None:
    """Any text is read or refused, with no other error."""
    with contextlib.suppress(BadInput):
        parse(text, "text")
