"""Propagation of a transmission on one directed link: loss → corruption → duplication → latency.

The sender decides all of these when the transmission starts, and writes the verdict into the frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from .directed_link import DirectedLink
from .latency_stages import LatencyStage, latency_stage
from .link_models import Latency, Loss
from .links import CORRUPT, CUT, DELIVERED, LOST, SHORTEST_TRAVEL_NS, LinkSettings
from .loss_stages import LossStage, loss_stages


class Copy(NamedTuple):
    """One arrival of a frame at its target: `copy` is 0, or 1 for a duplicate."""

    target: str
    sequence: int
    copy: int
    due_ns: int
    verdict: str


class Propagation:
    """Propagation to one target: a state machine without a clock. It also numbers the link's frames."""

    __slots__ = (
        "_corruptions",
        "_duplicates",
        "_last_due",
        "_latencies",
        "_link",
        "_losses",
        "_present",
        "next_sequence",
        "settings",
        "target",
    )

    def __init__(self, target: str, link: DirectedLink, settings: LinkSettings) -> None:
        self.target = target
        self.settings = settings
        self.next_sequence = 0
        self._link = link
        self._last_due = 0
        self._begin()

    def _begin(self) -> None:
        settings = self.settings
        self._present = present = self._link if settings.paired is None else self._link.by_slots()
        self._losses = loss_stages(settings.loss, present)
        self._corruptions = self._damages(settings.corruption)
        self._duplicates = present.stream("duplication")
        self._latencies = self._pipes(settings.latency)

    def _pipes(self, model: Latency) -> tuple[LatencyStage, LatencyStage]:
        """Latency stages of the frames, and of their duplicates."""
        return latency_stage(model, self._present), latency_stage(model, self._present.within("duplicate"))

    def _damages(self, models: Sequence[Loss]) -> tuple[list[LossStage], list[LossStage]]:
        """Corruption stages of the frames, and of their duplicates."""
        own, duplicate = self._present, self._present.within("duplicate")
        return loss_stages(models, own, "corruption"), loss_stages(models, duplicate, "corruption")

    def change(self, settings: LinkSettings) -> None:
        """Apply new settings; models that do not change keep their state."""
        before, self.settings = self.settings, settings
        if settings.paired != before.paired:
            self._begin()
            return
        if settings.loss != before.loss:
            self._losses = loss_stages(settings.loss, self._present)
        if settings.corruption != before.corruption:
            self._corruptions = self._damages(settings.corruption)
        if settings.latency != before.latency:
            self._latencies = self._pipes(settings.latency)

    def count(self) -> int:
        """Return the sequence number of the next frame, and count it."""
        self.next_sequence += 1
        return self.next_sequence - 1

    def send(self, sequence: int, start_ns: int, end_ns: int, bits: int) -> list[Copy]:
        """Arrivals of a frame with its airtime in [start, end), with the settings at this moment."""
        settings = self.settings
        index = settings.draw_index(sequence, start_ns)
        lost = False
        for stage in self._losses:
            lost |= stage.lost(index, start_ns, bits)
        damaged = self._damaged(0, index, start_ns, bits)
        cut = settings.cut or not settings.present
        verdict = CUT if cut else LOST if lost else damaged
        copies = [Copy(self.target, sequence, 0, self._due(0, index, start_ns, bits, end_ns), verdict)]
        if settings.duplication:
            damaged = self._damaged(1, index, start_ns, bits)
            if self._duplicates.uniform(index) < settings.duplication and not (cut or lost):
                copies.append(Copy(self.target, sequence, 1, self._due(1, index, start_ns, bits, end_ns), damaged))
        return copies

    def _damaged(self, copy: int, index: int, start_ns: int, bits: int) -> str:
        corrupt = False
        for stage in self._corruptions[copy]:
            corrupt |= stage.lost(index, start_ns, bits)
        return CORRUPT if corrupt else DELIVERED

    def _due(self, copy: int, index: int, start_ns: int, bits: int, end_ns: int) -> int:
        due = max(end_ns + self._latencies[copy](index, start_ns, bits, end_ns), start_ns + SHORTEST_TRAVEL_NS)
        if not self.settings.reordering:
            due = max(due, self._last_due)
        self._last_due = max(due, self._last_due)
        return due
