"""The sum over each link closes, fate by fate, and says where it does not."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from volery.agents.journal import Batch, Dropped, Late
from volery.agents.plan import Plan
from volery.agents.plan_codec import encode_value
from volery.experiments.analysis.accounting import LinkAccount, account, total
from volery.experiments.record.frame_fates import frame_fates
from volery.experiments.record.record import Collector, Record
from volery.transport.faults import Kill, LinkFault, Pause
from volery.transport.latency_settings import Normal
from volery.transport.links import LinkSettings, Queue
from volery.transport.loss_settings import Bernoulli
from volery.transport.media_settings import HalfDuplex

MS = 1_000_000
LINK = ("1", "2")
Make = Callable[..., Any]


def of_link(record: Record) -> LinkAccount:
    """The account of the link in question; the other direction must be empty and close."""
    accounts = account(record)
    back = accounts["2", "1"]
    assert back.closes
    assert back.offered == 0
    return accounts[LINK]


def test_each_fate_counts_once(record_of: Make, sent: Make, heard: Make) -> None:
    """A frame of every fate: delivered, lost by each cause, refused, queued out, in flight, waiting at the end."""
    sender = Batch("1", 0, sent=[sent(0, 0), sent(1, 10, "cut"), sent(2, 20), sent(3, 30, "loss"), sent(6, 996)])
    sender.dropped += [Dropped("2", 4, 40 * MS, "refused"), Dropped("2", 5, 50 * MS, "queue")]
    sender.events.append({"event": "queued", "target": "2", "sequences": [7, 8]})
    receiver = Batch(
        "2", 0, heard=[heard(0, 0), heard(1, 10, "cut"), heard(2, 20, "half-duplex"), heard(3, 30, "loss")]
    )
    one = of_link(record_of(sender, receiver))
    assert one.closes
    assert (one.offered, one.delivered, one.refused, one.queue, one.in_flight) == (9, 1, 1, 1, 3)
    assert one.lost == {"cut": 1, "half-duplex": 1, "loss": 1}
    assert (one.sent_bytes, one.delivered_bytes, one.airtime_ns, one.utilisation) == (50, 10, 10 * MS, 0.01)
    assert one.latency_ns == (3 * MS, 3 * MS, 3 * MS)
    assert one.delivered_fraction == 0.25


def test_duplicates_count_apart_from_what_was_offered(record_of: Make, sent: Make, heard: Make) -> None:
    """Two frames were offered; a copy has a fate of its own, and was on the air with its original."""
    sender = Batch("1", 0, sent=[sent(0, 0), sent(0, 0)._replace(copy=1, due_ns=9 * MS), sent(1, 10)])
    copy = heard(0, 0)._replace(copy=1, due_ns=9 * MS)
    one = of_link(record_of(sender, Batch("2", 0, heard=[heard(0, 0), copy, heard(1, 10)])))
    assert one.closes
    assert (one.offered, one.duplicated, one.delivered) == (2, 1, 3)
    assert (one.sent_bytes, one.delivered_bytes, one.airtime_ns) == (20, 30, 4 * MS)
    lost = of_link(record_of(sender, Batch("2", 0, heard=[heard(0, 0), heard(1, 10)])))
    assert (lost.offered, lost.duplicated, lost.missing, lost.closes) == (2, 1, 1, False)


def test_frame_that_nobody_heard_is_missing(record_of: Make, sent: Make, heard: Make) -> None:
    """A frame that was sent, due before the end and never heard is the middleware's loss: the sum stays open."""
    one = of_link(record_of(Batch("1", 0, sent=[sent(0, 0), sent(1, 10)]), Batch("2", 0, heard=[heard(1, 10)])))
    assert (one.missing, one.closes) == (1, False)


def test_gap_in_the_sequence_is_missing(record_of: Make, sent: Make, heard: Make) -> None:
    """A sequence number of which nobody tells, below one of which somebody does, is missing."""
    one = of_link(record_of(Batch("1", 0, sent=[sent(1, 0)]), Batch("2", 0, heard=[heard(1, 0)])))
    assert (one.offered, one.missing, one.closes) == (2, 1, False)


FLAWS = ["heard twice", "sent and queued out", "never sent", "other due time", "lost but heard"]


@pytest.mark.parametrize("flaw", FLAWS)
def test_contradiction_leaves_the_sum_open(record_of: Make, sent: Make, heard: Make, flaw: str) -> None:
    """Accounts that cannot both be true are counted and the sum does not close."""
    sender, receiver = Batch("1", 0, sent=[sent(0, 0)]), Batch("2", 0, heard=[heard(0, 0)])
    if flaw == "heard twice":
        receiver.heard *= 2
    elif flaw == "sent and queued out":
        sender.dropped.append(Dropped("2", 0, 0, "queue"))
    elif flaw == "never sent":
        sender.sent.clear()
    elif flaw == "other due time":
        receiver.heard = [heard(0, 1)]
    else:
        sender.sent = [sent(0, 0, "loss")]
    one = of_link(record_of(sender, receiver))
    assert (one.contradicted, one.closes) == (1, False)


@pytest.mark.parametrize(("until_ms", "lost"), [(None, 3), (120, 2)])
def test_frames_to_a_killed_agent_are_lost(
    record_of: Make, sent: Make, heard: Make, until_ms: int | None, lost: int
) -> None:
    """Due at the kill or later, started before the restart: lost because the receiver is down."""
    kill = Kill("t1", 100 * MS, None if until_ms is None else until_ms * MS, "2")
    events = [{"event": "died", "agent": "2", "incarnation": 0, "time_ns": 103 * MS, "cause": "injected"}]
    receivers = [Batch("2", 0, heard=[heard(0, 94)], events=[{"event": "killed", "time_ns": 100 * MS}])]
    if until_ms is not None:
        events.append({"event": "restarted", "agent": "2", "incarnation": 1, "time_ns": until_ms * MS})
        receivers.append(Batch("2", 1, heard=[heard(3, 120)]))
    sender = Batch("1", 0, sent=[sent(0, 94), sent(1, 95), sent(2, 119), sent(3, 120)])
    one = of_link(record_of(sender, *receivers, events=events, faults=(kill,)))
    assert one.closes
    assert (one.lost, one.delivered) == ({"receiver-down": lost}, 4 - lost)


def test_frame_sent_after_the_restart_must_be_heard(record_of: Make, sent: Make) -> None:
    """A kill explains nothing that started after the agent came back."""
    events = [{"event": "restarted", "agent": "2", "incarnation": 1, "time_ns": 120 * MS}]
    kill = Kill("t1", 100 * MS, 120 * MS, "2")
    one = of_link(record_of(Batch("1", 0, sent=[sent(0, 120)]), Batch("2", 1), events=events, faults=(kill,)))
    assert (one.missing, one.closes) == (1, False)


def test_live_kill_counts_as_one_of_the_scenario(record_of: Make, sent: Make) -> None:
    """A kill that came from a second terminal is in the run's events and explains what was not heard."""
    events = [{"event": "fault", "time_ns": 50 * MS, "fault": encode_value(Kill("l1", 100 * MS, None, "2"))}]
    one = of_link(record_of(Batch("1", 0, sent=[sent(0, 200)]), Batch("2", 0), events=events))
    assert one.closes
    assert one.lost == {"receiver-down": 1}


def test_cleared_fault_ends_when_it_was_cleared(record_of: Make) -> None:
    """The faults of a record are those of the plan and the live ones, with the ends that they came to have."""
    cut = LinkFault("t1", 100 * MS, 900 * MS, (LINK,), {"cut": True})
    pause = Pause("l1", 300 * MS, None, "2")
    events = [
        {"event": "fault", "time_ns": 300 * MS, "fault": encode_value(pause)},
        {"event": "cleared", "time_ns": 400 * MS, "id": "t1"},
    ]
    record: Record = record_of(events=events, faults=(cut,))
    assert record.faults == (LinkFault("t1", 100 * MS, 400 * MS, (LINK,), {"cut": True}), pause)


def test_waiting_frames_of_a_killed_sender_are_lost(record_of: Make) -> None:
    """What waits in the queue of an agent that a fault kills never goes out."""
    sender = Batch("1", 0, events=[{"event": "queued", "target": "2", "sequences": [0, 1]}])
    one = of_link(record_of(sender, Batch("1", 1), faults=(Kill("t1", 100 * MS, 200 * MS, "1"),)))
    assert one.closes
    assert one.lost == {"sender-down": 2}


@pytest.mark.parametrize(("life", "lost", "in_flight"), [(0, {"receiver-down": 1}, 0), (1, {}, 1)])
def test_held_frames_are_lost_with_the_life_that_held_them(
    record_of: Make, sent: Make, life: int, lost: dict[str, int], in_flight: int
) -> None:
    """A frame that a later life of its receiver still holds back at the end is on its way."""
    held = {"event": "held", "source": "1", "incarnation": 0, "sequences": [[0, 0]]}
    receiver = Batch("2", life, events=[held])
    at_ms = 70 if life else 10
    kill = Kill("t1", 50 * MS, 60 * MS, "2")
    one = of_link(record_of(Batch("1", 0, sent=[sent(0, at_ms)]), receiver, faults=(kill,)))
    assert one.closes
    assert (one.lost, one.in_flight) == (lost, in_flight)


def test_what_never_was_on_the_air_does_not_count_as_transmitted(record_of: Make, sent: Make, heard: Make) -> None:
    """A radio that gave up and a queue that died with its agent say nothing of the link's losses."""
    sender = Batch("1", 0, sent=[sent(0, 0)], dropped=[Dropped("2", 1, 10 * MS, "access")])
    sender.events.append({"event": "queued", "target": "2", "sequences": [2]})
    one = of_link(record_of(sender, Batch("2", 0, heard=[heard(0, 0)]), faults=(Kill("t1", 60 * MS, None, "1"),)))
    assert one.closes
    assert one.lost == {"access": 1, "sender-down": 1}
    assert (one.transmitted, one.delivered_fraction) == (1, 1.0)


@pytest.mark.parametrize("who", ["1", "2"])
def test_kill_from_outside_leaves_the_unknown(record_of: Make, sent: Make, heard: Make, who: str) -> None:
    """After an end was killed from outside nobody can tell what became of its last frames; earlier gaps are missing."""
    died = {"event": "died", "agent": who, "incarnation": 0, "time_ns": 60 * MS, "cause": "was killed from outside"}
    sender = Batch("1", 0, sent=[sent(0, 0), sent(1, 10), sent(2, 20), sent(3, 30)])
    receiver = Batch("2", 0, heard=[heard(0, 0), heard(2, 20)])
    one = of_link(record_of(sender, receiver, events=[died]))
    assert (one.delivered, one.unknown, one.missing) == (2, 1, 1)


def test_frames_of_which_only_the_receiver_tells(record_of: Make, sent: Make, heard: Make) -> None:
    """The last entries of a sender killed from outside never came: heard frames count, gaps among them are unknown."""
    died = {"event": "died", "agent": "1", "incarnation": 0, "time_ns": 60 * MS, "cause": "was killed from outside"}
    record = record_of(
        Batch("1", 0, sent=[sent(0, 0)]), Batch("2", 0, heard=[heard(0, 0), heard(2, 20)]), events=[died]
    )
    one = of_link(record)
    assert one.closes
    assert (one.offered, one.delivered, one.unknown) == (3, 2, 1)


def test_queues_do_not_keep_the_order_of_sequence_numbers(record_of: Make, sent: Make, heard: Make) -> None:
    """Killed from outside: 2 waited or left after the last entry while 3 was thrown out; 0 took its place behind 1."""
    died = {"event": "died", "agent": "1", "incarnation": 0, "time_ns": 60 * MS, "cause": "was killed from outside"}
    sender = Batch("1", 0, sent=[sent(1, 0), sent(0, 10)], dropped=[Dropped("2", 3, 20 * MS, "queue")])
    for more, unknown in (([], 2), ([heard(2, 30)], 0)):
        receiver = Batch("2", 0, heard=[heard(1, 0), *([heard(0, 10)] if more else []), *more])
        one = of_link(record_of(sender, receiver, events=[died]))
        assert one.closes
        assert (one.queue, one.unknown, one.missing, one.contradicted) == (1, unknown, 0, 0)


def test_late_frames_and_incarnations_are_kept_apart(record_of: Make, sent: Make, heard: Make) -> None:
    """Sequence numbers begin anew with each incarnation; a late frame is counted and keeps its fate."""
    kill = Kill("t1", 50 * MS, 60 * MS, "1")
    receiver = Batch("2", 0, heard=[heard(0, 0), heard(0, 70, incarnation=1)], late=[Late("1", 1, 0, 75 * MS, 9 * MS)])
    record = record_of(Batch("1", 0, sent=[sent(0, 0)]), Batch("1", 1, sent=[sent(0, 70)]), receiver, faults=(kill,))
    one = of_link(record)
    assert one.closes
    assert (one.offered, one.delivered, one.late) == (2, 2, 1)
    assert [frame.behind_ns for frame in frame_fates(record)[LINK]] == [None, 9 * MS]


def test_broken_off_run_has_no_missing_frames(plan_of: Make, sent: Make, heard: Make) -> None:
    """Without the run's end in the record, what is not told is unknown: the entries stop somewhere."""
    collector = Collector()
    collector(Batch("1", 0, sent=[sent(0, 0), sent(1, 10), sent(2, 90)]))
    collector(Batch("2", 0, heard=[heard(0, 0)]))
    one = of_link(collector.record(plan_of([LINK])))
    assert one.closes
    assert (one.delivered, one.unknown, one.in_flight) == (1, 1, 1)


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    loss=st.floats(0, 1),
    rate=st.sampled_from([None, 4000.0, 20_000.0]),
    limit=st.integers(1, 3),
    half=st.booleans(),
    kill=st.none() | st.tuples(st.integers(0, 450), st.none() | st.integers(451, 600)),
    cut=st.tuples(st.integers(0, 300), st.integers(301, 600)),
)
def test_every_run_in_the_twin_closes(
    plan_of: Make,
    twin_run: Callable[[Plan], Record],
    loss: float,
    rate: float | None,
    limit: int,
    half: bool,
    kill: tuple[int, int | None] | None,
    cut: tuple[int, int],
) -> None:
    """Whatever the links and faults do, every frame has exactly one fate."""
    faults: list[Any] = [LinkFault("t1", cut[0] * MS, cut[1] * MS, (("1", "2"),), {"cut": True})]
    if kill is not None:
        faults.append(Kill("t2", kill[0] * MS, None if kill[1] is None else kill[1] * MS, "2"))
    link = LinkSettings(
        rate=rate,
        queue=Queue(limit, "drop-head"),
        loss=(Bernoulli(loss),),
        duplication=0.3,
        latency=Normal(20 * MS, 10 * MS),
    )
    if half:
        link = LinkSettings(**{**link.__dict__, "medium": HalfDuplex()})
    record = twin_run(plan_of([("1", "2"), ("2", "3")], 600, settings=link, faults=tuple(faults)))
    accounts = account(record)
    assert all(one.closes for one in accounts.values())
    assert total(accounts.values())["offered"] >= 11  # agent 3 alone sends once each 50 ms
