"""Any plant with its reading multiplied by a factor: gain variation that needs no parameter of the plant."""

import math

from bender_loop.control.plant import Plant, Readable


class ScaledPlant:
    """`plant` with its displacement times `factor`; ValueError where the factor is not a positive number."""

    def __init__(self, plant: Plant, factor: float) -> None:
        if not (math.isfinite(factor) and factor > 0.0):
            raise ValueError(f"factor must be a finite number > 0, found {factor!r}")
        self._plant = plant
        self._factor = factor
        self._last_um = 0.0

    def reset(self) -> None:
        """Reset the plant."""
        self._plant.reset()
        self._last_um = 0.0

    def step(self, voltage_V: float, step_s: float) -> float:
        """Advance the plant; returns its displacement_um times the factor."""
        self._last_um = self._factor * self._plant.step(voltage_V, step_s)
        return self._last_um

    def read(self) -> float:
        """The scaled reading now; of a plant that cannot be read, the last one."""
        return self._factor * self._plant.read() if isinstance(self._plant, Readable) else self._last_um

    def close(self) -> None:
        """Close the plant."""
        self._plant.close()
