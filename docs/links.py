"""Draws the figures of links.md, one for each parameter of a link, and prints the numbers that the page quotes.

Usage: python docs/links.py FIGURE|all [--out docs/images]
"""

# ruff: noqa: TID251 - it is a user of the package
from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from link_models import bit_error, correlation, corruption, distance, latency, loss, order, paired, time_loss, trace
from matplotlib.figure import Figure
from page_figures import Draw, draw_asked
from space_time import MS, WIDTH_IN, counts, frames, legend, planned, settings_of, simulate, space_time

from volery.experiments.figures.run_figures import BLACK, BLUE, GREEN, GREY, SKY, VERMILION

# -- airtime and queue --------------------------------------------------------------------------------------------


def airtime(figure: Figure) -> Iterator[str]:
    """Airtime against payload, for a plain link, one with overhead, and a UART."""
    figure.set_size_inches(WIDTH_IN, 2.0)
    axes = figure.subplots()
    kinds = (
        ("8 bits a byte", [], SKY, "-"),
        ("8 bits, overhead 20 B", ["links.overhead=20 B"], BLUE, "--"),
        ("10 bits, overhead 20 B", ["links.overhead=20 B", "links.bits_per_byte=10"], VERMILION, "-"),
    )
    for label, fields, colour, dashes in kinds:
        settings = settings_of("links.rate=115.2 kbit/s", "links.mtu=128 B", *fields)
        sizes = np.arange(settings.mtu + 1)
        axes.plot(sizes, [settings.airtime_ns(int(size)) / MS for size in sizes], dashes, color=colour, label=label)
        yield f"{label}: 40 B take {settings.airtime_ns(40) / MS:.3f} ms at 115.2 kbit/s"
    axes.axvspan(settings.mtu, 150, color=GREY, lw=0)
    axes.text(settings.mtu + 2, 2, "over the\nMTU:\nrefused", fontsize=7)
    axes.set_xlim(0, 150)
    axes.set_ylim(0)
    axes.set_xlabel("payload (B)")
    axes.set_ylabel("airtime (ms)")
    axes.legend(loc="upper left")


def queue(figure: Figure) -> Iterator[str]:
    """How old frames are when they arrive, over a link that is offered twice what it can carry."""
    figure.set_size_inches(WIDTH_IN, 2.0)
    axes = figure.subplots()
    looks = (("drop-tail", VERMILION, "o"), ("drop-head", BLUE, "s"), ("latest", GREEN, "^"))
    for policy, colour, marker in looks:
        record = simulate(
            "agents={kind: beacon, talkers: [1], rate: 100 Hz, phase: aligned, size: 25 B}",
            f"links={{rate: 10 kbit/s, queue: {{limit: 8, policy: {policy}}}}}",
        )
        told = frames(record, "1", "2")
        ages = [(sent.sequence * 10.0, (due - MS) / MS - sent.sequence * 10.0) for sent, _, due in told]
        axes.plot(*zip(*ages, strict=True), marker, ms=3, color=colour, label=policy)
        dropped = len(record.batches["1", 0].dropped)
        yield f"{policy}: {dropped} of 100 thrown out; the last one that arrived was {ages[-1][1]:.0f} ms old"
    axes.set_xlim(0, 1000)
    axes.set_ylim(0)
    axes.set_xlabel("offered at (ms)")
    axes.set_ylabel("age on arrival (ms)")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside right center")


def bucket(figure: Figure) -> Iterator[str]:
    """Bytes that have left, with and without a token bucket."""
    figure.set_size_inches(WIDTH_IN, 2.0)
    axes = figure.subplots()
    for label, field, colour in (
        ("no bucket", "null", SKY),
        ("bucket: 4 kbit/s, 200 B", "{rate: 4 kbit/s, burst: 200 B}", BLUE),
    ):
        record = simulate(
            "agents={kind: beacon, talkers: [1], rate: 40 Hz, phase: aligned, size: 25 B}",
            f"links={{rate: 100 kbit/s, bucket: {field}}}",
        )
        told = frames(record, "1", "2")
        times = [sent.start_ns / MS for sent, _, _ in told]
        axes.step(times, np.cumsum([sent.size for sent, _, _ in told]), where="post", color=colour, label=label)
        yield f"{label}: {sum(sent.size for sent, _, _ in told)} B left in 1 s"
    axes.plot([0, 1000], [200, 700], ":", color=BLACK, label="200 B + 4 kbit/s")
    axes.set_xlim(0, 1000)
    axes.set_ylim(0)
    axes.set_xlabel("time (ms)")
    axes.set_ylabel("sent (B)")
    axes.legend(loc="upper left")


# -- media --------------------------------------------------------------------------------------------------------

CROWD = "agents={kind: beacon, rate: 45 Hz, size: 50 B, pattern: poisson, broadcast: true}"


def _panels(
    figure: Figure, kinds: Sequence[tuple[str, str]], topology: str, span: tuple[float, float]
) -> Iterator[str]:
    panels = figure.subplots(len(kinds), 1, sharex=True, squeeze=False)[:, 0]
    for (label, medium), axes in zip(kinds, panels, strict=True):
        record = simulate(f"topology={topology}", CROWD, f"links={{medium: {medium}, rate: 100 kbit/s, latency: 1 ms}}")
        space_time(axes, record, *span)
        axes.set_title(label, loc="left")
        axes.label_outer()
        yield f"{label}: {counts(record)}"


def medium(figure: Figure) -> Iterator[str]:
    """Three agents in a line, over separate channels, transceivers of edges, and radios."""
    figure.set_size_inches(WIDTH_IN, 4.2)
    kinds = (
        ("full-duplex", "full-duplex"),
        ("half-duplex, per: edge", "{kind: half-duplex, per: edge, access: aloha}"),
        ("half-duplex, per: node", "{kind: half-duplex, per: node, access: aloha}"),
    )
    yield from _panels(figure, kinds, "{line: 3}", (0, 200))
    legend(figure, "delivered", "half-duplex", "collision")


def access(figure: Figure) -> Iterator[str]:
    """Radios that send when ready, at the beginning of slots, or in slots of their own."""
    figure.set_size_inches(WIDTH_IN, 4.2)
    kinds = (
        ("aloha", "{kind: half-duplex, per: node, access: aloha}"),
        ("slotted-aloha", "{kind: half-duplex, per: node, access: {slotted-aloha: 5 ms}}"),
        ("tdma", "{kind: half-duplex, per: node, access: {tdma: {cycle: 50 Hz, guard: 0.5 ms}}}"),
    )
    yield from _panels(figure, kinds, "{line: 3}", (0, 200))
    legend(figure, "delivered", "half-duplex", "collision")


# -- states that faults change ------------------------------------------------------------------------------------

STEADY = "agents={kind: beacon, talkers: [1], rate: 50 Hz, phase: aligned, size: 50 B}"


def hold(figure: Figure) -> Iterator[str]:
    """A link that is cut for a while, and one that holds frames back for as long."""
    figure.set_size_inches(WIDTH_IN, 3.0)
    for name, axes in zip(("cut", "hold"), figure.subplots(2, 1, sharex=True), strict=True):
        record = simulate(
            STEADY,
            "links={rate: 100 kbit/s, latency: 10 ms}",
            f"faults=[{{at: 100 ms, until: 200 ms, where: all, set: {{{name}: true}}}}]",
        )
        space_time(axes, record, 0, 300)
        axes.label_outer()
        held = sum(due != sent.due_ns for sent, _, due in frames(record, "1", "2"))
        yield f"{name}: {counts(record)}, {held} held back"
    legend(figure, "delivered", "cut")


def direction(figure: Figure) -> Iterator[str]:
    """One edge with another latency and loss in each direction."""
    figure.set_size_inches(WIDTH_IN, 1.9)
    record = simulate(
        "agents={kind: beacon, rate: 50 Hz, size: 50 B}",
        "links={rate: 100 kbit/s, latency: 5 ms, only: [{where: 2>1, latency: 40 ms, loss: 0.3}]}",
    )
    space_time(figure.subplots(), record, 0, 300)
    legend(figure, "delivered", "loss")
    for link in (("1", "2"), ("2", "1")):
        yield f"{'>'.join(link)}: {counts(record, link)}"


def presence(figure: Figure) -> Iterator[str]:
    """Two agents that move: how far apart they are, and when there is a link between them."""
    figure.set_size_inches(WIDTH_IN, 2.2)
    plan = planned(
        "duration=60 s",
        "seed=5",
        "topology={proximity: {radius: 40 m, every: 100 ms, hysteresis: 10 m}}",
        "world={kind: moving, random-waypoint: {area: [80 m, 80 m], speed: [3 m/s, 6 m/s], count: 2}}",
    )
    axes = figure.subplots()
    times = np.arange(0, 60, 0.1)
    axes.plot(times, [plan.distance_m("1", "2", int(time * 1e9)) for time in times], color=BLUE)
    for start, end in plan.presence["1", "2"]:
        axes.axvspan(start / 1e9, end / 1e9, color=GREY, lw=0, zorder=0)
    for limit, label in ((40, "radius"), (50, "radius + hysteresis")):
        axes.axhline(limit, color=BLACK, ls=":")
        axes.text(60.5, limit, label, va="center", fontsize=7)
    axes.set_xlim(0, 60)
    axes.set_ylim(0)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("distance (m)")
    there = sum(end - start for start, end in plan.presence["1", "2"]) / plan.duration_ns
    yield f"the link is there in {len(plan.presence['1', '2'])} spans, {there:.0%} of the time"


# -- The command --------------------------------------------------------------------------------------------------

DRAWN: dict[str, Draw] = {
    draw.__name__: draw
    for draw in (
        medium,
        access,
        airtime,
        queue,
        bucket,
        loss,
        time_loss,
        bit_error,
        distance,
        trace,
        corruption,
        latency,
        correlation,
        order,
        paired,
        hold,
        direction,
        presence,
    )
}


if __name__ == "__main__":
    draw_asked("links", "Figures of links.md, drawn from volery's twin.", DRAWN, pictures="links/", dpi=120)
