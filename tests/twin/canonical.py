"""The canonical journal of a run: one sequence of bytes for one course of events, however it was recorded."""

from __future__ import annotations

import msgpack

from volery.experiments.record.record import Record
from volery.topologies import natural_key


def canonical(record: Record) -> bytes:
    """What every life of every agent wrote down, in one order and one encoding.

    Agents in natural order, their lives in order; entries of one kind by their own fields, since the order in which
    frames of different links were written down means nothing. Events of processes, which differ by rights between
    engines, are left out.
    """
    lives = sorted(record.batches, key=lambda life: (natural_key(life[0]), life[1]))
    rows = []
    for life in lives:
        batch = record.batches[life]
        frames = [sorted(map(tuple, entries)) for entries in (batch.sent, batch.heard, batch.dropped)]
        rows.append([*life, list(map(tuple, batch.estimates)), *frames])
    packed: bytes = msgpack.packb(rows)
    return packed
