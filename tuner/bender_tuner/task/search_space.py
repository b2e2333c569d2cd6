"""Where an optimiser's point in the unit cube becomes a set of gains.

The three optimal gains of a bending actuator lie four decades apart (Ki : Kp : Kd is about 1e4 : 2e2 : 1), so a
search in raw gains with one step size stands still in two of them. `SearchSpace` therefore spans the same number of
decades around a first guess in each direction; `RawSpace` is the paper's own choice.
"""

import math
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bender_loop.control.pid import Gains

GAIN_NAMES = ("proportional_V_per_um", "integral_V_per_um_s", "derivative_V_s_per_um")
DIMENSION = len(GAIN_NAMES)
_EDGE_TOLERANCE = 1e-9
_NEAR_EDGE = 1e-3
"""Of the width of the box: with 1.5 decades either side less than one per cent of the gain."""


class GainSpace(Protocol):
    """A map between optimiser points of shape (3,) and gains."""

    def to_gains(self, x: ArrayLike) -> Gains:
        """The gains at `x`; ValueError where `x` stands for none."""
        ...

    def from_gains(self, gains: Gains) -> NDArray[np.float64]:
        """The point of shape (3,) that stands for `gains`."""
        ...


@dataclass(frozen=True, slots=True)
class SearchSpace:
    """Log-scaled box around a first guess: x = 0.5 is the guess, x = 0 and 1 lie `decades` below and above.

    Attributes:
        center: the first guess, all three gains above zero; its filter and derivative settings are kept.
        decades: half width of the box in powers of ten.

    Raises:
        ValueError: a gain of the centre is zero, or `decades` is not a positive number.
    """

    center: Gains
    decades: float = 1.5

    def __post_init__(self) -> None:
        for name, value in zip(GAIN_NAMES, _as_tuple(self.center), strict=True):
            if not value > 0.0:
                raise ValueError(f"center.{name} must be > 0 on a logarithmic scale, found {value!r}")
        if not (math.isfinite(self.decades) and self.decades > 0.0):
            raise ValueError(f"decades must be a finite number > 0, found {self.decades!r}")

    def to_gains(self, x: ArrayLike) -> Gains:
        """Gains at `x`, shape (3,), each coordinate in [0, 1]; ValueError outside."""
        point = _checked(x)
        if np.any(point < -_EDGE_TOLERANCE) or np.any(point > 1.0 + _EDGE_TOLERANCE):
            raise ValueError(f"x must lie in [0, 1]^3, found {point.tolist()}")
        exponents = self.decades * (2.0 * np.clip(point, 0.0, 1.0) - 1.0)
        return _with_values(self.center, np.array(_as_tuple(self.center)) * 10.0**exponents)

    def from_gains(self, gains: Gains) -> NDArray[np.float64]:
        """Point of shape (3,) for `gains`; -inf for a gain of zero, outside [0, 1] for gains outside the box."""
        with np.errstate(divide="ignore"):
            exponents = np.log10(np.array(_as_tuple(gains)) / np.array(_as_tuple(self.center)))
        return 0.5 * (exponents / self.decades + 1.0)


@dataclass(frozen=True, slots=True)
class RawSpace:
    """The paper's space: the point times one scale per gain, without bounds above.

    A coordinate below zero stands for no gains (ValueError). The derivative acts on the error and is not filtered,
    as in equation (21).

    Attributes:
        scale: Kp, Ki, Kd in V/um, V/(um s), V s/um at x = (1, 1, 1).

    Raises:
        ValueError: a scale is not a positive number.
    """

    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)

    def __post_init__(self) -> None:
        if len(self.scale) != DIMENSION or not all(math.isfinite(s) and s > 0.0 for s in self.scale):
            raise ValueError(f"scale must be three finite numbers > 0, found {self.scale!r}")

    def to_gains(self, x: ArrayLike) -> Gains:
        """Gains at `x`, shape (3,); ValueError where a coordinate is negative."""
        paper = Gains(0.0, 0.0, derivative_on_error=True)
        return _with_values(paper, _checked(x) * np.array(self.scale))

    def from_gains(self, gains: Gains) -> NDArray[np.float64]:
        """Point of shape (3,) for `gains`."""
        return np.array(_as_tuple(gains)) / np.array(self.scale)


def edges(space: SearchSpace, gains: Gains) -> list[str]:
    """Return for each gain on the edge of the box which one, and which edge: `Kp on the lower edge`."""
    found = []
    for name, x in zip(("Kp", "Ki", "Kd"), space.from_gains(gains).tolist(), strict=True):
        if x <= _NEAR_EDGE or x >= 1.0 - _NEAR_EDGE:
            found.append(f"{name} on the {'lower' if x <= _NEAR_EDGE else 'upper'} edge")
    return found


def _as_tuple(gains: Gains) -> tuple[float, float, float]:
    return gains.proportional_V_per_um, gains.integral_V_per_um_s, gains.derivative_V_s_per_um


def _with_values(gains: Gains, values: NDArray[np.float64]) -> Gains:
    return replace(gains, **{name: float(value) for name, value in zip(GAIN_NAMES, values, strict=True)})


def _checked(x: ArrayLike) -> NDArray[np.float64]:
    point = np.asarray(x, dtype=float)
    if point.shape != (DIMENSION,):
        raise ValueError(f"x must have shape ({DIMENSION},), found {point.shape}")
    if not np.all(np.isfinite(point)):
        raise ValueError(f"x must be finite, found {point.tolist()}")
    return point
