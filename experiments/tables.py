"""Metrics as tables for the terminal."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from rich.table import Table

from .accounting import LinkAccount, total
from .metrics import LinkMetrics, Metrics, QuantityMetrics

_WORST_LINKS = 5
_NOTHING = "–"
_CLOSES = "the sum of frames closes on every link"


def metrics_tables(metrics: Metrics) -> list[Table]:
    """Components, errors and recoveries of each quantity; frames, the links that lost most, and the verdict."""
    tables = []
    for name, quantity in metrics.quantities.items():
        tables += [_components(name, quantity), _errors(name, quantity)]
        if quantity.recoveries:
            tables.append(_recoveries(name, quantity))
    accounts = {name: link.account for name, link in metrics.links.items()}
    tables += [_frames(metrics), _worst(metrics.links, accounts)]
    open_links = [name for name, link in metrics.links.items() if not link.closes]
    closing = f"the sum of frames does not close on {', '.join(open_links)}" if open_links else _CLOSES
    return [*tables, _table("Fidelity", "", rows=[(metrics.fidelity.verdict,), (closing,)])]


def _table(title: str, first: str, *others: str, rows: Iterable[tuple[str, ...]] = ()) -> Table:
    """A table with text in the first column and numbers in the others."""
    table = Table(title=title, title_justify="left", show_header=bool(others))
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
    rows = ((one.label, one.of, _number(one.threshold), _number(one.recovery_s, "s")) for one in quantity.recoveries)
    return _table(f"{name}: recovery after faults", "fault", "of", "threshold", "recovered after", rows=rows)


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
    columns = "delivered", "loss asked", "loss got", "latency asked", "latency got", "p99", "airtime", "late"
    rows = [_link_row(name, links[name]) for name in worst]
    return _table(f"Links that delivered least, {len(worst)} of {len(links)}", "link", *columns, rows=rows)


def _link_row(name: str, link: LinkMetrics) -> tuple[str, ...]:
    account, channel = link.account, link.channel
    fractions = account.delivered_fraction, channel.loss_asked, channel.loss_got
    times = channel.latency_asked_ns, channel.latency_got_ns, account.latency_ns[1]
    return (
        name.replace(">", "→"),
        *(_number(100 * fraction, "%") for fraction in fractions),
        *(_number(time / 1e6, "ms") for time in times),
        _number(100 * account.utilisation, "%"),
        str(account.late),
    )


def _number(value: float, unit: str = "") -> str:
    if math.isnan(value):
        return _NOTHING
    return f"{value:.3g} {unit}".rstrip()
