"""Figures of a step response.

All count from the step, at `start_s`; what lies before is left out. The step goes from the displacement there to the
setpoint, up or down.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_loop.control.trace import Trace

Array = NDArray[np.float64]
SETTLING_BAND = 0.02
"""Of the step: an error within it counts as none."""
_TAIL = 0.1
# a response that enters the band this late in a run has not shown that it stays there
_END = 0.05


@dataclass(frozen=True, slots=True)
class StepMetrics:
    """Figures of one step response.

    Attributes:
        mse_um2: mean squared error, paper equation (28) with its n + 1 samples in the denominator.
        itae_um_s2: integral of t |e| by the trapezoidal rule.
        overshoot_percent: largest excursion beyond the setpoint, of the step; 0 without one.
        rise_time_s: from the first crossing of 10 % of the step to the first of 90 %, between samples on a
            straight line; NaN when it is not reached.
        settling_time_s: the first sample from which on the error stays within 2 % of the step; NaN for never.
        steady_state_error_um: setpoint minus displacement, mean over the last tenth of the samples.
        total_variation_V: sum of the command's changes, the first from 0 V included.
        peak_V: largest magnitude of the command.
    """

    mse_um2: float
    itae_um_s2: float
    overshoot_percent: float
    rise_time_s: float
    settling_time_s: float
    steady_state_error_um: float
    total_variation_V: float
    peak_V: float


def step_metrics(
    trace: Trace, setpoint_um: float | None = None, *, start_s: float | None = None, intersample: bool = False
) -> StepMetrics:
    """Figures of the step response in `trace`.

    Args:
        trace: of a run whose reference is one step.
        setpoint_um: level of the step; None for the last setpoint of the trace.
        start_s: time of the step; None for the first time of the trace.
        intersample: judge the displacement at all plant steps instead of at the frames.

    Returns:
        The figures; for a diverged run mse, itae, overshoot and steady-state error are infinite and the times NaN.

    Raises:
        ValueError: the trace shows no time between the frames, ends before the step, or the step has no height.
    """
    time, displacement = _response(trace, intersample)
    setpoint = float(trace.setpoint_um[-1]) if setpoint_um is None else setpoint_um
    start = float(trace.time_s[0]) if start_s is None else start_s
    variation = float(np.abs(np.diff(trace.voltage_V, prepend=0.0)).sum())
    peak = float(np.abs(trace.voltage_V).max())
    if trace.diverged:
        return StepMetrics(math.inf, math.inf, math.inf, math.nan, math.nan, math.inf, variation, peak)
    after = time >= start - 1e-9
    if np.count_nonzero(after) < 2:
        raise ValueError(f"start_s must leave at least 2 samples before {float(time[-1])!r} s, found {start!r}")
    since, response = time[after] - start, displacement[after]
    height = setpoint - response[0]
    if height == 0.0:
        raise ValueError(f"setpoint_um must differ from the displacement at the step, found {setpoint!r} for both")
    error = setpoint - response
    progress = (response - response[0]) / height
    tail = max(1, round(_TAIL * len(error)))
    return StepMetrics(
        mse_um2=float(np.mean(error**2)),
        itae_um_s2=float(np.trapezoid(since * np.abs(error), since)),
        overshoot_percent=max(0.0, 100.0 * (float(progress.max()) - 1.0)),
        rise_time_s=_first_crossing(since, progress, 0.9) - _first_crossing(since, progress, 0.1),
        settling_time_s=_settling_time(since, error, SETTLING_BAND * abs(height)),
        steady_state_error_um=float(error[-tail:].mean()),
        total_variation_V=variation,
        peak_V=peak,
    )


def has_settled(settling_time_s: float, run_s: float) -> bool:
    """Return whether a run shows that its response settled; one that enters the band in its last part does not."""
    return settling_time_s <= (1.0 - _END) * run_s


def _response(trace: Trace, intersample: bool) -> tuple[Array, Array]:
    if not intersample:
        return trace.time_s, trace.displacement_um
    if trace.fine_time_s is None or trace.fine_displacement_um is None:
        raise ValueError("intersample needs a trace with more than one plant step per period (Sampling.substeps)")
    return trace.fine_time_s, trace.fine_displacement_um


def _first_crossing(time: Array, progress: Array, level: float) -> float:
    """When `progress`, which starts at 0, first reaches `level`, on straight lines between samples; NaN for never."""
    reached = np.flatnonzero(progress >= level)
    if not len(reached):
        return math.nan
    row = int(reached[0])
    part = (level - progress[row - 1]) / (progress[row] - progress[row - 1])
    return float(time[row - 1] + part * (time[row] - time[row - 1]))


def _settling_time(time: Array, error: Array, band: float) -> float:
    outside = np.flatnonzero(np.abs(error) > band)
    if not len(outside):
        return float(time[0])
    following = int(outside[-1]) + 1
    return float(time[following]) if following < len(time) else math.nan
