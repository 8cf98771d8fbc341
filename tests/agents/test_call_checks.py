"""What an agent gives to its context is checked at the call, and kept as plain values."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, cast

import msgpack
import numpy as np
import pytest

from volery.agents.agent import Command, Context, ContextState, Note, Report, Send, Timer
from volery.errors import BadInput


class Level(IntEnum):
    """A whole number by name."""

    HIGH = 3


@dataclass
class Pair:
    """Something that is no plain value."""

    x: float = 0.0


@pytest.fixture
def state() -> ContextState:
    """That of agent 1, with neighbour 2, in a coupled world."""
    return ContextState("1", 0, 7, ("1", "2"), None, None, True, {"2": "2"}, {"2": 100}, ("2",))


@pytest.fixture
def context(state: ContextState) -> Context:
    """Its context."""
    return Context(state)


def endless() -> list[Any]:
    """A list of rows that differ in length."""
    return [[1.0, 2.0], [3.0]]


WRONG: list[tuple[Callable[[Context], object], str]] = [
    (lambda c: c.set_timer(2.5e9), r"set_timer: time_ns is 2500000000.0, of type float, .* as in round\(time_ns\)"),  # type: ignore[arg-type]
    (
        lambda c: c.set_timer(np.float64(1e9)),  # type: ignore[arg-type]
        r"set_timer: time_ns is .*1000000000.0.*, of type float64, .*round\(time_ns\)",
    ),
    (lambda c: c.set_timer("1 s"), "set_timer: time_ns is '1 s', of type str, and not a whole number: give an int"),  # type: ignore[arg-type]
    (lambda c: c.set_timer(0, 5), "set_timer: name is 5, of type int, and not a text"),  # type: ignore[arg-type]
    (lambda c: c.set_timer(0, index=1.0), "set_timer: index is 1.0, of type float"),  # type: ignore[arg-type]
    (lambda c: c.set_timer(2**62), "set_timer: '' is set to 4611686018427387904 ns, later than every run"),
    (lambda c: c.set_timer(2**70), "set_timer: time_ns is 1180591620717411303424, and has more than 64 bits"),
    (lambda c: c.report("x", 1.0, 0.5), "report: index is 0.5, of type float"),  # type: ignore[arg-type]
    (lambda c: c.report("x", 1.0, 2**63), "report: index is 9223372036854775808, and has more than 64 bits"),
    (lambda c: c.report(b"x", 1.0), "report: the quantity is b'x', of type bytes, and not a text"),  # type: ignore[arg-type]
    (lambda c: c.report("\ud800", 1.0), r"report: the quantity is '\\ud800', which UTF-8 cannot encode"),
    (lambda c: c.report("x", 1j), "report: x is 1j, and not real numbers: give its real and imaginary parts"),
    (lambda c: c.report("x", np.array([1j])), "report: x is .*, and not real numbers: give its real"),
    (lambda c: c.report("x", "1.5"), "report: x is '1.5', and not real numbers"),
    (lambda c: c.report("x", None), "report: x is None, and not real numbers"),  # type: ignore[arg-type]
    (lambda c: c.report("x", {"a": 1.0}), "report: x is {'a': 1.0}, and not real numbers"),  # type: ignore[arg-type]
    (lambda c: c.report("x", Pair()), "report: x is .*Pair.*, and not real numbers"),  # type: ignore[arg-type]
    (lambda c: c.report("x", endless()), r"report: x is \[\[1.0, 2.0\], \[3.0\]\], whose rows differ in length"),
    (lambda c: c.report("x", []), "report: x has no number in it"),
    (lambda c: c.report("x", [1.0, 2.0], covariance=[1.0, 2.0]), r"covariance of x has the shape \(1, 2\)"),
    (lambda c: c.report("x", 1.0, covariance=-1.0), "covariance of x has the variance -1: variances are 0 or above"),
    (
        lambda c: c.report("x", [1.0, 2.0], covariance=[[2.0, 1.0], [0.0, 2.0]]),
        r"covariance of x is not symmetric: \[\[2.0, 1.0\], \[0.0, 2.0\]\]",
    ),
    (lambda c: c.note("x", f=Pair()), "note: f is .*Pair.*, of type Pair: give numbers, texts, or lists"),
    (lambda c: c.note("x", f=[1, {2}]), r"note: f\[1\] is \{2\}, of type set"),
    (lambda c: c.note("x", f={1: 2}), "note: a key of f is 1, of type int, and not a text"),
    (lambda c: c.note("x", f=2**64), "note: f is 18446744073709551616, and has more than 64 bits"),
    (lambda c: c.note("x", f=b"x"), "note: f is b'x', of type bytes"),
    (lambda c: c.note("x", f=1j), "note: f is 1j, of type complex"),
    (lambda c: c.note("x", event="killed"), "note: event is in every note anyway"),
    (lambda c: c.note(3), "note: what is 3, of type int, and not a text"),  # type: ignore[arg-type]
    (lambda c: c.command({"f": [1.0, np.nan]}), r"command: f is \[1.0, nan\]: every number must be finite"),
    (lambda c: c.command({"f": np.inf}), "command: f is inf: every number must be finite"),
    (lambda c: c.command({3: 1.0}), "command: a name is 3, of type int"),  # type: ignore[dict-item]
    (lambda c: c.command([1.0]), r"command: \[1.0\] is no mapping"),  # type: ignore[arg-type]
    (lambda c: c.send("2", "text"), "send: the payload is of type str, and not bytes: encode it"),  # type: ignore[arg-type]
    (lambda c: c.broadcast([1]), "send: the payload is of type list, and not bytes"),  # type: ignore[arg-type]
    (lambda c: c.send("2", b"x", 3), "send: the stream is 3, of type int"),  # type: ignore[arg-type]
    (lambda c: c.send(2, b"x"), "send: there is no link to 2; the neighbours are '2'"),  # type: ignore[arg-type]
    (lambda c: c.random(1), "random: the purpose is 1, of type int"),  # type: ignore[arg-type]
]


@pytest.mark.parametrize(("call", "message"), WRONG, ids=[message[:40] for _, message in WRONG])
def test_what_could_not_be_kept_is_refused_at_the_call(
    context: Context, state: ContextState, call: Callable[[Context], object], message: str
) -> None:
    """The sentence names the call and the value; nothing of it takes effect."""
    with pytest.raises(BadInput, match=message):
        call(context)
    assert state.effects == []


def test_numbers_of_numpy_are_numbers(context: Context, state: ContextState) -> None:
    """Integers of any kind are integers; arrays, scalars and tuples in notes become plain values."""
    context.set_timer(np.int64(5), "t", np.uint8(2))  # type: ignore[arg-type]
    context.report("x", np.float32(0.5), Level.HIGH)
    context.report("y", (True, np.int8(2)), np.array(4))  # type: ignore[arg-type]
    context.note("n", a=np.arange(2), b=np.float32(0.5), c=(np.True_, None, np.nan), d={"k": np.int64(1)})
    context.send("2", bytearray(b"abc"))  # type: ignore[arg-type]
    context.command({"f": np.float32(1.0)})
    timer, first, second, note, sent, command = cast("list[Any]", state.effects)
    assert (timer, first, second) == (Timer("t", 2, 5), Report("x", 3, [0.5]), Report("y", 4, [1.0, 2.0]))
    assert (type(note), command.commands["f"].tolist()) == (Note, [1.0])
    assert note.facts | {"c": note.facts["c"][:2]} == {"a": [0, 1], "b": 0.5, "c": [True, None], "d": {"k": 1}}
    whole = (timer.time_ns, timer.index, first.sample, second.sample, note.facts["d"]["k"])
    assert {type(value) for value in whole} == {int}
    assert type(sent.payload) is bytes
    assert msgpack.packb(note.facts)
    assert json.dumps(note.facts)


@pytest.mark.parametrize("odd", [[[1.0, 1e-9], [0.0, -1e-9]], [[np.inf, np.nan], [np.nan, np.inf]]])
def test_a_covariance_may_be_rounded_and_may_diverge(context: Context, state: ContextState, odd: list[Any]) -> None:
    """A filter that has diverged is to be seen in the record, and does not end the run."""
    context.report("x", [1.0, 2.0], covariance=odd)
    assert len(state.effects) == 2


def test_a_reported_array_may_be_changed_afterwards(context: Context, state: ContextState) -> None:
    """What was reported and commanded stays as it was at the call."""
    array, payload = np.ones(2), bytearray(b"a")
    context.report("x", array)
    context.command({"f": array})
    context.send("2", payload)  # type: ignore[arg-type]
    array[:] = 5.0
    payload[:] = b"b"
    report, command, sent = state.effects
    assert isinstance(command, Command)
    assert report == Report("x", 0, [1.0, 1.0])
    assert command.commands["f"].tolist() == [1.0, 1.0]
    assert sent == Send(("2",), b"a", "")
