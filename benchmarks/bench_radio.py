"""Radios with carrier sense in one collision domain, 20 nodes and 200: processor time beside SimPy, and ns-3."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

from measuring import in_turn, median_ratio, medians, table, verdict
from radios import FRAME_BYTES, RATE, frames_per_second

FEW, MANY = 20, 200
SECONDS = {FEW: 30.0, MANY: 3.0}
REPETITIONS = 3
COST_BOUND = 2.0
PATTERN = "all broadcast 40 B at random, 30 % of a channel of 250 kbit/s, unslotted CSMA-CA of IEEE 802.15.4"


def main() -> None:
    """Measure and print."""
    print(PATTERN)
    sides = ("twin", "simpy") if find_spec("ns") is None else ("twin", "simpy", "ns-3")
    names = {(side, nodes): f"{side}, {nodes} nodes" for side in sides for nodes in (FEW, MANY)}
    samples = in_turn({name: _call(side, nodes) for (side, nodes), name in names.items()}, REPETITIONS)
    rows = []
    for name, taken in samples.items():
        middle = medians(taken)
        rows.append([name, f"{middle['receptions']:,.0f}", f"{middle['delivered']:.1%}", f"{middle['cpu_us']:.1f}"])
    table(["side", "receptions", "delivered", "CPU µs per reception"], rows)
    few, many = samples[names["twin", FEW]], samples[names["twin", MANY]]
    verdict(f"cost per reception, {MANY} nodes over {FEW}", median_ratio(many, few, "cpu_us"), COST_BOUND)
    if "ns-3" not in sides:
        print("ns-3 is not installed here: no line for it (pip install ns3)")
    else:
        print("ns-3's CSMA channel is a bus on which nothing collides")


def _call(side: str, nodes: int) -> dict[str, Any]:
    """What `measuring.fresh` calls for a sample."""
    if side != "ns-3":
        return {"function": f"radios:{side}_run", "nodes": nodes, "seconds": SECONDS[nodes]}
    traffic = {"frames_per_second": frames_per_second(nodes), "frame_bytes": FRAME_BYTES, "bits_per_second": RATE}
    return {"function": "ns3_radios:run", "nodes": nodes, "seconds": SECONDS[nodes], **traffic}


if __name__ == "__main__":
    main()
