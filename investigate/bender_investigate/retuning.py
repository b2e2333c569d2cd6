"""Gains for the corrected model, and what a simulation expects of them against the old ones."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bender_investigate.proof import Task, cost_um_s2
from bender_investigate.safety import SLEW_SHARE, Allowed
from bender_loop.control.closed_loop import simulate
from bender_loop.control.pid import Gains, Limits
from bender_loop.errors import RunError
from bender_loop.fmu.plant import FmuPlant
from bender_tuner.results.gains_file import write_gains
from bender_tuner.task.problem import pose_problem
from bender_tuner.task.session import open_guarded, run_session
from bender_tuner.task.settings import TuneSettings, make_settings
from bender_tuner.task.tuning import Ended

LATENCY_FRAMES, EXPOSURE_S = 1, 0.004
"""Of the loop that is tuned; the margins of the objective cover a frame more."""
LOOP_HZ = 100.0
"""A sensor that is quicker is read at this rate by the loop."""
LOOP_SLEW_V_PER_S = 225.0
"""No loop has to be faster: the whole range in seven frames."""
GAINS = "gains.toml"


@dataclass(frozen=True, slots=True)
class Retuned:
    """What the tuning came to.

    Attributes:
        gains: for the corrected model.
        old_cost, new_cost: by simulation of the corrected model, in µm s².
    """

    gains: Gains
    old_cost: float
    new_cost: float


def tune_settings(allowed: Allowed, task: Task, noise_um: float, evaluations: int, seed: int) -> TuneSettings:
    """Return the tuning of this bench: its rate, its limits, the noise that it showed at rest."""
    rate_Hz = min(allowed.rate_Hz, LOOP_HZ)
    return make_settings(
        objective="practitioner",
        rate_Hz=rate_Hz,
        latency_frames=LATENCY_FRAMES,
        exposure_s=min(EXPOSURE_S, 0.45 / rate_Hz),
        noise_um=noise_um,
        setpoint_um=task.high_um,
        lower_V=allowed.low_V,
        upper_V=allowed.high_V,
        slew_V_per_s=min(SLEW_SHARE * allowed.slew_V_per_s, LOOP_SLEW_V_PER_S),
        duration_s=task.step_s,
        evaluations=evaluations,
        seed=seed,
    )


def retune(fmu: Path, old: Gains, settings: TuneSettings, task: Task, out: Path) -> Retuned:
    """Tune on the corrected FMU, write its gains, and simulate both.

    Raises:
        InputError: the FMU will not do.
        RunError: the plant failed, or no gains were found.
        KeyboardInterrupt: by the user.
    """
    gains = tuned(fmu, settings)
    write_gains(out / GAINS, gains, settings.limits, settings.sampling.period_s)
    return Retuned(gains, _expected(fmu, old, settings, task), _expected(fmu, gains, settings, task))


def tuned(fmu: Path, settings: TuneSettings) -> Gains:
    """Return the gains that the tuner finds for an FMU.

    Raises:
        InputError, RunError, KeyboardInterrupt: as `retune` does.
    """
    with open_guarded(fmu) as (plant, facts):
        session = run_session(plant, facts, pose_problem(plant, settings))
    if session.ended is Ended.INTERRUPTED:
        raise KeyboardInterrupt
    gains = session.contenders[0].gains
    if session.ended is Ended.FAILED or gains is None:
        raise RunError(session.reason or "the tuning found no gains")
    return gains


def _expected(fmu: Path, gains: Gains, settings: TuneSettings, task: Task) -> float:
    """Return the cost of the two set-points by simulation."""
    limits = Limits(settings.lower_V, settings.upper_V)
    with FmuPlant(fmu) as plant:
        trace = simulate(
            plant,
            gains,
            limits,
            task.reference,
            settings.sampling,
            task.duration_s,
            np.random.default_rng(settings.seed),
            slew_V_per_s=settings.slew_V_per_s,
        )
    if trace.diverged:
        return float("inf")
    return cost_um_s2(trace.time_s, trace.displacement_um, task)
