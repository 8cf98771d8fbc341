"""A sink on a thread of its own, with the lowest priority: writing the record must not make frames late."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from queue import SimpleQueue
from types import TracebackType
from typing import Any, Self

from ...agents.journal import Batch
from .recorder import Recorder

_NICENESS = 19


class BackgroundSink:
    """Hands what it is given to a recorder, in order, on another thread; leaving it waits until all is written.

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
