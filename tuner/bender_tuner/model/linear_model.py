"""Small-signal model of any plant about an operating point, from steps of the plant itself.

The plant is brought to rest at the operating voltage twice, from its reset; a small step up in one run and the same
step down in the other give the response per volt as half their difference. What does not come from the step, a
drift or a disturbance that is the same in both runs, cancels, and so does the even part of the nonlinearity. Readings
are the controller's frames, exposure included.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from bender_loop.control.pid import Limits
from bender_loop.control.plant import Plant, restart
from bender_loop.control.sampling import Sampling
from bender_loop.errors import InputError
from bender_loop.fmu.elsewhere import at_the_plant
from bender_loop.records.scale import scale_question
from bender_tuner.model.sampled_model import SampledModel, model_from_step

FEWEST_FRAMES = 20
MOST_FRAMES = 4000
DEAD_TIME_S = 1.0
"""A plant is waited for at least so long, if only to see whether it answers at all."""
SETTLED_SHARE = 1e-3
STEP_SHARE, LARGEST_STEP_SHARE = 0.01, 0.35
_WINDOW_SHARE = 0.25
_VOLTAGE_TOLERANCE = 1e-4
_STILL = 1e-3
"""Of the usual gain: what answers less does not move."""


@dataclass(frozen=True, slots=True)
class OperatingPoint:
    """Where a plant rests under a held voltage.

    Attributes:
        voltage_V: the voltage held from the reset on.
        displacement_um: mean reading over the last quarter of the wait.
        frames: how many frames the wait took.
        settled: the reading stood still at the end, to 0.1 % of its travel; False where the wait was cut off.
    """

    voltage_V: float
    displacement_um: float
    frames: int
    settled: bool


@dataclass(frozen=True, slots=True, eq=False)
class Linearisation:
    """A sampled model and the operating point that it holds for."""

    point: OperatingPoint
    model: SampledModel


class FrameReader:
    """Steps a plant frame by frame under a held voltage and reads it as the camera does, without noise."""

    def __init__(self, plant: Plant, sampling: Sampling) -> None:
        self._plant = plant
        self._substeps = sampling.substeps if sampling.exposure_s > 0.0 else 1
        self._step_s = sampling.period_s / self._substeps
        self._weights = sampling.exposure_weights().tolist() if self._substeps > 1 else [1.0]

    def restart(self) -> float:
        """Reset the plant; returns displacement_um at rest."""
        return restart(self._plant)

    def frame(self, voltage_V: float) -> float:
        """Hold `voltage_V` for one period; returns the frame's displacement_um at its end."""
        step, step_s = self._plant.step, self._step_s
        return sum(weight * step(voltage_V, step_s) for weight in self._weights)

    def frames(self, voltage_V: float, count: int) -> NDArray[np.float64]:
        """Readings of `count` periods under `voltage_V`, shape (count,)."""
        return np.array([self.frame(voltage_V) for _ in range(count)])


@at_the_plant
def settle(plant: Plant, voltage_V: float, sampling: Sampling, most_frames: int = MOST_FRAMES) -> OperatingPoint:
    """Hold `voltage_V` from the reset until the readings stand still, at most `most_frames`.

    A plant under voltage that has not moved at all may still be in its dead time: it is given all of them.
    """
    reader = FrameReader(plant, sampling)
    readings = [reader.restart()]
    count = FEWEST_FRAMES
    patience = most_frames if voltage_V else 0
    while True:
        readings.extend(reader.frames(voltage_V, count + 1 - len(readings)))
        window = np.array(readings[-max(3, int(_WINDOW_SHARE * count)) :])
        travel = max(readings) - min(readings)
        answered = travel > 0.0 or count >= patience
        settled = bool(answered and np.ptp(window) <= SETTLED_SHARE * travel)
        if settled or count >= most_frames:
            return OperatingPoint(voltage_V, float(np.mean(window)), count, settled)
        count = min(math.ceil(1.25 * count), most_frames)


def find_operating_point(
    plant: Plant, displacement_um: float, sampling: Sampling, limits: Limits, most_frames: int = MOST_FRAMES
) -> OperatingPoint:
    """The voltage within `limits` under which `plant` comes to rest, within `most_frames`, at `displacement_um`.

    Raises:
        InputError: no voltage within the limits brings the plant there.
        ValueError: the limits are not finite.
    """
    if not (math.isfinite(limits.lower_V) and math.isfinite(limits.upper_V)):
        raise ValueError(f"limits must be finite to search between them, found {limits.lower_V!r}..{limits.upper_V!r}")
    lower, upper = (settle(plant, voltage, sampling, most_frames) for voltage in (limits.lower_V, limits.upper_V))
    for end in (lower, upper):
        if math.isclose(end.displacement_um, displacement_um, rel_tol=SETTLED_SHARE, abs_tol=1e-9):
            return end
    if (lower.displacement_um - displacement_um) * (upper.displacement_um - displacement_um) > 0.0:
        raise InputError(_out_of_reach(displacement_um, lower, upper, sampling))
    span = limits.upper_V - limits.lower_V
    voltage = brentq(
        lambda voltage: settle(plant, voltage, sampling, most_frames).displacement_um - displacement_um,
        limits.lower_V,
        limits.upper_V,
        xtol=_VOLTAGE_TOLERANCE * span,
    )
    return settle(plant, float(voltage), sampling, most_frames)  # pyright: ignore[reportArgumentType]


def _out_of_reach(wanted_um: float, lower: OperatingPoint, upper: OperatingPoint, sampling: Sampling) -> str:
    """Return what was found in the place of the wanted displacement, and what to do."""
    found = f"between {lower.displacement_um:.4g} and {upper.displacement_um:.4g} µm"
    limits = f"between {lower.voltage_V:g} and {upper.voltage_V:g} V"
    waited_s = max(lower.frames, upper.frames) / sampling.rate_Hz
    if lower.displacement_um == upper.displacement_um:
        return (
            f"setpoint {wanted_um:g} µm is out of reach: {limits} the plant does not answer within {waited_s:.3g} s; "
            "check the names of input and output, or wait longer (--duration)"
        )
    if not (lower.settled and upper.settled):
        return (
            f"setpoint {wanted_um:g} µm is out of reach within {waited_s:.3g} s: {limits} the plant comes {found} and "
            "still moves; give it longer runs (--duration) at a lower --rate, or another setpoint"
        )
    return (
        f"setpoint {wanted_um:g} µm is out of reach: {limits} the plant comes to rest {found}; choose a setpoint in "
        "that range, or other bounds of the command (--voltage-limits)"
        f"{_why_out_of_reach(wanted_um, lower.displacement_um, upper.displacement_um)}"
    )


def _why_out_of_reach(wanted_um: float, lower_um: float, upper_um: float) -> str:
    """Return what may be meant: a change from rest where the reading rests far from zero, else another unit."""
    if (wanted_um - lower_um) * (upper_um - lower_um) < 0.0 and upper_um < lower_um:
        return "; the output falls as the command rises: swap the sign of one of them"
    if abs(lower_um) > abs(upper_um - lower_um):
        more_um = lower_um + wanted_um
        return f"; a set-point is what the output reads: for {wanted_um:g} µm more than at rest, {more_um:.4g} µm"
    far_um = max((lower_um, upper_um), key=abs)
    asked = scale_question(wanted_um / far_um) if far_um else None
    return f"; it is {asked}" if asked else ""


def linearise(plant: Plant, point: OperatingPoint, sampling: Sampling, *, step_V: float) -> SampledModel:
    """The small-signal model of `plant` about `point` for steps of `step_V` up and down.

    The response is recorded as long as the plant took to come to rest; a relaxation that still goes on is continued.

    Raises:
        ValueError: `step_V` is not a positive number.
    """
    if not (math.isfinite(step_V) and step_V > 0.0):
        raise ValueError(f"step_V must be a finite number > 0, found {step_V!r}")
    up, down = (readings_after(plant, point, sampling, signed) for signed in (step_V, -step_V))
    return model_of_steps(up, down, step_V, sampling.period_s)


def model_of_steps(up: NDArray[np.float64], down: NDArray[np.float64], step_V: float, period_s: float) -> SampledModel:
    """Return the model behind the readings (n,) after a step up and after the same step down."""
    return model_from_step(period_s, np.concatenate(([0.0], (up - down) / (2.0 * step_V))))


def linearise_at(
    plant: Plant, displacement_um: float, sampling: Sampling, limits: Limits, most_frames: int = MOST_FRAMES
) -> Linearisation:
    """Operating point and model at a resting displacement; the step is 1 % of the span of `limits`.

    Where nothing moves, as inside a play or a dead zone, it is doubled until the answer has half of the gain that the
    resting displacement has to its voltage: a step that hardly leaves the play would show too small a gain.

    Raises:
        InputError: the displacement is out of reach.
    """
    point = find_operating_point(plant, displacement_um, sampling, limits, most_frames)
    span_V = limits.upper_V - limits.lower_V
    step_V = STEP_SHARE * span_V
    found = linearise(plant, point, sampling, step_V=step_V)
    usual = abs(point.displacement_um / point.voltage_V) if point.voltage_V else 0.0
    enough = _STILL * usual
    while _largest_gain(found) <= enough and 2.0 * step_V <= LARGEST_STEP_SHARE * span_V:
        step_V, enough = 2.0 * step_V, 0.5 * usual
        found = linearise(plant, point, sampling, step_V=step_V)
    return Linearisation(point, found)


def _largest_gain(model: SampledModel) -> float:
    return float(np.max(np.abs(np.cumsum(model.pulse_um_per_V))))


@at_the_plant
def readings_after(plant: Plant, point: OperatingPoint, sampling: Sampling, step_V: float) -> NDArray[np.float64]:
    """Return the readings (n,) after a step of the voltage from an operating point that is come to from rest."""
    reader = FrameReader(plant, sampling)
    reader.restart()
    reader.frames(point.voltage_V, point.frames)
    return reader.frames(point.voltage_V + step_V, point.frames)
