"""The sampled open loop L = C z^-d G: the PID block, the frames of latency, the plant; and whether it is stable.

C is `bender_loop.control.pid.step` away from its limits: backward-Euler integral, first-order filter on the derivative.
Whether the derivative acts on the error or on the measurement changes the path from the setpoint, not the loop.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bender_loop.control.pid import Gains
from bender_tuner.model.sampled_model import SampledModel

_FEWEST_INTERVALS = 2048
_MOST_INTERVALS = 1 << 18
_INTERVALS_PER_SAMPLE = 8
_SLOW_POINTS = 60
_SLOW_DECADES = 4.0
_LARGEST_TURN_RAD = 0.5 * math.pi


def controller_response(gains: Gains, period_s: float, omega_rad_per_s: ArrayLike) -> NDArray[np.complex128]:
    """C(exp(j omega Ts)) in V/um at frequencies above zero."""
    phase = np.asarray(omega_rad_per_s, dtype=float) * period_s
    return _controller(gains, period_s, -np.expm1(-1j * phase))


@dataclass(frozen=True, eq=False)
class DelayedPlant:
    """A plant behind its frames of latency, with its response computed once on a frequency grid.

    The grid is uniform up to pi/Ts, as fine as the pulse response asks for, with a logarithmic part below it.

    Attributes:
        model: the plant.
        latency_frames: how many samples old a measurement is when the controller gets it.
        intervals: uniform grid intervals; 0 chooses them from the length of the pulse response.

    Raises:
        ValueError: a negative latency.
    """

    model: SampledModel
    latency_frames: int = 0
    intervals: int = 0

    def __post_init__(self) -> None:
        if self.latency_frames < 0:
            raise ValueError(f"latency_frames must be >= 0, found {self.latency_frames!r}")
        if self.intervals == 0:
            length = self.model.pulse_um_per_V.size + self.latency_frames
            wanted = max(_FEWEST_INTERVALS, _INTERVALS_PER_SAMPLE * length)
            object.__setattr__(self, "intervals", 1 << (wanted - 1).bit_length())

    @cached_property
    def omega_rad_per_s(self) -> NDArray[np.float64]:
        """The grid, ascending, from far below the first uniform point up to pi/Ts, where it ends."""
        uniform = self.nyquist_rad_per_s * np.arange(1, self.intervals + 1) / self.intervals
        slow = uniform[0] * np.logspace(-_SLOW_DECADES, 0.0, _SLOW_POINTS, endpoint=False)
        return np.concatenate((slow, uniform))

    @cached_property
    def uniform_start(self) -> int:
        """Index of the first point of the grid's uniform part, one interval above zero."""
        return _SLOW_POINTS

    @property
    def nyquist_rad_per_s(self) -> float:
        """Half the sampling frequency, pi/Ts."""
        return math.pi / self.model.period_s

    @cached_property
    def inverse_z(self) -> NDArray[np.complex128]:
        """1/z on the grid."""
        return np.exp(-1j * self.omega_rad_per_s * self.model.period_s)

    @cached_property
    def difference(self) -> NDArray[np.complex128]:
        """1 - 1/z on the grid, without cancellation at its slow end."""
        return -np.expm1(-1j * self.omega_rad_per_s * self.model.period_s)

    @cached_property
    def response_um_per_V(self) -> NDArray[np.complex128]:
        """z^-d G on the grid."""
        slow = self.model.frequency_response(self.omega_rad_per_s[:_SLOW_POINTS])
        plant = np.concatenate((slow, self.model.uniform_response(self.intervals)[1:]))
        return plant * self.inverse_z**self.latency_frames

    def controller(self, gains: Gains) -> NDArray[np.complex128]:
        """C on the grid."""
        return _controller(gains, self.model.period_s, self.difference)

    def loop(self, gains: Gains) -> NDArray[np.complex128]:
        """L on the grid."""
        return self.controller(gains) * self.response_um_per_V

    def loop_at(self, gains: Gains, omega_rad_per_s: float) -> complex:
        """L at one frequency, computed directly."""
        delay = np.exp(-1j * omega_rad_per_s * self.model.period_s * self.latency_frames)
        plant = self.model.frequency_response(omega_rad_per_s)
        return complex(controller_response(gains, self.model.period_s, omega_rad_per_s) * plant * delay)

    def finer(self) -> "DelayedPlant":
        """The same on a grid four times as fine."""
        return replace(self, intervals=4 * self.intervals)


def unstable_poles(gains: Gains, plant: DelayedPlant) -> int:
    """Number of closed-loop poles outside the unit circle, for a plant that is itself stable or integrating.

    The principle of the argument (Nyquist), in w = 1/z: with the integrators' factors (1 - w) multiplied into 1 + L,
    the function is analytic for |w| < 1 and its winding number around 0 counts the poles |z| > 1. There is nothing to
    go round on the unit circle, and a turn between two grid points is refused by refining the grid.
    """
    integrators = int(gains.integral_V_per_um_s > 0.0) + int(plant.model.tail_ratio == 1.0)
    while True:
        image = (1.0 + plant.loop(gains)) * plant.difference**integrators
        turns = np.angle(image[1:] / image[:-1])
        if np.max(np.abs(turns)) < _LARGEST_TURN_RAD or plant.intervals >= _MOST_INTERVALS:
            return round(-float(np.sum(turns)) / math.pi)
        plant = plant.finer()


def is_stable(gains: Gains, plant: DelayedPlant) -> bool:
    """Whether the closed loop is stable; a loop with its poles on the circle may come out either way."""
    return unstable_poles(gains, plant) == 0


def _controller(gains: Gains, period_s: float, difference: NDArray[np.complex128]) -> NDArray[np.complex128]:
    filter_time = gains.filter_time_s
    derivative = gains.derivative_V_s_per_um * difference / (filter_time * difference + period_s)
    if gains.integral_V_per_um_s == 0.0:
        return gains.proportional_V_per_um + derivative
    return gains.proportional_V_per_um + gains.integral_V_per_um_s * period_s / difference + derivative
