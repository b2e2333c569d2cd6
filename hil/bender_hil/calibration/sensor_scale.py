"""What a sensor's unit is worth: a polynomial from readings to micrometres with its uncertainty, kept in a TOML file.

Least squares on pairs of reading and true displacement. With x the reading, shifted and scaled to -1 ... 1 over the
calibrated span, the displacement is `sum(coefficients_um[k] * x**k)`. The covariance of the coefficients comes from the
scatter around the fit or from the standard uncertainty of the reference, whichever is larger (ISO/IEC Guide 98-3, 2008,
annex H.3). Two points make a line whose uncertainty is the reference's alone.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Self

import numpy as np

from bender_loop.bounds import FROM_0, check_numbers
from bender_loop.errors import InputError
from bender_loop.shell.files import write_atomically
from bender_loop.shell.toml_file import read_toml_file

LARGEST_DEGREE = 5
BEYOND = 0.02
"""Readings so far outside the calibrated span, as a part of it, are still believed."""


@dataclass(frozen=True, slots=True)
class SensorCalibration:
    """How a sensor's unit becomes micrometres.

    Attributes:
        unit: of the readings.
        low, high: calibrated span of the readings.
        coefficients_um: in rising powers of the reading scaled to -1 ... 1 over the span.
        covariance_um2: of the coefficients, row by row.
        residual_um: rms distance of the points from the fit.
        reference_um: standard uncertainty of the reference.
        points: how many points there were.
        source: where they come from.
    """

    unit: str
    low: float
    high: float
    coefficients_um: tuple[float, ...]
    covariance_um2: tuple[float, ...]
    residual_um: float = 0.0
    reference_um: float = 0.0
    points: int = 2
    source: str = "told"

    def __post_init__(self) -> None:
        object.__setattr__(self, "coefficients_um", tuple(map(float, self.coefficients_um)))
        object.__setattr__(self, "covariance_um2", tuple(map(float, self.covariance_um2)))
        check_numbers(
            self, {"residual_um": FROM_0, "reference_um": FROM_0, "points": (2, 1_000_000)}, whole=("points",)
        )
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise ValueError(f"low, high: found {self.low!r} and {self.high!r}, expected two numbers in order")
        count = len(self.coefficients_um)
        if not 2 <= count <= LARGEST_DEGREE + 1 or len(self.covariance_um2) != count * count:
            raise ValueError(
                f"coefficients_um, covariance_um2: found {count} and {len(self.covariance_um2)} numbers, expected "
                f"2 ... {LARGEST_DEGREE + 1} and their square"
            )
        if not all(map(math.isfinite, (*self.coefficients_um, *self.covariance_um2))):
            raise ValueError("coefficients_um, covariance_um2: found a number that is not finite")

    def to_um(self, reading: float) -> float:
        """Return the displacement in µm; NaN further outside the calibrated span than `BEYOND`."""
        beyond = BEYOND * (self.high - self.low)
        if not self.low - beyond <= reading <= self.high + beyond:
            return math.nan
        scaled, total = self._scaled(reading), 0.0
        for coefficient in reversed(self.coefficients_um):
            total = total * scaled + coefficient
        return total

    def uncertainty_um(self, reading: float) -> float:
        """Return the standard uncertainty of the displacement at a reading: that of the fit."""
        powers = self._scaled(reading) ** np.arange(len(self.coefficients_um))
        covariance = np.reshape(self.covariance_um2, (len(powers), len(powers)))
        return float(np.sqrt(powers @ covariance @ powers))

    @property
    def span_um(self) -> float:
        """How far the displacement goes over the calibrated span; negative for a reading that falls with it."""
        return self.to_um(self.high) - self.to_um(self.low)

    @property
    def span_percent(self) -> float:
        """Standard uncertainty of `span_um`, in percent: that of the scale, as a zero is taken off anyhow."""
        ends = np.array([[end**k for k in range(len(self.coefficients_um))] for end in (-1.0, 1.0)])
        difference = ends[1] - ends[0]
        covariance = np.reshape(self.covariance_um2, (len(difference), len(difference)))
        return 100.0 * float(np.sqrt(difference @ covariance @ difference)) / abs(self.span_um)

    @classmethod
    def load(cls, path: Path | str) -> Self:
        """Read a file that `save` wrote.

        Raises:
            InputError: there is no such file, it is not TOML, or a key is missing, unknown or out of its bounds.
        """
        path = Path(path)
        document = read_toml_file(path, "a calibration that bender calibrate --sensor wrote")
        table = document.get("sensor_calibration")
        if not isinstance(table, dict) or set(document) != {"sensor_calibration"}:
            raise InputError(
                f"{path}: expected the one table [sensor_calibration]; make the file with: bender calibrate --sensor"
            )
        known = {field.name for field in fields(cls)}
        if unknown := sorted(set(table) - known):
            raise InputError(f"{path}: found the unknown key {unknown[0]!r}, expected {', '.join(sorted(known))}")
        try:
            return cls(**table)
        except (TypeError, ValueError) as error:
            raise InputError(f"{path}: {error}") from None

    def save(self, path: Path | str) -> None:
        """Write a TOML file that `load` reads, whole or not at all; InputError when it cannot be written."""
        import tomli_w

        write_atomically(Path(path), tomli_w.dumps({"sensor_calibration": asdict(self)}))

    def _scaled(self, reading: float) -> float:
        return (2.0 * reading - self.low - self.high) / (self.high - self.low)


def fit_sensor(
    readings: Sequence[float],
    displacements_um: Sequence[float],
    unit: str,
    *,
    degree: int = 1,
    reference_um: float = 0.0,
    source: str = "told",
) -> SensorCalibration:
    """Fit a calibration to points.

    Args:
        readings: of the sensor, (n,).
        displacements_um: where the tip was then, (n,).
        unit: of the readings.
        degree: of the polynomial.
        reference_um: standard uncertainty of each displacement.
        source: where the points come from.

    Raises:
        ValueError: too few points, points that do not distinguish the coefficients, or a curve that turns back.
    """
    x, y = np.asarray(readings, float), np.asarray(displacements_um, float)
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise ValueError("points: found a number that is not finite")
    places = len(np.unique(x))
    if places < degree + 1:
        raise ValueError(
            f"points: found {places} different readings, expected at least {degree + 1} for degree {degree}"
        )
    low, high = float(x.min()), float(x.max())
    scaled = (2.0 * x - low - high) / (high - low)
    basis = scaled[:, None] ** np.arange(degree + 1)
    coefficients, *_ = np.linalg.lstsq(basis, y, rcond=None)
    residuals = y - basis @ coefficients
    free = len(x) - degree - 1
    variance = float(residuals @ residuals) / free if free > 0 else 0.0
    covariance = max(variance, reference_um**2) * np.linalg.inv(basis.T @ basis)
    slopes = _slopes(coefficients)
    if slopes.min() <= 0.0 <= slopes.max():
        raise ValueError("points: the displacement turns back within the span; a reading would stand for two places")
    return SensorCalibration(
        unit,
        low,
        high,
        tuple(coefficients.tolist()),
        tuple(covariance.ravel().tolist()),
        residual_um=float(np.sqrt(np.mean(residuals**2))),
        reference_um=reference_um,
        points=len(x),
        source=source,
    )


def _slopes(coefficients: np.ndarray) -> np.ndarray:
    """Slope of the polynomial at many places of its span."""
    places = np.linspace(-1.0, 1.0, 201)
    return np.polynomial.polynomial.polyval(places, np.polynomial.polynomial.polyder(coefficients))
