"""The sending end of one link, made of its parts as a node makes it."""

from __future__ import annotations

from typing import NamedTuple

import pytest

from volery.topologies import natural_key
from volery.transport.directed_link import DirectedLink
from volery.transport.links import LinkSettings
from volery.transport.propagation import Propagation
from volery.transport.transmitter import Transmitter


class Sent(NamedTuple):
    """A frame that has started, seen from its only target."""

    sequence: int
    payload: bytes
    start_ns: int
    airtime_ns: int
    due_ns: int
    verdict: str


class SendingEnd:
    """Transmitter and propagation of the link source → target."""

    def __init__(
        self, settings: LinkSettings, source: str = "1", target: str = "2", incarnation: int = 0, seed: int = 7
    ) -> None:
        self.way = Propagation(target, DirectedLink.of(seed, source, target, incarnation), settings)
        self.outlet = Transmitter([self.way], int(natural_key(source) > natural_key(target)))
        self.next_start = self.outlet.next_start
        self.earliest_next = self.outlet.earliest_next

    def change(self, settings: LinkSettings) -> None:
        """New settings."""
        self.outlet.change(self.way.target, settings)

    @property
    def sequence(self) -> int:
        """The number of the next frame."""
        return self.way.next_sequence

    def offer(self, now_ns: int, payload: bytes, stream: str = "") -> list[int]:
        """What the queue throws out for a newcomer."""
        return [number for _, number in self.outlet.offer(now_ns, (self.way.target,), payload, stream)]

    def refuse(self) -> int:
        """The number of a frame that is too large."""
        return self.outlet.count((self.way.target,))[0][1]

    def waiting(self) -> list[int]:
        """The numbers in the queue."""
        return [number for _, number in self.outlet.waiting()]

    def transmit(self, now_ns: int, *, ahead: bool = False) -> Sent:
        """Start the frame at the head of the queue."""
        transmission = (self.outlet.transmit_ahead if ahead else self.outlet.transmit)(now_ns)
        first = transmission.copies[0]
        return Sent(
            first.sequence,
            transmission.payload,
            transmission.start_ns,
            transmission.airtime_ns,
            first.due_ns,
            first.verdict,
        )


@pytest.fixture(scope="session")
def sending_end() -> type[SendingEnd]:
    """Make the sending end of a link: `sending_end(settings, source, target, incarnation, seed)`."""
    return SendingEnd
