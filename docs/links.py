"""Draws the figures of links.md, one for each parameter of a link, and prints the numbers that the page quotes.

Usage: python docs/links.py FIGURE|all [--out docs/images/links]
"""

# ruff: noqa: T201, TID251 - it prints what it found, and is a user of the package
from __future__ import annotations

import argparse
import statistics
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from matplotlib import style
from matplotlib.figure import Figure
from space_time import MS, WIDTH_IN, counts, frames, legend, planned, settings_of, simulate, space_time

from volery.experiments.figures import BLACK, BLUE, GREEN, GREY, SKY, STYLE, VERMILION
from volery.transport.latencies import Latency
from volery.transport.losses import Loss
from volery.transport.stages import Surroundings

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


# -- loss ---------------------------------------------------------------------------------------------------------


def lost(model: Loss, count: int, link: str = "2", every_ns: int = 10_000_000) -> list[bool]:
    """Which of so many frames a model loses, on the link from 1 to `link`."""
    stage = model.stage(Surroundings.of(1, "1", link))
    return [stage.lost(index, index * every_ns, 400) for index in range(count)]


def bursts(losses: Sequence[bool]) -> list[int]:
    """Lengths of the runs of lost frames."""
    return [len(run) for run in "".join("x" if one else "." for one in losses).split(".") if run]


def loss(figure: Figure) -> Iterator[str]:
    """Eight links with 200 frames each; a dark tick is a lost frame."""
    figure.set_size_inches(WIDTH_IN, 3.0)
    kinds = (
        ("bernoulli", "{bernoulli: 0.2}"),
        ("gilbert-elliott", "{gilbert-elliott: {to_bad: 0.025, to_good: 0.1}}"),
    )
    for (name, written), axes in zip(kinds, figure.subplots(len(kinds), 1, sharex=True), strict=True):
        (model,) = settings_of(f"links.loss={written}").loss
        for row in range(8):
            where = np.flatnonzero(lost(model, 200, str(row + 2)))
            axes.vlines(where, row - 0.4, row + 0.4, color=VERMILION, lw=1.4)
        axes.set_title(name, loc="left")
        axes.set_yticks([])
        axes.set_ylabel("link")
        many = lost(model, 100_000)
        mean, length = statistics.fmean(many), statistics.fmean(bursts(many))
        yield f"{name}: {mean:.1%} of 100,000 frames lost, {model.mean:.1%} asked; {length:.1f} frames a burst"
    axes.set_xlim(0, 200)
    axes.set_xlabel("frame")


def corruption(figure: Figure) -> Iterator[str]:
    """Frames that arrive damaged, and frames that arrive twice."""
    figure.set_size_inches(WIDTH_IN, 1.9)
    record = simulate(
        "agents={kind: beacon, talkers: [1], rate: 50 Hz, phase: aligned, size: 50 B}",
        "links={rate: 100 kbit/s, latency: {uniform: {low: 5 ms, high: 25 ms}}, corruption: 0.2, duplication: 0.2}",
    )
    space_time(figure.subplots(), record, 0, 320)
    legend(figure, "delivered", "corrupt")
    copies = sum(sent.copy for sent, _, _ in frames(record, "1", "2"))
    yield f"corruption 0.2, duplication 0.2: {counts(record)}, {copies} of them copies"


# -- latency ------------------------------------------------------------------------------------------------------


def delays(model: Latency, count: int) -> list[float]:
    """Latencies of so many frames on one link [ms]."""
    stage = model.stage(Surroundings.of(1, "1", "2"))
    return [stage(index, index * 10_000_000) / MS for index in range(count)]


def latency(figure: Figure) -> Iterator[str]:
    """How the latencies of 20,000 frames spread, for each law."""
    figure.set_size_inches(WIDTH_IN, 2.2)
    laws = (
        ("constant", "{constant: 10 ms}"),
        ("uniform", "{uniform: {low: 5 ms, high: 15 ms}}"),
        ("normal", "{normal: {mean: 10 ms, sd: 3 ms}}"),
    )
    for (name, written), axes in zip(laws, figure.subplots(1, len(laws), sharex=True), strict=True):
        model = settings_of(f"links.latency={written}").latency
        found = delays(model, 20_000)
        axes.hist(found, np.arange(0, 25.5, 0.5), color=SKY)
        axes.axvline(model.minimum_ns / MS, color=BLACK, ls=":")
        axes.axvline(model.mean_ns / MS, color=VERMILION)
        axes.set_title(name, loc="left")
        axes.set_yticks([])
        axes.set_xlim(0, 25)
        axes.set_xlabel("latency (ms)")
        shortest, mean = f"shortest {min(found):.2f} ms", f"mean {statistics.fmean(found):.2f} ms"
        yield f"{name}: {shortest}, {mean}; asked {model.minimum_ns / MS:.2f} and {model.mean_ns / MS:.2f} ms"


def order(figure: Figure) -> Iterator[str]:
    """Frames that overtake each other, and the same frames kept in order."""
    figure.set_size_inches(WIDTH_IN, 2.8)
    for word, axes in zip(("true", "false"), figure.subplots(2, 1, sharex=True), strict=True):
        record = simulate(
            "agents={kind: beacon, talkers: [1], rate: 100 Hz, phase: aligned, size: 20 B}",
            f"links={{rate: 100 kbit/s, latency: {{uniform: {{low: 5 ms, high: 45 ms}}}}, reordering: {word}}}",
        )
        space_time(axes, record, 0, 200)
        axes.set_title(f"reordering: {word}", loc="left")
        axes.label_outer()
        dues = [due for _, _, due in frames(record, "1", "2")]
        overtaken = sum(due < max(dues[:index], default=0) for index, due in enumerate(dues))
        yield f"reordering: {word}: {overtaken} of {len(dues)} frames overtake an earlier one"


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
        axes.axvspan(100, 200, color=GREY, lw=0, zorder=0)
        space_time(axes, record, 0, 300)
        axes.set_title(f"{name}: true from 100 to 200 ms", loc="left")
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
    for distance, label in ((40, "radius"), (50, "radius + hysteresis")):
        axes.axhline(distance, color=BLACK, ls=":")
        axes.text(60.5, distance, label, va="center", fontsize=7)
    axes.set_xlim(0, 60)
    axes.set_ylim(0)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("distance (m)")
    there = sum(end - start for start, end in plan.presence["1", "2"]) / plan.duration_ns
    yield f"the link is there in {len(plan.presence['1', '2'])} spans, {there:.0%} of the time"


# -- The command --------------------------------------------------------------------------------------------------

Draw = Callable[[Figure], Iterator[str]]
DRAWN: dict[str, Draw] = {
    draw.__name__: draw
    for draw in (
        medium,
        access,
        airtime,
        queue,
        bucket,
        loss,
        corruption,
        latency,
        order,
        hold,
        direction,
        presence,
    )
}


def main() -> None:
    """Draw what is asked for and print its numbers."""
    parser = argparse.ArgumentParser(description="Figures of links.md, drawn from volery's twin.")
    parser.add_argument("which", choices=[*DRAWN, "all"])
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "images" / "links", help="folder")
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    for name, draw in DRAWN.items():
        if asked.which in (name, "all"):
            with style.context(STYLE):
                figure = Figure(layout="constrained")
                print(*(f"{name}: {line}" for line in draw(figure)), sep="\n")
                figure.savefig(asked.out / f"{name}.png", dpi=120)


if __name__ == "__main__":
    main()
