"""The twin: delivered frames per processor second through the full pipeline, few agents and many, beside SimPy."""

from __future__ import annotations

from measuring import in_turn, median_ratio, medians, table, verdict

FEW, MANY = 20, 1000
FRAMES = 60_000
REPETITIONS = 5
RATE_BOUND, COST_BOUND = 40_000, 2.0


def main() -> None:
    """Measure and print."""
    print("each agent to 4 neighbours at 50 Hz; twin: TDMA, rate, Gilbert-Elliott loss, normal latency, encoded frames")
    names = {(side, agents): f"{side}, {agents:,} agents" for side in ("twin", "simpy") for agents in (FEW, MANY)}
    samples = in_turn(
        {
            name: {"function": f"twins:{side}_run", "agents": agents, "frames": FRAMES}
            for (side, agents), name in names.items()
        },
        REPETITIONS,
    )
    rows = []
    for name, taken in samples.items():
        middle = medians(taken)
        rows.append([name, f"{middle['frames']:,.0f}", f"{middle['cpu_us']:.1f}", f"{1e6 / middle['cpu_us']:,.0f}"])
    table(["side", "delivered", "CPU µs per frame", "frames per CPU second"], rows)
    few, many = samples[names["twin", FEW]], samples[names["twin", MANY]]
    verdict(f"delivered frames per CPU second, {FEW} agents", 1e6 / medians(few)["cpu_us"], RATE_BOUND, at_least=True)
    verdict(f"cost per frame, {MANY:,} agents over {FEW}", median_ratio(many, few, "cpu_us"), COST_BOUND)


if __name__ == "__main__":
    main()
