"""Reports of all agents side by side: one row a sample, one column an agent, with what they should have been."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import BadInput
from ...quantities import Component, Floats, subtracted
from ...transport.links import NANOSECONDS
from ..evaluation.evaluation_result import Whole
from .record import Record
from .side_by_side import take

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset


@dataclass(frozen=True, repr=False)
class Samples:
    """T samples of N agents with k components each; NaN where an agent has no estimate or a reference is not known.

    time_ns (T,) int64; index (T,) int64; estimate, oracle, truth (T, N, k) in the agents' units, each entry of oracle
    and truth belonging to the report in the same place; the oracle is the central estimate. `oracle_difference` and
    `truth_difference` (T, N, m): by how much estimates are off. `disagreement` (T,): root mean square distance of the
    agents to their mean, as seen from the first that has an estimate; NaN where each has its own and nothing
    `is_shared`. `deviation` (T, N, m): standard deviations of the difference to the truth, as agents stated them.
    """

    quantity: str
    is_shared: bool
    agents: tuple[str, ...]
    components: tuple[Component, ...]
    difference_components: tuple[Component, ...]
    time_ns: Whole
    index: Whole
    estimate: Floats
    oracle: Floats
    truth: Floats
    oracle_difference: Floats
    truth_difference: Floats
    disagreement: Floats
    deviation: Floats

    @cached_property
    def oracle_error(self) -> Floats:
        """Two-norm of each agent's difference to the oracle, (T, N)."""
        return np.asarray(np.linalg.norm(self.oracle_difference, axis=-1))

    @cached_property
    def truth_error(self) -> Floats:
        """Two-norm of each agent's difference to the truth, (T, N)."""
        return np.asarray(np.linalg.norm(self.truth_difference, axis=-1))

    def __repr__(self) -> str:
        labels = ", ".join(f"{name} [{unit}]" if unit else name for name, unit, _ in self.components)
        return f"Samples of {self.quantity!r}: {len(self.time_ns)} samples of {len(self.agents)} agents; {labels}"

    def to_dataframe(self) -> DataFrame:
        """A row for each sample and agent that has an estimate; needs the extra `data`.

        Columns: time_s, index, agent, and for each component its estimate under its name, `…_oracle` and `…_truth`,
        and where agents stated it the `…_deviation`, in the units of people, which `attrs["units"]` tells by column.

        Raises:
            BadInput: pandas is not installed.
        """
        pandas = _needed("pandas")
        columns = {name: values.reshape(-1) for name, values in self._by_component()}
        known = ~np.isnan(self.estimate).all(axis=-1).reshape(-1)
        count = len(self.agents)
        keys = {
            "time_s": np.repeat(self.time_ns / NANOSECONDS, count),
            "index": np.repeat(self.index, count),
            "agent": np.tile(np.array(self.agents), len(self.time_ns)),
        }
        frame = pandas.DataFrame({name: values[known] for name, values in (keys | columns).items()})
        frame.attrs["units"] = {"time_s": "s", **self._units()}
        return frame

    def to_xarray(self) -> Dataset:
        """The same as variables over time and agent, with `disagreement` over time; needs the extra `data`.

        Units of people stand in the `attrs` of each variable, the quantity in those of the whole.

        Raises:
            BadInput: xarray is not installed.
        """
        xarray = _needed("xarray")
        units = self._units()
        variables = {name: (("time", "agent"), values, {"units": units[name]}) for name, values in self._by_component()}
        times = ("time", self.time_ns / NANOSECONDS, {"units": "s"})
        found: Dataset = xarray.Dataset(
            {**variables, "disagreement": ("time", self.disagreement)},
            {"time": times, "index": ("time", self.index), "agent": list(self.agents)},
            {"quantity": self.quantity},
        )
        return found

    @property
    def states_deviations(self) -> bool:
        """Whether agents stated standard deviations, and these are of the components themselves."""
        return self.components == self.difference_components and not np.isnan(self.deviation).all()

    def _by_component(self) -> Iterator[tuple[str, Floats]]:
        columns = {"": self.estimate, "_oracle": self.oracle, "_truth": self.truth}
        if self.states_deviations:
            columns["_deviation"] = self.deviation
        for number, (name, _, factor) in enumerate(self.components):
            for end, values in columns.items():
                yield name + end, factor * values[..., number]

    def _units(self) -> dict[str, str]:
        ends = ("", "_oracle", "_truth", *(("_deviation",) if self.states_deviations else ()))
        return {name + end: unit for name, unit, _ in self.components for end in ends}


def _needed(package: str) -> Any:
    try:
        return import_module(package)
    except ImportError as error:
        raise BadInput(f"this needs {package}, which is not installed: pip install 'volery[data]'") from error


def samples(record: Record, quantity: str | None = None) -> Samples:
    """The reports of a quantity side by side; without its name, of the first estimate that there is.

    Raises:
        BadInput: nobody reported it, or the run is not evaluated.
    """
    if quantity is None:
        quantity = next(iter(record.evaluated.compared()), None)
        if quantity is None:
            raise BadInput("no agent reported an estimate")
    judged = record.evaluated.quantity(quantity)

    def stacked(of: Mapping[str, Floats]) -> Floats:
        return np.stack([take(of[agent], rows) for agent, rows in judged.rows.items()], axis=1)

    def apart(differences: Mapping[str, Floats], reference: Floats) -> Floats:
        return stacked(differences) if differences else subtracted(estimate, reference)

    estimate = stacked({agent: mine.value for agent, mine in record.estimates(quantity).items()})
    oracle, truth = stacked(judged.central), stacked(judged.truth)
    unknown = np.full((max(map(len, judged.truth.values())), len(judged.difference_components)), np.nan)
    return Samples(
        quantity,
        judged.is_shared,
        tuple(judged.rows),
        judged.components,
        judged.difference_components,
        judged.time_ns,
        judged.index,
        estimate,
        oracle,
        truth,
        apart(judged.central_difference, oracle),
        apart(judged.truth_difference, truth),
        judged.disagreement,
        stacked({agent: judged.deviation.get(agent, unknown) for agent in judged.rows}),
    )
