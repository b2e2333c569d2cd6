"""The numbers of a unit that are compared with those of the others, from the tables of a fleet."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bender_fleet.results.tables import EFFECT_TABLE, UNIT_TABLE

Array = NDArray[np.float64]
WIDE = 3.0
"""A positive quantity whose quantiles of 5 and 95 % are this far apart is compared by its logarithm."""
_OF_UNIT = {
    "gain": ("gain", "1"),
    "offset_um": ("offset", "um"),
    "recalibrated_um": ("gap after calibration, rms", "um"),
    "after_um": ("gap with the effects, rms", "um"),
    "held_out_percent": ("held-out error", "%"),
    "since_s": ("time of the first change", "s"),
    "change_um": ("size of the first change, rms", "um"),
    "noise_um": ("noise", "um"),
    "gain_change": ("gain since the first record", "1"),
    "offset_change_um": ("offset since the first record", "um"),
}


@dataclass(frozen=True, slots=True, eq=False)
class Feature:
    """One number of every unit, NaN where a unit has none.

    Attributes:
        name: column, or effect and parameter.
        label: for people.
        unit: of the values.
        values: (n,).
        stds: (n,), NaN where not known.
    """

    name: str
    label: str
    unit: str
    values: Array
    stds: Array

    @property
    def seen(self) -> Array:
        """The values that are there."""
        return self.values[np.isfinite(self.values)]

    @property
    def comparable(self) -> Array:
        """The values on the scale on which units are compared: the logarithm of what is positive and widely spread."""
        seen = self.seen
        if seen.size and np.min(seen) > 0.0:
            low, high = np.quantile(seen, [0.05, 0.95])
            if high > WIDE * low:
                return np.log(self.values)
        return self.values


@dataclass(frozen=True, eq=False)
class Population:
    """The tables of a fleet.

    Attributes:
        units: rows of the table of units.
        effects: rows of the table of effects.
    """

    units: Sequence[Mapping[str, Any]]
    effects: Sequence[Mapping[str, Any]]

    @cached_property
    def place(self) -> dict[str, int]:
        """Return the row of every unit."""
        return {x["unit"]: k for k, x in enumerate(self.units)}

    @cached_property
    def statuses(self) -> Counter[str]:
        """How many units have which status."""
        return Counter(x["status"] for x in self.units)

    @cached_property
    def verdicts(self) -> Counter[str]:
        """How many units have which verdict."""
        return Counter(x["verdict"] for x in self.units if x.get("verdict"))

    @cached_property
    def has_effect(self) -> dict[str, NDArray[np.bool_]]:
        """Which units have an effect of which nobody doubts, the commonest effect first."""
        found: dict[str, NDArray[np.bool_]] = {}
        for row in self.effects:
            if row["certain"]:
                found.setdefault(row["effect"], np.zeros(len(self.units), dtype=bool))[self.place[row["unit"]]] = True
        return dict(sorted(found.items(), key=lambda x: (-int(x[1].sum()), x[0])))

    @cached_property
    def has_alarm(self) -> NDArray[np.bool_]:
        """Which units a watch has raised an alarm of."""
        return np.array([bool(x.get("alarms")) for x in self.units])

    @cached_property
    def of_units(self) -> list[Feature]:
        """Numbers that every unit has."""
        nothing = np.full(len(self.units), np.nan)
        found = []
        for name, (label, unit) in _OF_UNIT.items():
            values = np.array([_number(x.get(name)) for x in self.units], dtype=np.float64)
            if np.isfinite(values).any():
                found.append(Feature(name, label, unit, values, nothing))
        return found

    @cached_property
    def of_effects(self) -> list[Feature]:
        """Parameters of the effects, those of the commonest effect first; of a list of shares, their sum."""
        values: dict[tuple[str, str, str], tuple[Array, Array]] = {}
        size = len(self.units)
        for row in self.effects:
            if not row["certain"]:
                continue
            for x in _scalars(row["parameters"]):
                key = (row["effect"], x["name"], x["unit"])
                pair = values.setdefault(key, (np.full(size, np.nan), np.full(size, np.nan)))
                k = self.place[row["unit"]]
                pair[0][k], pair[1][k] = _number(x["value"]), _number(x["std"])
        order = list(self.has_effect)
        features = [
            Feature(f"{effect}.{name}", f"{effect}: {name.removesuffix(f'_{unit}').replace('_', ' ')}", unit, *pair)
            for (effect, name, unit), pair in values.items()
        ]
        return sorted(features, key=lambda x: order.index(x.name.partition(".")[0]))

    @property
    def features(self) -> list[Feature]:
        """All numbers."""
        return [*self.of_units, *self.of_effects]


def read_population(out: Path) -> Population:
    """Return what the tables of a fleet hold."""
    import pyarrow.parquet as pq

    units = pq.read_table(out / UNIT_TABLE).to_pylist()
    return Population(units, pq.read_table(out / EFFECT_TABLE).to_pylist())


def _scalars(parameters: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return numbers that mean the same in every unit.

    The entries of a list, as the relaxations of creep, differ in number from unit to unit; shares are added up, and
    what cannot be added up is left out.
    """
    found = [dict(x) for x in parameters if "[" not in x["name"]]
    sums: dict[str, float] = {}
    for x in parameters:
        name, bracket, _ = x["name"].partition("[")
        if bracket and x["unit"] == "1":
            sums[name] = sums.get(name, 0.0) + _number(x["value"])
    return [*found, *({"name": f"sum of {k}", "value": v, "std": None, "unit": "1"} for k, v in sums.items())]


def _number(value: Any) -> float:
    return float("nan") if value is None else float(value)
