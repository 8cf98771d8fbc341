"""What was recorded reads back, every bit of it, up to where the file was cut off."""

from __future__ import annotations

import json
import math
import re
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader

from volery.agents.journal import Arrived, Batch, Dropped, Estimate, Heard, Late, Released, Sent
from volery.agents.plan import Plan
from volery.errors import BadInput
from volery.experiments.record.mcap_file import recover
from volery.experiments.record.record import Collector, Record, collect
from volery.experiments.record.recorder import SCHEMAS, Recorder
from volery.experiments.twin import Twin

MS = 1_000_000
Make = Callable[..., Any]
NANOSECONDS = st.integers(0, 2**62)
NAMES = st.from_regex(r"[A-Za-z0-9_]{1,8}", fullmatch=True)
NUMBERS = st.integers(0, 2**40)
PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.sampled_from(["nan", "inf"]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)
BATCHES = st.builds(
    Batch,
    NAMES,
    st.integers(0, 5),
    st.lists(st.builds(Estimate, NANOSECONDS, NAMES, NUMBERS, st.lists(st.floats(), max_size=4)), max_size=4),
    st.lists(st.builds(Sent, NAMES, NUMBERS, NUMBERS, NANOSECONDS, NUMBERS, NANOSECONDS, NAMES), max_size=3),
    st.lists(st.builds(Heard, NAMES, NUMBERS, NUMBERS, NANOSECONDS, NAMES), max_size=3),
    st.lists(st.builds(Dropped, NAMES, NUMBERS, NANOSECONDS, NAMES), max_size=3),
    st.lists(st.builds(Late, NAMES, NUMBERS, NUMBERS, NANOSECONDS, NUMBERS), max_size=3),
    st.lists(st.builds(Released, NAMES, NUMBERS, NUMBERS, NANOSECONDS), max_size=3),
    st.lists(st.builds(Arrived, NAMES, NUMBERS, NUMBERS, st.integers(-5, 2**62), NANOSECONDS), max_size=3),
    st.lists(st.fixed_dictionaries({"event": NAMES, "data": PLAIN}, optional={"time_ns": NANOSECONDS}), max_size=2),
)


def same(left: Any, right: Any) -> bool:
    """Equality bit for bit of plain values, in which NaN equals NaN and 0.0 differs from −0.0."""
    if isinstance(left, dict):
        return left.keys() == right.keys() and all(same(left[key], right[key]) for key in left)
    if isinstance(left, list | tuple):
        return len(left) == len(right) and all(map(same, left, right))
    if isinstance(left, float):
        both_nan = math.isnan(left) and math.isnan(right)
        return isinstance(right, float) and (both_nan or left.hex() == right.hex())
    return type(left) is type(right) and bool(left == right)


def write(folder: Path, collector: Collector, *, flush: bool = False) -> None:
    """Record what a collector holds, if asked with a flush after each batch."""
    with Recorder(folder) as recorder:
        for batch in collector.batches.values():
            recorder(batch)
            if flush:
                recorder.flush()
        for event in collector.events:
            recorder.event(event)


@pytest.fixture
def run(plan_of: Make) -> Collector:
    """A short run of three agents, with a batch of each for every 100 ms of nominal time."""
    collector = Collector()
    plan: Plan = plan_of([("1", "2"), ("2", "3")], 400)
    Twin(plan, collector).run()
    return collector


@given(batches=st.lists(BATCHES, max_size=4), events=st.lists(st.fixed_dictionaries({"event": NAMES, "data": PLAIN})))
def test_everything_reads_back_bit_for_bit(batches: list[Batch], events: list[dict[str, Any]]) -> None:
    """All entries of all agents and all events, with floats of every kind, NaN and infinities among them."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        told = Collector()
        with Recorder(folder) as recorder:
            for batch in batches:
                recorder(batch)
                told(batch)
                recorder.flush()
            for event in events:
                recorder.event(event)
        read, recovered = collect(folder)
    assert not recovered
    assert same(read.events, events)
    expected = {life: batch for life, batch in told.batches.items() if batch}
    assert read.batches.keys() == expected.keys()
    for life, batch in expected.items():
        assert same(read.batches[life].to_dict(), batch.to_dict())


def test_other_programs_can_read_the_record(tmp_path: Path, run: Collector) -> None:
    """A plain MCAP reader finds JSON messages with a schema, at nominal time, and an index of them."""
    write(tmp_path, run)
    with (tmp_path / "record.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        messages = list(reader.iter_messages(topics="/agents/2/estimates"))
        summary = reader.get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert {channel.topic for channel in summary.channels.values()} == {
        "/run/events",
        *(f"/agents/{name}/{kind}" for name in "123" for kind in ("estimates", "frames")),
    }
    estimates = run.batches["2", 0].estimates
    assert len(messages) == len(estimates) > 0
    for (schema, channel, message), estimate in zip(messages, estimates, strict=True):
        assert schema is not None
        assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
        assert message.log_time == message.publish_time == estimate.time_ns
        assert json.loads(message.data)["value"] == estimate.value
        assert json.loads(schema.data) == SCHEMAS["estimates"]


def test_cut_off_anywhere_gives_a_prefix(tmp_path: Path, run: Collector) -> None:
    """Wherever the file ends, a reading says that it is cut off, and recovery makes a prefix of it readable."""
    whole = tmp_path / "whole"
    whole.mkdir()
    write(whole, run, flush=True)
    data = (whole / "record.mcap").read_bytes()
    chunks = 0
    for number, size in enumerate(sorted({*range(0, len(data), 97), *range(12), *range(len(data) - 12, len(data))})):
        folder = tmp_path / str(number)
        folder.mkdir()
        (folder / "record.mcap").write_bytes(data[:size])
        with pytest.raises(BadInput, match=r"record\.mcap is cut off.*volery recover"):
            collect(folder)
        report = recover(folder)
        assert report.kept is not None
        assert report.kept.read_bytes() == data[:size]
        read, recovered = collect(folder)
        assert recovered
        for life, batch in read.batches.items():
            whole_batch = run.batches[life].to_dict()
            for name, entries in batch.to_dict().items():
                assert same(entries, whole_batch[name][: len(entries)] if isinstance(entries, list) else entries)
        assert len(read.batches) >= chunks
        chunks = len(read.batches)
        assert recover(folder).kept is None
    assert chunks == len(run.batches)


def test_flush_survives_the_end_of_the_process(tmp_path: Path) -> None:
    """What was written before the last flush can be recovered though nothing was ever closed."""
    first, last = Batch("1", 0, [Estimate(5, "x", 0, [1.5])]), Batch("1", 0, [Estimate(6, "x", 1, [2.5])])
    recorder = Recorder(tmp_path).__enter__()
    recorder(first)
    recorder.flush()
    recorder(last)
    data = (tmp_path / "record.mcap").read_bytes()
    recorder.__exit__(None, None, None)
    (tmp_path / "record.mcap").write_bytes(data)
    assert recover(tmp_path).messages == 1
    assert collect(tmp_path)[0].batches == {("1", 0): first}


@pytest.mark.parametrize("place", [30, -6])
def test_damage_in_the_middle_is_named(tmp_path: Path, run: Collector, place: int) -> None:
    """A flipped byte in a chunk's data or checksum is noticed; what stands before that chunk can be recovered."""
    write(tmp_path, run, flush=True)
    path = tmp_path / "record.mcap"
    data = bytearray(path.read_bytes())
    chunk = [match.start() for match in re.finditer(b"zstd", data)][1]  # the second chunk's own record, not its index
    data[chunk + place] ^= 0xFF
    path.write_bytes(bytes(data))
    with pytest.raises(BadInput, match=r"record\.mcap is damaged .* after byte .*volery recover"):
        collect(tmp_path)
    assert "damaged" in str(recover(tmp_path))
    read, recovered = collect(tmp_path)
    assert recovered
    assert read.batches == dict(list(run.batches.items())[:1])


def test_whole_record_is_left_alone(tmp_path: Path, run: Collector) -> None:
    """Recovery does not touch a file that has its end."""
    write(tmp_path, run)
    before = (tmp_path / "record.mcap").read_bytes()
    assert "whole" in str(recover(tmp_path))
    assert (tmp_path / "record.mcap").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["record.mcap"]


def test_a_record_is_never_overwritten(tmp_path: Path, run: Collector) -> None:
    """A second recorder in the same folder is refused, and the first record stays."""
    write(tmp_path, run)
    with pytest.raises(BadInput, match="exists already"), Recorder(tmp_path):
        pass
    assert collect(tmp_path)[0].batches == run.batches


@pytest.mark.parametrize("action", [collect, recover])
def test_folder_without_a_record(tmp_path: Path, action: Callable[[Path], object]) -> None:
    """Neither reading nor recovery finds anything where no run was."""
    with pytest.raises(BadInput, match=r"has no record\.mcap"):
        action(tmp_path)


def test_a_file_of_something_else_is_refused(tmp_path: Path) -> None:
    """A file that never was a record is left as it is."""
    path = tmp_path / "record.mcap"
    path.write_bytes(b"PK\x03\x04 something else")
    with pytest.raises(BadInput, match="is no record"):
        recover(tmp_path)
    assert [path] == list(tmp_path.iterdir())


def test_estimates_of_several_lives_follow_each_other(record_of: Make) -> None:
    """An agent's reports come as arrays, those of a restart after those before it; missing and odd ones are errors."""
    record: Record = record_of(
        Batch("2", 1, [Estimate(7, "x", 3, [5.0, 6.0])]),
        Batch("2", 0, [Estimate(5, "x", 1, [1.0, 2.0]), Estimate(6, "y", 2, [0.0])]),
    )
    assert record.quantities() == ("x", "y")
    time_ns, sample, value = record.estimates("x")["2"]
    assert (time_ns.tolist(), sample.tolist(), value.tolist()) == ([5, 7], [1, 3], [[1.0, 2.0], [5.0, 6.0]])
    with pytest.raises(BadInput, match="nobody reported 'z'; this run has x, y"):
        record.estimates("z")


def test_quantity_that_changes_its_length_is_refused(record_of: Make) -> None:
    """The message names the agent and both lengths."""
    batches = Batch("1", 0, [Estimate(1, "x", 0, [1.0])]), Batch("2", 0, [Estimate(1, "x", 0, [])])
    with pytest.raises(BadInput, match=r"agent 2 reported 'x' with 0 components.*others have 1"):
        record_of(*batches)
