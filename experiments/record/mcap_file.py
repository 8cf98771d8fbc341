"""Reads record.mcap, whole or cut off in the middle, and mends one that was cut off."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, NamedTuple

from mcap.exceptions import McapError
from mcap.records import Channel, Chunk, Header, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC, Writer
from zstandard import ZstdError

from ...errors import BadInput
from .recorder import PROFILE
from .run_files import EVALUATION_FILE, RECORD_FILE

RECOVERED = "volery.recovered"
_KEPT_SUFFIX = ".damaged"
_DAMAGE = (McapError, ZstdError, struct.error, ValueError, MemoryError)


class Entry(NamedTuple):
    """A message of the record; `time_ns` is the nominal time."""

    topic: str
    time_ns: int
    data: Any


@dataclass(frozen=True)
class RecoverReport:
    """What `recover` found: `damage` is empty and `kept` None for a whole record, which it leaves alone.

    `messages` is the number that can be read now; the damaged file is kept at `kept`.
    """

    messages: int
    damage: str
    kept: Path | None

    def __str__(self) -> str:
        """One sentence for the terminal."""
        if self.kept is None:
            return f"the record is whole: {self.messages} messages, nothing to do"
        return f"the record was {self.damage}: {self.messages} messages recovered, the rest kept in {self.kept.name}"


class _Walk:
    """One pass through a file, from the front; `damage` says in the end where and why it stopped, if it did."""

    def __init__(self, path: Path, file: IO[bytes]) -> None:
        self._path = path
        self._file = file
        self.size = path.stat().st_size
        self.damage = ""
        self.read_bytes = 0
        self.recovered = False

    def groups(self) -> Iterator[list[McapRecord]]:
        """The records of each whole chunk.

        Raises:
            BadInput: another program's file.
        """
        reader = StreamReader(self._file, emit_chunks=True, validate_crcs=True, record_size_limit=self.size)
        try:
            for record in reader.records:
                if isinstance(record, Header) and record.profile != PROFILE:
                    raise BadInput(f"{self._path} has the profile {record.profile!r}: another program wrote it")
                if isinstance(record, Metadata) and record.name == RECOVERED:
                    self.recovered = True
                if isinstance(record, Chunk):
                    group = breakup_chunk(record, validate_crc=True)
                    self.read_bytes = self._file.tell()
                    yield group
        except BadInput:
            raise
        except _DAMAGE as error:
            state = f"damaged ({type(error).__name__})" if self._ends_well() else "cut off"
            self.damage = f"{state} after byte {self.read_bytes} of {self.size}"

    def _ends_well(self) -> bool:
        self._file.seek(max(len(MCAP0_MAGIC), self.size - len(MCAP0_MAGIC)))
        return self._file.read() == MCAP0_MAGIC


def read(folder: Path) -> tuple[list[Entry], bool]:
    """The messages of a run's record in the order in which they were written, and whether it was recovered once.

    Raises:
        BadInput: no record, cut off, or damaged; the message says how to get at what is there.
    """
    path = _existing(folder)
    channels: dict[int, str] = {}
    entries: list[Entry] = []
    with path.open("rb") as file:
        walk = _Walk(path, file)
        for group in walk.groups():
            for record in group:
                if isinstance(record, Channel):
                    channels[record.id] = record.topic
                elif isinstance(record, Message):
                    entries.append(Entry(channels[record.channel_id], record.log_time, json.loads(record.data)))
    if walk.damage:
        raise BadInput(
            f"{path} is {walk.damage}; `volery recover {folder}` keeps the {len(entries)} messages before that"
        )
    return entries, walk.recovered


def recover(folder: Path) -> RecoverReport:
    """Make a record that was cut off readable: its whole chunks are written to a new file, and the old one is kept.

    An evaluation, which was of all of it, is removed.

    Raises:
        BadInput: no record, or a file that never was one.
    """
    path = _existing(folder)
    mended = path.with_suffix(".part")
    try:
        with path.open("rb") as file, mended.open("wb") as out:
            _check_start(path, file)
            walk = _Walk(path, file)
            messages = _copy(walk, Writer(out))
        if not walk.damage:
            return RecoverReport(messages, "", None)
        kept = path.with_suffix(path.suffix + _KEPT_SUFFIX)
        (folder / EVALUATION_FILE).unlink(missing_ok=True)
        path.replace(kept)
        mended.replace(path)
        return RecoverReport(messages, walk.damage, kept)
    finally:
        mended.unlink(missing_ok=True)


def _check_start(path: Path, file: IO[bytes]) -> None:
    start = file.read(len(MCAP0_MAGIC))
    if not MCAP0_MAGIC.startswith(start):
        raise BadInput(f"{path} is no record and nothing of it can be recovered: it starts with {start!r}")
    file.seek(0)


def _copy(walk: _Walk, writer: Writer) -> int:
    """Write the messages of every whole chunk; their number."""
    writer.start(profile=PROFILE)
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    count = 0
    for group in walk.groups():
        for record in group:
            if isinstance(record, Schema):
                schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
            elif isinstance(record, Channel):
                channels[record.id] = writer.register_channel(
                    record.topic, record.message_encoding, schemas[record.schema_id]
                )
            elif isinstance(record, Message):
                channel = channels[record.channel_id]
                writer.add_message(channel, record.log_time, record.data, record.publish_time, record.sequence)
                count += 1
        writer.flush()
    writer.add_metadata(RECOVERED, {"damage": walk.damage})
    writer.finish()
    return count


def _existing(folder: Path) -> Path:
    path = folder / RECORD_FILE
    if not path.is_file():
        raise BadInput(f"{folder} has no {RECORD_FILE}: it is not the folder of a run, `volery status` lists runs")
    return path
