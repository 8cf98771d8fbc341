"""The figures of links.md about models: which frames are lost or damaged, and how long they travel."""

# ruff: noqa: TID251 - it is a user of the package
from __future__ import annotations

import statistics
from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from space_time import MS, WIDTH_IN, counts, frames, legend, settings_of, simulate, space_time

from volery.experiments.figures.run_figures import BLACK, BLUE, SKY, VERMILION
from volery.transport.directed_link import DirectedLink
from volery.transport.latency_stages import latency_stage
from volery.transport.link_models import Latency, Loss
from volery.transport.loss_stages import loss_stage

# -- loss ---------------------------------------------------------------------------------------------------------


def lost(model: Loss, count: int, link: str = "2", every_ns: int = 10_000_000) -> list[bool]:
    """Which of so many frames a model loses, on the link from 1 to `link`."""
    stage = loss_stage(model, DirectedLink.of(1, "1", link))
    return [stage.lost(index, index * every_ns, 400) for index in range(count)]


def bursts(losses: Sequence[bool]) -> list[int]:
    """Lengths of the runs of lost frames."""
    return [len(run) for run in "".join("x" if one else "." for one in losses).split(".") if run]


def _draw_eight(
    axes: Axes,
    title: str,
    model: Loss,
    count: int,
    *,
    every_ms: int = 20,
    apart: float = 0.02,
    width: float = 0.8,
) -> None:
    """Eight links with one model and so many frames each; a dark tick is a lost frame."""
    for row in range(8):
        where = apart * np.flatnonzero(lost(model, count, str(row + 2), every_ms * 1_000_000))
        axes.vlines(where, row - 0.4, row + 0.4, color=VERMILION, lw=width)
    axes.set_title(title, loc="left")
    axes.set_yticks([])
    axes.set_ylabel("link")


def loss(figure: Figure) -> Iterator[str]:
    """Eight links with 200 frames each; a dark tick is a lost frame."""
    figure.set_size_inches(WIDTH_IN, 3.0)
    kinds = (
        ("bernoulli", "{bernoulli: 0.2}"),
        ("gilbert-elliott", "{gilbert-elliott: {to_bad: 0.025, to_good: 0.1}}"),
    )
    for (name, written), axes in zip(kinds, figure.subplots(len(kinds), 1, sharex=True), strict=True):
        (model,) = settings_of(f"links.loss={written}").loss
        _draw_eight(axes, name, model, 200, every_ms=10, apart=1, width=1.4)
        many = lost(model, 100_000)
        mean, length = statistics.fmean(many), statistics.fmean(bursts(many))
        yield f"{name}: {mean:.1%} of 100,000 frames lost, {model.mean:.1%} asked; {length:.1f} frames a burst"
    axes.set_xlim(0, 200)
    axes.set_xlabel("frame")


def time_loss(figure: Figure) -> Iterator[str]:
    """Eight links over ten seconds; dark is when frames are lost."""
    figure.set_size_inches(WIDTH_IN, 4.2)
    kinds = (
        ("bernoulli with correlation", "{bernoulli: {probability: 0.2, correlation: 0.9}}"),
        ("gilbert-elliott-time", "{gilbert-elliott-time: {mean_good: 2 s, mean_bad: 500 ms, loss_bad: 0.9}}"),
        ("markov", "{markov: {mean_up: 2 s, mean_down: 500 ms}}"),
    )
    for (name, written), axes in zip(kinds, figure.subplots(len(kinds), 1, sharex=True), strict=True):
        (model,) = settings_of(f"links.loss={written}").loss
        _draw_eight(axes, name, model, 500)
        for every_ms in (10, 100):
            many = lost(model, 200_000, every_ns=every_ms * 1_000_000)
            length = statistics.fmean(bursts(many))
            told = f"{statistics.fmean(many):.1%} lost, {length:.1f} a burst, {length * every_ms:.0f} ms"
            yield f"{name}, a frame every {every_ms} ms: {told}"
    axes.set_xlim(0, 10)
    axes.set_xlabel("time (s)")


def bit_error(figure: Figure) -> Iterator[str]:
    """Fraction of frames lost against their length, found and by the formula."""
    figure.set_size_inches(WIDTH_IN, 2.0)
    axes = figure.subplots()
    bits = np.array([8 * size for size in (10, 20, 50, 100, 200, 500, 1000, 1500)])
    for rate, colour, marker in ((1e-4, VERMILION, "o"), (1e-5, BLUE, "s")):
        (model,) = settings_of(f"links.loss={{bit-error: {rate:.0e}}}".replace("1e", "1.0e")).loss
        found = []
        for length in bits.tolist():
            stage = loss_stage(model, DirectedLink.of(1, "1", "2"))
            found.append(statistics.fmean(stage.lost(index, 0, length) for index in range(10_000)))
        axes.semilogx(bits / 8, found, marker, ms=4, color=colour, label=f"one bit in {1 / rate:,.0f}")
        axes.semilogx(bits / 8, 1 - (1 - rate) ** bits, color=colour)
        yield f"one wrong bit in {1 / rate:,.0f}: {found[3]:.1%} of frames of 100 B lost, {found[7]:.1%} of 1500 B"
    axes.set_xlabel("length (B)")
    axes.set_ylabel("lost")
    axes.set_ylim(0)
    axes.legend(loc="upper left")


def distance(figure: Figure) -> Iterator[str]:
    """An agent that drives away: what is lost on the way, with and without shadowing."""
    figure.set_size_inches(WIDTH_IN, 2.2)
    axes = figure.subplots()
    edges = np.arange(0, 201, 5)
    kinds = (
        ("no shadowing", "", BLUE, "s"),
        ("shadowing 6 dB", ", shadowing: 6 dB, decorrelation: 500 ms", VERMILION, "o"),
    )
    for label, shadowing, colour, marker in kinds:
        record = simulate(
            "duration=200 s",
            "world={kind: moving, paths: {1: {0 s: [0, 0]}, 2: {0 s: [1, 0], 200 s: [201, 0]}}}",
            "agents={kind: beacon, talkers: [1], rate: 50 Hz}",
            f"links={{loss: {{distance: {{exponent: 2.7, sensitivity: -95 dBm{shadowing}}}}}}}",
        )
        told = frames(record, "1", "2")
        apart = [record.plan.distance_m("1", "2", sent.start_ns) for sent, _, _ in told]
        swallowed = [fate == "loss" for _, fate, _ in told]
        counted, gone = (
            np.histogram(apart, edges)[0],
            np.histogram(apart, edges, weights=np.array(swallowed, dtype=float))[0],
        )
        axes.plot(edges[:-1] + 2.5, gone / np.maximum(counted, 1), marker, ms=3, color=colour, label=label)
        by_place = dict(zip(edges.tolist(), (gone / np.maximum(counted, 1)).tolist(), strict=False))
        yield f"{label}: " + ", ".join(
            f"{by_place[near]:.0%} lost at {near} to {near + 5} m" for near in (50, 100, 150)
        )
    axes.set_xlim(0, 200)
    axes.set_ylim(0, 1)
    axes.set_xlabel("distance (m)")
    axes.set_ylabel("lost")
    axes.legend(loc="upper left")


def trace(figure: Figure) -> Iterator[str]:
    """A recorded course of losses that repeats, and frames that are named."""
    figure.set_size_inches(WIDTH_IN, 2.6)
    kinds = (
        ("trace", "{trace: {times: [0 s, 2 s, 3 s], losses: [0.0, 0.8, 0.2], repeat: 4 s}}"),
        ("frames", "{frames: {lost: [10, 50, [100, 150]]}}"),
    )
    for (name, written), axes in zip(kinds, figure.subplots(len(kinds), 1, sharex=True), strict=True):
        (model,) = settings_of(f"links.loss={written}").loss
        _draw_eight(axes, name, model, 400)
        yield f"{name}: {sum(lost(model, 400, every_ns=20_000_000))} of 400 frames lost"
    axes.set_xlim(0, 8)
    axes.set_xlabel("time (s), a frame every 20 ms")


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
    stage = latency_stage(model, DirectedLink.of(1, "1", "2"))
    return [stage(index, 0, 0, index * 10_000_000) / MS for index in range(count)]


def latency(figure: Figure) -> Iterator[str]:
    """How the latencies of 20,000 frames spread, for each law."""
    figure.set_size_inches(WIDTH_IN, 3.4)
    laws = (
        ("constant", "{constant: 10 ms}"),
        ("uniform", "{uniform: {low: 5 ms, high: 15 ms}}"),
        ("normal", "{normal: {mean: 10 ms, sd: 3 ms}}"),
        ("gamma", "{gamma: {mean: 10 ms, sd: 4 ms, min: 2 ms}}"),
        ("lognormal", "{lognormal: {mean: 10 ms, sd: 4 ms, min: 2 ms}}"),
        ("pareto", "{pareto: {min: 6 ms, shape: 2.5}}"),
    )
    panels = figure.subplots(2, 3, sharex=True).ravel()
    for (name, written), axes in zip(laws, panels, strict=True):
        model = settings_of(f"links.latency={written}").latency
        found = delays(model, 20_000)
        axes.hist(found, np.arange(0, 25.5, 0.5), color=SKY)
        axes.axvline(model.minimum_ns / MS, color=BLACK, ls=":")
        axes.axvline(model.mean_ns / MS, color=VERMILION)
        axes.set_title(name, loc="left")
        axes.set_yticks([])
        axes.set_xlim(0, 25)
        shortest, mean = f"shortest {min(found):.2f} ms", f"mean {statistics.fmean(found):.2f} ms"
        yield f"{name}: {shortest}, {mean}; asked {model.minimum_ns / MS:.2f} and {model.mean_ns / MS:.2f} ms"
    figure.supxlabel("latency (ms)", fontsize=8)


def correlation(figure: Figure) -> Iterator[str]:
    """One law with and without correlation, and a recorded course."""
    figure.set_size_inches(WIDTH_IN, 3.4)
    kinds = (
        ("normal", "{normal: {mean: 10 ms, sd: 3 ms}}"),
        ("normal, correlation 0.95", "{normal: {mean: 10 ms, sd: 3 ms, correlation: 0.95}}"),
        ("trace", "{trace: {times: [0 s, 1 s, 1.5 s], latencies: [5 ms, 15 ms, 9 ms], repeat: 2 s}}"),
    )
    for (name, written), axes in zip(kinds, figure.subplots(len(kinds), 1, sharex=True, sharey=True), strict=True):
        found = delays(settings_of(f"links.latency={written}").latency, 400)
        axes.plot(np.arange(400) * 0.01, found, ".", ms=2.5, color=BLUE)
        axes.set_title(name, loc="left")
        if name != "trace":
            many = np.array(delays(settings_of(f"links.latency={written}").latency, 20_000))
            near = float(np.corrcoef(many[:-1], many[1:])[0, 1])
            yield f"{name}: sd {many.std():.2f} ms, correlation of one frame and the next {near:.2f}"
    axes.set_xlim(0, 4)
    axes.set_ylim(0, 21)
    axes.set_xlabel("time (s), a frame every 10 ms")
    figure.supylabel("latency (ms)", fontsize=8)


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


def paired(figure: Figure) -> Iterator[str]:
    """What a sender of few frames and one of many meet on the same link, by frames and by slots of time."""
    figure.set_size_inches(WIDTH_IN, 2.6)
    burst = "loss: {gilbert-elliott: {to_bad: 0.1, to_good: 0.2}}"
    for slot, axes in zip(("null", "20 ms"), figure.subplots(2, 1, sharex=True), strict=True):
        lost = {}
        for place, rate in enumerate((10, 50)):
            record = simulate(
                f"agents={{kind: beacon, talkers: [1], rate: {rate} Hz, phase: aligned, size: 20 B}}",
                f"links={{{burst}, paired: {slot}}}",
            )
            lost[rate] = {sent.start_ns: fate == "loss" for sent, fate, _ in frames(record, "1", "2")}
            for fate, colour in ((False, SKY), (True, VERMILION)):
                times = [start / MS for start, is_lost in lost[rate].items() if is_lost == fate and start is not None]
                axes.plot(times, [place] * len(times), "|", ms=12, mew=1.6, color=colour)
        axes.set_yticks([0, 1], ["10 Hz", "50 Hz"])
        axes.set_ylim(-0.5, 1.5)
        name = "frame by frame" if slot == "null" else f"paired: {slot}"
        axes.set_title(name, loc="left")
        common = lost[10].keys() & lost[50].keys()
        alike = sum(lost[10][start] == lost[50][start] for start in common)
        yield f"{name}: {alike} of {len(common)} frames at common instants meet the same"
    axes.set_xlim(0, 1000)
    axes.set_xlabel("time (ms); red: lost")
