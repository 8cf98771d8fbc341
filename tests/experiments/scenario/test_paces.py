"""What a pace cannot do is refused, whether it stands in the scenario or comes by a fault."""

from __future__ import annotations

import pytest

from volery.errors import BadInput
from volery.experiments.scenario.paces import check_pace
from volery.transport.faults import Hog, LinkFault
from volery.transport.media_settings import Aloha, Csma, FullDuplex, HalfDuplex

SENSING = HalfDuplex("node", Csma())
LINK = (("1", "2"),)


def test_carrier_sense_needs_nominal_time() -> None:
    """By the wall clock neither a link nor a fault may have it; elsewhere both may."""
    fault = LinkFault("t1", 0, None, LINK, {"medium": SENSING})
    for media, faults in (([SENSING], []), ([HalfDuplex("node", Aloha())], [fault])):
        with pytest.raises(BadInput, match="csma listens for what began microseconds ago"):
            check_pace(media, faults, realtime=True)
        check_pace(media, faults, realtime=False)
    check_pace([FullDuplex()], [LinkFault("t1", 0, None, LINK, {"cut": True})], realtime=True)


def test_a_hog_needs_the_clock() -> None:
    """In realtime pace only; the message names the faults."""
    hogs = [Hog("t1.1", 0, None, "1"), Hog("t1.2", 0, None, "2")]
    check_pace([], hogs, realtime=True)
    with pytest.raises(BadInput, match=r"fault t1\.1, t1\.2: a hog needs realtime pace"):
        check_pace([], hogs, realtime=False)
