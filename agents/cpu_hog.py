"""A CPU hog: keeps an agent's interpreter busy for a share of the time."""

from __future__ import annotations

import threading
import time

_SLICE_S = 0.01


class Burner:
    """A thread that burns processor time while its share is above 0. A shell: it lives by the wall clock."""

    def __init__(self) -> None:
        self._share = 0.0
        self._wanted = threading.Event()
        self._thread: threading.Thread | None = None

    def burn(self, share: float) -> None:
        """Take this share of the time from now on; 0 for none."""
        self._share = share
        if share <= 0:
            self._wanted.clear()
            return
        self._wanted.set()
        if self._thread is None:
            self._thread = threading.Thread(target=self._go_on, name="hog", daemon=True)
            self._thread.start()

    def _go_on(self) -> None:
        while self._wanted.wait():
            until = time.perf_counter() + _SLICE_S * self._share
            while time.perf_counter() < until:
                pass
            time.sleep(_SLICE_S * (1 - self._share))
