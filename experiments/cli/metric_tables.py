"""Metrics as tables for the terminal."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping

from rich.table import Table

from ..analysis.accounting import LinkAccount, total
from ..analysis.fidelity import fidelity_lines
from ..analysis.metrics import LinkMetrics, Metrics, QuantityMetrics

_WORST_LINKS = 5
_FIRST_FAULTS = 20
_NOTHING = "–"
_CLOSES = "the sum of frames closes on every link"


def metrics_tables(metrics: Metrics) -> list[Table]:
    """Components, errors and recoveries of each quantity; frames, the worst links, and the verdict."""
    tables = []
    if metrics.not_evaluated:
        tables.append(_table("Estimates", "", rows=[(metrics.not_evaluated,)]))
    for name, quantity in metrics.quantities.items():
        tables += [_components(name, quantity), _errors(name, quantity)]
        if quantity.recoveries:
            tables.append(_recoveries(name, quantity))
    if metrics.consistency:
        tables.append(_consistency(metrics))
    if metrics.findings:
        rows = (
            (one.name, "" if math.isnan(one.value) else _number(one.value, one.unit), one.text)
            for one in metrics.findings
        )
        tables.append(_table("Findings", "of", "value", "", rows=rows))
    accounts = {name: link.account for name, link in metrics.links.items()}
    tables += [_frames(metrics), _worst(metrics.links, accounts), _oldest(metrics.links), _airtime(metrics.airtime)]
    open_links = [name for name, link in metrics.links.items() if not link.closes]
    closing = f"the sum of frames does not close on {', '.join(open_links)}" if open_links else _CLOSES
    pace = [metrics.fidelity.pace] if metrics.fidelity.pace else []
    verdict = [*pace, metrics.fidelity.verdict, closing, *fidelity_lines(metrics.fidelity), *_speed(metrics)]
    return [*tables, _table("Fidelity", "", rows=[(line,) for line in verdict])]


def _speed(metrics: Metrics) -> Iterator[str]:
    if not math.isnan(metrics.times_real_time):
        took = f"{metrics.seconds:.1f} s of the run took {metrics.wall_s:.1f} s"
        yield f"speed: {took}, {metrics.times_real_time:.1f} × real time"


def _table(title: str, first: str, *others: str, rows: Iterable[tuple[str, ...]] = ()) -> Table:
    """A table with text in the first column and numbers in the others."""
    table = Table(title=title, title_justify="left", min_width=len(title), show_header=bool(others))
    table.add_column(first)
    for other in others:
        table.add_column(other, justify="right")
    for row in rows:
        table.add_row(*row)
    return table


def _components(name: str, quantity: QuantityMetrics) -> Table:
    rows = (
        (one.name, _number(one.truth_rms, one.unit), _number(one.oracle_rms, one.unit)) for one in quantity.components
    )
    title = f"{name}: {quantity.agents} agents, {quantity.samples} samples"
    return _table(title, "steady-state rms", "error to truth", "error to oracle", rows=rows)


def _errors(name: str, quantity: QuantityMetrics) -> Table:
    kinds = (
        ("error to truth", quantity.truth_error),
        ("error to oracle", quantity.oracle_error),
        ("disagreement", quantity.disagreement),
    )
    rows = [
        (
            label,
            *map(_number, (one.steady_rms, one.final, one.threshold)),
            _number(one.convergence_s, "s"),
            _number(one.ise),
        )
        for label, one in kinds
    ]
    if not math.isnan(quantity.contraction):
        rows.append((f"contraction {_number(quantity.contraction)} a round", *[""] * 5))
    return _table(f"{name}: two-norms", "", "steady rms", "final max", "threshold", "converged at", "ISE", rows=rows)


def _recoveries(name: str, quantity: QuantityMetrics) -> Table:
    rows = [
        (one.label, one.of, _number(one.threshold), _number(one.recovery_s, "s"))
        for one in quantity.recoveries[:_FIRST_FAULTS]
    ]
    if more := len(quantity.recoveries) - len(rows):
        rows.append((f"… and {more} more", "", "", ""))
    return _table(f"{name}: recovery after faults", "fault", "of", "threshold", "recovered after", rows=rows)


def _consistency(metrics: Metrics) -> Table:
    rows = (
        (name, one.test, f"{one.reports:,}", *map(_number, (one.mean, one.central, one.low, one.high)), one.verdict)
        for name, one in metrics.consistency.items()
    )
    columns = "", "reports", "mean", "of oracle", "from", "to", "verdict"
    return _table("Consistency: normalised squares over the dimension", "of", *columns, rows=rows)


def _frames(metrics: Metrics) -> Table:
    sums = total([link.account for link in metrics.links.values()])
    rows = (
        (fate.replace("_", " "), f"{count:,}")
        for fate, count in sums.items()
        if count or fate in ("offered", "missing")
    )
    return _table("Frames", "fate", "frames", rows=rows)


def _worst(links: Mapping[str, LinkMetrics], accounts: Mapping[str, LinkAccount]) -> Table:
    worst = sorted(accounts, key=lambda name: accounts[name].delivered_fraction)[:_WORST_LINKS]
    columns = "delivered", "loss asked", "got", "latency asked", "got", "p99", "airtime", "late"
    rows = [_link_row(name, links[name]) for name in worst]
    return _table(f"Links that delivered least, {len(worst)} of {len(links)}", "link", *columns, rows=rows)


def _link_row(name: str, link: LinkMetrics) -> tuple[str, ...]:
    account, channel = link.account, link.channel
    fractions = account.delivered_fraction, channel.loss.asked, channel.loss.got
    latencies = channel.latency.asked, channel.latency.got, account.latency_ns[1]
    return (
        name.replace(">", "→"),
        *(_number(100 * fraction, "%") for fraction in fractions),
        *(_number(time / 1e6, "ms") for time in latencies),
        _number(100 * account.utilisation, "%"),
        str(account.late),
    )


def _oldest(links: Mapping[str, LinkMetrics]) -> Table:
    """The links with the oldest information, of those that delivered a frame."""
    known = [name for name, link in links.items() if not math.isnan(link.age.mean_ns)]
    oldest = sorted(known, key=lambda name: -links[name].age.mean_ns)[:_WORST_LINKS]
    ages = ((name, links[name].age) for name in oldest)
    rows = (
        (name.replace(">", "→"), *(_milliseconds(time) for time in (age.mean_ns, age.p99_ns, age.peak_ns)))
        for name, age in ages
    )
    return _table(
        f"Age of information, the oldest {len(oldest)} of {len(links)}", "link", "mean", "p99", "peak", rows=rows
    )


def _milliseconds(time_ns: float) -> str:
    return _NOTHING if math.isnan(time_ns) else f"{time_ns / 1e6:,.1f} ms"


def _airtime(media: Mapping[str, float]) -> Table:
    busiest = sorted(media, key=lambda name: -media[name])[:_WORST_LINKS]
    rows = ((name.replace(">", "→"), _number(100 * media[name], "%")) for name in busiest)
    return _table(f"Busiest media, {len(busiest)} of {len(media)}", "medium", "airtime", rows=rows)


def _number(value: float, unit: str = "") -> str:
    if math.isnan(value):
        return _NOTHING
    whole = value >= 1000.0 and float(value).is_integer()
    return f"{value:{',.0f' if whole else '.3g'}} {unit}".rstrip()
