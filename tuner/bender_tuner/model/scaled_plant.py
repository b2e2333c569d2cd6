"""Any plant with its travel multiplied by a factor: gain variation that needs no parameter of the plant.

What the plant reads at rest is an offset of its sensor, no part of the gain: a thermometer at 20 °C with half the gain
still reads 20 °C at rest.
"""

import math
from collections.abc import Callable
from typing import Any

from bender_loop.control.plant import Plant, Readable, restart
from bender_loop.fmu.elsewhere import RunThere, run_there_of


class ScaledPlant:
    """`plant` with its way from rest times `factor`; ValueError where the factor is not a positive number."""

    def __init__(self, plant: Plant, factor: float) -> None:
        if not (math.isfinite(factor) and factor > 0.0):
            raise ValueError(f"factor must be a finite number > 0, found {factor!r}")
        self._plant = plant
        self._factor = factor
        self._rest_um = self._last_um = 0.0

    def reset(self) -> None:
        """Reset the plant."""
        self._rest_um = self._last_um = restart(self._plant)

    def step(self, voltage_V: float, step_s: float) -> float:
        """Advance the plant; returns its displacement_um with the way from rest times the factor."""
        self._last_um = self._scaled(self._plant.step(voltage_V, step_s))
        return self._last_um

    def read(self) -> float:
        """The scaled reading now; of a plant that cannot be read, the last one."""
        return self._scaled(self._plant.read()) if isinstance(self._plant, Readable) else self._last_um

    @property
    def run_there(self) -> RunThere | None:
        """How whole functions are run where the plant lives, None where that is here."""
        there = run_there_of(self._plant)
        if there is None:
            return None
        return lambda function, args, kwargs: there(_scaled, (self._factor, function, args, kwargs), {})

    def close(self) -> None:
        """Close the plant."""
        self._plant.close()

    def _scaled(self, displacement_um: float) -> float:
        return self._rest_um + self._factor * (displacement_um - self._rest_um)


def _scaled(
    plant: Plant, factor: float, function: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]
) -> Any:
    return function(ScaledPlant(plant, factor), *args, **kwargs)
