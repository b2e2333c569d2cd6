"""The ultimate point: the proportional gain at which a loop just oscillates, and the period of that oscillation.

Two ways: the phase crossover of the sampled linear loop, and a relay in the closed loop (K. J. Astrom and T. Hagglund,
Automatic tuning of simple regulators with specifications on phase and amplitude margins, Automatica 20 (1984) 645-651),
whose describing function takes the oscillation for a sine: Ku = 4 d / (pi sqrt(a^2 - h^2)) with relay amplitude d,
hysteresis h and amplitude a of the displacement.
"""

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_loop.control.pid import Gains
from bender_loop.control.plant import Plant
from bender_loop.control.sampling import Sampling
from bender_tuner.model.linear_model import FrameReader, OperatingPoint
from bender_tuner.model.loop_transfer import DelayedPlant
from bender_tuner.model.margins import negative_real_crossings

_CYCLES_JUDGED = 4
_CYCLE_SCATTER = 0.1


@dataclass(frozen=True, slots=True)
class UltimatePoint:
    """Ku and Tu."""

    gain_V_per_um: float
    period_s: float


@dataclass(frozen=True, slots=True)
class RelayTest:
    """A relay experiment.

    Attributes:
        amplitude_V: the command switches between bias + amplitude and bias - amplitude.
        hysteresis_um: the error must pass this on the other side before the command switches.
        bias_V: added to both, beside the voltage of the operating point, to level an uneven cycle.
        longest_frames: how long to wait for a steady cycle.

    Raises:
        ValueError: a value is out of its range.
    """

    amplitude_V: float
    hysteresis_um: float = 0.0
    bias_V: float = 0.0
    longest_frames: int = 600

    def __post_init__(self) -> None:
        if not (math.isfinite(self.amplitude_V) and self.amplitude_V > 0.0):
            raise ValueError(f"amplitude_V must be a finite number > 0, found {self.amplitude_V!r}")
        if not (math.isfinite(self.hysteresis_um) and self.hysteresis_um >= 0.0):
            raise ValueError(f"hysteresis_um must be a finite number >= 0, found {self.hysteresis_um!r}")
        if not math.isfinite(self.bias_V):
            raise ValueError(f"bias_V must be a finite number, found {self.bias_V!r}")
        if self.longest_frames < 8:
            raise ValueError(f"longest_frames must be >= 8, found {self.longest_frames!r}")


def linear_ultimate_point(plant: DelayedPlant) -> UltimatePoint | None:
    """The smallest proportional gain that brings the loop's Nyquist curve through -1; None if there is none."""
    crossings = negative_real_crossings(Gains(1.0, 0.0), plant)
    if not crossings:
        return None
    omega, value = min(crossings, key=lambda crossing: crossing[1])
    return UltimatePoint(gain_V_per_um=-1.0 / value, period_s=2.0 * math.pi / omega)


def relay_ultimate_point(
    plant: Plant, point: OperatingPoint, sampling: Sampling, test: RelayTest
) -> UltimatePoint | None:
    """The ultimate point as a relay around `point` shows it; None where no steady cycle comes about.

    The plant rests at the operating point first. Frames are late by the latency of `sampling`, without noise.
    """
    displacement, commands = _run_relay(plant, point, sampling, test)
    rising = np.flatnonzero(np.diff(commands) > 0.0) + 1
    if rising.size < _CYCLES_JUDGED + 1:
        return None
    starts = rising[-(_CYCLES_JUDGED + 1) :]
    cycles = [displacement[a:b] for a, b in itertools.pairwise(starts)]
    amplitudes = np.array([0.5 * float(np.ptp(cycle)) for cycle in cycles])
    periods = np.diff(starts) * sampling.period_s
    amplitude = float(np.mean(amplitudes))
    if _scatter(amplitudes) > _CYCLE_SCATTER or amplitude <= test.hysteresis_um:
        return None
    effective = math.sqrt(amplitude**2 - test.hysteresis_um**2)
    return UltimatePoint(4.0 * test.amplitude_V / (math.pi * effective), float(np.mean(periods)))


def _run_relay(
    plant: Plant, point: OperatingPoint, sampling: Sampling, test: RelayTest
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Displacement at the frames and the commands that follow them, both of shape (longest_frames,)."""
    reader = FrameReader(plant, sampling)
    reader.restart()
    rest = reader.frames(point.voltage_V, point.frames)
    level = point.voltage_V + test.bias_V
    readings, commands = [float(rest[-1])], []
    high = True
    for k in range(test.longest_frames):
        error = point.displacement_um - readings[max(k - sampling.latency_frames, 0)]
        if abs(error) > test.hysteresis_um:
            high = error > 0.0
        commands.append(level + test.amplitude_V if high else level - test.amplitude_V)
        readings.append(reader.frame(commands[-1]))
    return np.array(readings[:-1]), np.array(commands)


def _scatter(values: NDArray[np.float64]) -> float:
    return float(np.ptp(values) / np.mean(values)) if np.mean(values) > 0.0 else math.inf
