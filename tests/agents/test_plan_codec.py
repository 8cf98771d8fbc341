"""Plans as JSON: what comes back has the same bits, what cannot be encoded is refused with its field."""

from __future__ import annotations

import json
import struct
from collections import namedtuple
from dataclasses import dataclass, fields, is_dataclass, replace
from enum import Enum
from typing import Any, NamedTuple

import msgpack
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from volery.agents.plan import AgentPlan, Plan
from volery.agents.plan_codec import Opaque, decode_plan, decode_value, encode_plan, encode_value
from volery.errors import BadInput
from volery.experiments.record.record import Collector
from volery.experiments.scenario.load import load_scenario
from volery.experiments.twin import Twin
from volery.transport.faults import LinkFault
from volery.transport.latency_settings import Constant
from volery.transport.links import LinkSettings
from volery.transport.loss_settings import Bernoulli

from ..surroundings import BUILT_IN

SETTINGS = LinkSettings(latency=Constant(5_000_000))
DURATIONS = {"beacons-moving": "1 s", "mav30": "50 ms"}


class Colour(Enum):
    """Something to choose."""

    RED = "red"
    BLUE = "blue"


class Pair(NamedTuple):
    """Two of a kind."""

    first: Any
    second: Any


@dataclass(frozen=True)
class Choice:
    """A user's parameters."""

    what: Any
    colour: Colour = Colour.RED


@dataclass
class Changeable:
    """Parameters that can change."""

    what: int = 0


Anonymous = namedtuple("Anonymous", "x")
Anonymous.__qualname__ = "somewhere.<locals>.Anonymous"


def plan_with(parameters: Any, kind: str = "beacon", **changes: Any) -> Plan:
    """A plan of two agents, the first of which has these parameters."""
    degrees = {"1": 1, "2": 1}
    agents = AgentPlan("1", kind, parameters, ("2",), degrees), AgentPlan("2", kind, None, ("1",), degrees)
    return Plan("some", 1, 10**9, agents, {("1", "2"): SETTINGS, ("2", "1"): SETTINGS}, **changes)


def back(parameters: Any) -> Any:
    """Parameters after encoding and decoding."""
    return decode_plan(encode_plan(plan_with(parameters))).agents[0].parameters


def bits(value: Any) -> Any:  # noqa: PLR0911 - a line for each type
    """What tells values apart: types, order, signs of zeros, bits of NaNs, layouts of arrays."""
    if isinstance(value, np.ndarray):
        order = "F" if value.flags.f_contiguous and not value.flags.c_contiguous else "C"
        return "array", value.dtype.str, value.shape, order, value.tobytes()
    if isinstance(value, np.generic):
        return type(value), value.dtype.str, value.tobytes()
    if type(value) is float:
        return float, struct.pack(">d", value)
    if isinstance(value, dict):
        return dict, [(bits(key), bits(item)) for key, item in value.items()]
    if isinstance(value, frozenset | set):
        return type(value), sorted(map(repr, map(bits, value)))
    if isinstance(value, list | tuple):
        return type(value), [bits(item) for item in value]
    if is_dataclass(value):
        return type(value), [bits(getattr(value, each.name)) for each in fields(value)]
    return type(value), value


FLOATS = st.floats() | st.integers(0, 2**64 - 1).map(lambda number: struct.unpack(">d", number.to_bytes(8, "big"))[0])
KEYS = st.text() | st.integers() | st.booleans() | st.tuples(st.text(), st.text()) | st.none()
NUMBERS = arrays.arrays(
    arrays.floating_dtypes() | arrays.integer_dtypes() | arrays.boolean_dtypes() | arrays.complex_number_dtypes(),
    arrays.array_shapes(min_dims=0, min_side=0),
)
LEAVES = (
    (st.none() | st.booleans() | st.integers() | FLOATS | st.text() | st.binary())
    | (NUMBERS | NUMBERS.map(np.asfortranarray) | FLOATS.map(np.float64) | st.sampled_from(Colour))
    | st.frozensets(st.text() | st.integers())
)
VALUES = st.recursive(
    LEAVES,
    lambda inner: (
        st.lists(inner)
        | st.lists(inner).map(tuple)
        | st.dictionaries(KEYS | st.sampled_from(["$", "$is", "$tuple"]), inner)
        | st.builds(Choice, inner, st.sampled_from(Colour))
        | st.builds(Pair, inner, inner)
    ),
    max_leaves=12,
)


@given(VALUES)
def test_every_value_comes_back_with_the_same_bits(value: Any) -> None:
    """Numbers of any size, NaNs, signs of zeros, arrays, tuples, mappings, frozen dataclasses, named tuples."""
    assert bits(back(value)) == bits(value)


@pytest.mark.parametrize("name", BUILT_IN)
def test_a_decoded_plan_is_equal_and_gives_the_same_journal(name: str) -> None:
    """Of every built-in scenario; encoded again, the text is the same; nothing of it is opaque to readers."""
    plan = load_scenario(name, [f"duration={DURATIONS.get(name, '0.2 s')}"]).plan
    text = encode_plan(plan)
    decoded = decode_plan(text)
    assert decoded == plan == decode_plan(text, only_read=True)
    assert encode_plan(decoded) == text
    journals = []
    for one in (plan, decoded):
        collector = Collector()
        Twin(one, collector).run()
        journals.append(collector)
    assert journals[0].batches == journals[1].batches
    assert journals[0].events == journals[1].events


def test_what_stands_in_several_places_is_written_once() -> None:
    """And is one object again."""
    text = encode_plan(plan_with(None))
    assert text.count("links:LinkSettings") == 1
    links = decode_plan(text).links
    assert links["1", "2"] is links["2", "1"]


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ({"a": [1, object()]}, r"plan\.agents\.0\.parameters\.a\.1: <object .* has no encoding: make it a frozen"),
        (
            Choice(Changeable()),
            r"parameters\.what: Changeable is a dataclass that can change: write @dataclass\(frozen",
        ),
        (np.array([None]), r"parameters: an array of object has no encoding: use numbers"),
        (Anonymous(3), r"parameters: somewhere\.<locals>\.Anonymous is defined in a function"),
        (lambda: 3, r"parameters: <function .* has no encoding"),
    ],
)
def test_what_has_no_encoding_is_refused_with_its_field(value: Any, message: str) -> None:
    """Before anything runs."""
    with pytest.raises(BadInput, match=message):
        encode_plan(plan_with(value))


def test_readers_see_values_of_users_classes_without_importing_them() -> None:
    """Name and fields; the module need not be there."""
    text = encode_plan(plan_with([Choice(3.0), Pair(1, (2,))])).replace(f"{__name__}:", "gone:")
    first, second = decode_plan(text, only_read=True).agents[0].parameters
    assert first == Opaque("gone:Choice", {"what": 3.0, "colour": Opaque("gone:Colour", {"name": "RED"})})
    assert second == Opaque("gone:Pair", {"first": 1, "second": (2,)})
    with pytest.raises(BadInput, match="gone:Colour, which the plan names, cannot be loaded: No module named 'gone'"):
        decode_plan(text)


def test_a_text_that_is_no_plan_of_this_version_is_refused() -> None:
    """With what it is."""
    text = encode_plan(plan_with(None))
    document = json.loads(text)
    for wrong, message in (
        (text[:-1], "not a plan"),
        ("[]", 'does not say "format"'),
        (json.dumps({**document, "version": 2}), "version 2, and this volery reads version 1"),
        (json.dumps({**document, "plan": [3]}), "not a plan but list"),
    ):
        with pytest.raises(BadInput, match=message):
            decode_plan(wrong)


def test_a_class_that_has_other_fields_now_is_named() -> None:
    """Instead of a value that is half right."""
    text = encode_plan(plan_with(Choice(1))).replace('"what"', '"which"')
    with pytest.raises(BadInput, match=r"test_plan_codec:Choice is another class than that of the plan: .*which"):
        decode_plan(text)


@pytest.mark.parametrize("only_read", [True, False])
def test_only_data_are_made(only_read: bool) -> None:
    """A text that names a function, or a class that does things, calls nothing."""
    for name in ("volery.units:quantity", "volery.experiments.twin:Twin"):
        text = encode_plan(plan_with(Choice(1))).replace(f"{__name__}:Choice", name)
        with pytest.raises(BadInput, match=f"{name}, which the plan names, is no dataclass, named tuple or enum"):
            decode_plan(text, only_read=only_read)


@given(
    st.builds(
        LinkFault,
        st.text(),
        st.integers(0, 9),
        st.none(),
        st.just((("1", "2"),)),
        st.fixed_dictionaries({"loss": st.tuples(st.builds(Bernoulli, st.floats(0, 1)))}),
    )
)
def test_a_live_fault_goes_to_agents_and_into_the_record(fault: LinkFault) -> None:
    """Through MessagePack and JSON, models included."""
    encoded = encode_value(fault)
    assert decode_value(msgpack.unpackb(msgpack.packb(encoded))) == fault
    assert decode_value(json.loads(json.dumps(encoded)), only_read=True) == fault


def test_a_changed_plan_is_another_text() -> None:
    """No field of it is left out."""
    plan = plan_with(None)
    changes: dict[str, Any] = {
        "seed": 2,
        "duration_ns": 5,
        "presence": {("1", "2"): ((0, 1),)},
        "slots": {"1": (0, 2)},
        "groups": {"all": ("1", "2")},
    }
    texts = {encode_plan(replace(plan, **{name: value})) for name, value in changes.items()}
    assert len(texts | {encode_plan(plan)}) == len(changes) + 1
