"""Radios with carrier sense in one collision domain, 20 nodes and 200: processor time beside SimPy, and ns-3."""

from __future__ import annotations

from importlib.util import find_spec

from measuring import in_turn, median_ratio, medians, table, verdict

FEW, MANY = 20, 200
SECONDS = {FEW: 60.0, MANY: 6.0}
REPETITIONS = 3
COST_BOUND = 2.0
PATTERN = "all broadcast 40 B at random, 30 % of a channel of 250 kbit/s, unslotted CSMA-CA of IEEE 802.15.4"


def main() -> None:
    """Measure and print."""
    print(PATTERN)
    names = {(side, nodes): f"{side}, {nodes} nodes" for side in ("twin", "simpy") for nodes in (FEW, MANY)}
    samples = in_turn(
        {
            name: {"function": f"radios:{side}_run", "nodes": nodes, "seconds": SECONDS[nodes]}
            for (side, nodes), name in names.items()
        },
        REPETITIONS,
    )
    rows = []
    for name, taken in samples.items():
        middle = medians(taken)
        rows.append([name, f"{middle['receptions']:,.0f}", f"{middle['delivered']:.1%}", f"{middle['cpu_us']:.1f}"])
    table(["side", "receptions", "delivered", "CPU µs per reception"], rows)
    few, many = samples[names["twin", FEW]], samples[names["twin", MANY]]
    verdict(f"cost per reception, {MANY} nodes over {FEW}", median_ratio(many, few, "cpu_us"), COST_BOUND)
    if find_spec("ns") is None:
        print("ns-3 is not installed here: no such line")


if __name__ == "__main__":
    main()
