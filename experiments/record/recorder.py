"""Writes a run down as it happens: record.mcap, readable up to the last flush whatever ends the run.

Topics: /agents/<name>/estimates, one message an estimate; /agents/<name>/frames, one message a batch, and
/agents/<name>/facts (samples, commands, payloads), one for several batches, rows as arrays in the order of the fields
of agents.journal; /agents/<name>/events; /run/events. Messages are JSON with a JSON Schema, their time is the nominal
time in nanoseconds since the start of the run.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from pathlib import Path
from queue import SimpleQueue
from types import TracebackType
from typing import IO, Any, Self

from mcap.writer import Writer

from ...agents.journal import FACT_ROWS, FRAME_ROWS, Batch
from ...errors import BadInput
from .encoding import dump, row_to_json, tag, vector_to_json
from .run_files import RECORD_FILE

PROFILE = "volery"
_FACTS_TOGETHER = 100
_NICENESS = 19
ESTIMATES, FACTS, FRAMES, EVENTS, RUN_EVENTS = "estimates", "facts", "frames", "events", "/run/events"


def _object(required: dict[str, Any]) -> dict[str, Any]:
    return {"type": "object", "properties": required, "required": sorted(required)}


def _rows(kind: Any) -> dict[str, Any]:
    width = len(kind._fields)
    return {
        "type": "array",
        "description": ", ".join(kind._fields),
        "items": {"type": "array", "minItems": width, "maxItems": width},
    }


_INTEGER, _TEXT = {"type": "integer"}, {"type": "string"}
_NUMBER = {"anyOf": [{"type": "number"}, {"enum": ["nan", "inf", "-inf"]}]}
SCHEMAS: dict[str, dict[str, Any]] = {
    ESTIMATES: _object(
        {"incarnation": _INTEGER, "quantity": _TEXT, "index": _INTEGER, "value": {"type": "array", "items": _NUMBER}}
    ),
    FACTS: _object({"incarnation": _INTEGER, **{name: _rows(kind) for name, kind in FACT_ROWS.items()}}),
    FRAMES: _object({"incarnation": _INTEGER, **{name: _rows(kind) for name, kind in FRAME_ROWS.items()}}),
    EVENTS: _object({"incarnation": _INTEGER, "event": {"type": "object"}}),
    RUN_EVENTS: _object({"event": _TEXT}),
}


class Recorder:
    """Sink of a run that writes `folder`/record.mcap; a context manager, and its owner calls `flush` now and then.

    Raises:
        BadInput: the folder has a record already.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / RECORD_FILE
        self._file: IO[bytes]
        self._writer: Writer
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._counts: dict[str, int] = {}
        self._facts: dict[tuple[str, int], Batch] = {}
        self._now_ns = 0

    def __enter__(self) -> Self:
        try:
            self._file = self._path.open("xb")
        except FileExistsError as error:
            raise BadInput(f"{self._path} exists already: name another folder, no record is overwritten") from error
        self._writer = Writer(self._file)
        self._writer.start(profile=PROFILE)
        self._schemas = {
            name: self._writer.register_schema(f"volery.{name.strip('/')}", "jsonschema", dump(schema))
            for name, schema in SCHEMAS.items()
        }
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._write_facts()
            self._writer.finish()
        finally:
            self._file.close()

    def __call__(self, batch: Batch) -> None:
        """Write the entries of one agent."""
        who = f"/agents/{batch.agent}"
        for time_ns, quantity, index, value in batch.estimates:
            estimate = {"quantity": quantity, "index": index, "value": vector_to_json(value)}
            self._write(f"{who}/{ESTIMATES}", ESTIMATES, time_ns, {"incarnation": batch.incarnation, **estimate})
        self._keep_facts(batch)
        rows = {name: getattr(batch, name) for name in FRAME_ROWS}
        if any(rows.values()):
            self._write(f"{who}/{FRAMES}", FRAMES, batch.last_ns, {"incarnation": batch.incarnation, **rows})
        for event in batch.events:
            time_ns = event.get("time_ns", self._now_ns)
            self._write(f"{who}/{EVENTS}", EVENTS, time_ns, {"incarnation": batch.incarnation, "event": tag(event)})

    def event(self, event: dict[str, Any]) -> None:
        """Write an event of the run."""
        self._write(RUN_EVENTS, RUN_EVENTS, event.get("time_ns", self._now_ns), tag(event))

    def flush(self) -> None:
        """Bring everything so far into the file, where it survives the end of this process."""
        self._write_facts()
        self._writer.flush()

    def _keep_facts(self, batch: Batch) -> None:
        """Gather facts into larger messages: alone they are shorter than what a message adds to them."""
        life = (batch.agent, batch.incarnation)
        waiting = self._facts.setdefault(life, Batch(*life))
        for name in FACT_ROWS:
            getattr(waiting, name).extend(getattr(batch, name))
        if sum(len(getattr(waiting, name)) for name in FACT_ROWS) >= _FACTS_TOGETHER:
            self._write_facts()

    def _write_facts(self) -> None:
        for batch in filter(None, self._facts.values()):
            facts = {name: [row_to_json(row) for row in getattr(batch, name)] for name in FACT_ROWS}
            message = {"incarnation": batch.incarnation, **facts}
            self._write(f"/agents/{batch.agent}/{FACTS}", FACTS, batch.last_ns, message)
        self._facts = {}

    def _write(self, topic: str, schema: str, time_ns: int, message: dict[str, Any]) -> None:
        self._now_ns = max(self._now_ns, time_ns)
        if topic not in self._channels:
            self._channels[topic] = self._writer.register_channel(topic, "json", self._schemas[schema])
            self._counts[topic] = 0
        self._writer.add_message(self._channels[topic], time_ns, dump(message), time_ns, self._counts[topic])
        self._counts[topic] += 1


class BackgroundSink:
    """Hands what it is given to a recorder, in order, on a thread of the lowest priority; leaving it waits for all.

    Writing the record must not make frames late.

    Raises on leaving what the recorder raised.
    """

    def __init__(self, recorder: Recorder) -> None:
        self._recorder = recorder
        self._work: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._write, name="volery-record", daemon=True)

    def __call__(self, batch: Batch) -> None:
        """Take the entries of one agent."""
        self._work.put(lambda: self._recorder(batch))

    def event(self, event: dict[str, Any]) -> None:
        """Take an event of the run."""
        self._work.put(lambda: self._recorder.event(event))

    def flush(self) -> None:
        """Bring everything so far into the file, soon."""
        self._work.put(self._recorder.flush)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._work.put(None)
        self._thread.join()
        if self._error is not None:
            raise self._error

    def _write(self) -> None:
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICENESS)
        while (work := self._work.get()) is not None:
            if self._error is None:
                try:
                    work()
                except BaseException as error:  # noqa: BLE001 - raised again where the sink is left
                    self._error = error
