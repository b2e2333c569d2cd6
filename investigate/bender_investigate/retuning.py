"""Gains for the corrected model, and what a simulation expects of them against the old ones."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bender_hil.runner.oscillation import OscillationWatch, Ranges
from bender_investigate.bench_port import Controller
from bender_investigate.proof import Task, cost_um_s2
from bender_investigate.safety import SLEW_SHARE, Allowed
from bender_loop.control.closed_loop import simulate
from bender_loop.control.pid import Gains, Limits
from bender_loop.control.trace import Trace
from bender_loop.errors import RunError
from bender_loop.fmu.diagnosed import diagnosed
from bender_loop.fmu.file import read_description
from bender_loop.fmu.followed_model import Loop, run_following
from bender_loop.fmu.plant import FmuPlant
from bender_tuner.task.problem import pose_problem
from bender_tuner.task.session import Session, open_guarded, run_session, write_controller
from bender_tuner.task.settings import TuneSettings, make_settings
from bender_tuner.task.tuning import Ended

LATENCY_FRAMES = 1
"""Of the loop that is tuned; the margins of the objective cover a frame more."""
LONGEST_EXPOSURE, SNAPSHOT = 0.45, 0.02
"""Of the time between two frames of the loop: the longest exposure, and one that is too short to matter."""
LOOP_HZ = 100.0
"""A sensor that is quicker is read at this rate by the loop."""
LOOP_SLEW_V_PER_S = 225.0
"""No loop has to be faster: the whole range in seven frames."""
GAINS = "gains.toml"


@dataclass(frozen=True, slots=True)
class Retuned:
    """What the tuning came to.

    Attributes:
        controller: gains for the corrected model, with the model where following it is better.
        following_note: why the model is followed, or not; empty where nobody asked.
        old_cost, new_cost: by simulation of the corrected model, in µm s²; inf for a loop that the bench would end.
    """

    controller: Controller
    old_cost: float
    new_cost: float
    following_note: str = ""

    @property
    def sentence(self) -> str:
        """What the simulation expects."""
        old, new = (
            f"{x:.4g} µm s²" if math.isfinite(x) else "a loop that swings until the bench ends it"
            for x in (self.old_cost, self.new_cost)
        )
        how = "" if self.controller.model is None else ", with a controller that follows it"
        return f"by simulation of the corrected model the cost goes from {old} to {new}{how}"


def tune_settings(
    allowed: Allowed, task: Task, noise_um: float, exposure_s: float, evaluations: int, seed: int
) -> TuneSettings:
    """Return the tuning of this bench: its rate, its limits, the noise at rest, the exposure of its records.

    A mean over an exposure damps what swings faster than it; a camera that is taken to have one that it has not makes
    gains look stable that are not.
    """
    rate_Hz = min(allowed.rate_Hz, LOOP_HZ)
    exposed_s = min(exposure_s, LONGEST_EXPOSURE / rate_Hz)
    return make_settings(
        objective="practitioner",
        rate_Hz=rate_Hz,
        latency_frames=LATENCY_FRAMES,
        exposure_s=exposed_s if exposed_s >= SNAPSHOT / rate_Hz else 0.0,
        noise_um=noise_um,
        setpoint_um=task.high_um,
        lower_V=allowed.low_V,
        upper_V=allowed.high_V,
        slew_V_per_s=min(SLEW_SHARE * allowed.slew_V_per_s, LOOP_SLEW_V_PER_S),
        duration_s=task.step_s,
        evaluations=evaluations,
        seed=seed,
    )


def retune(
    fmu: Path,
    old: Gains,
    settings: TuneSettings,
    task: Task,
    travel_um: tuple[float, float],
    out: Path,
    *,
    follow_model: bool = True,
) -> Retuned:
    """Tune on the corrected FMU, write its gains, and simulate both as the bench would run them.

    The new gains follow the model where the tuner recommends it, by what the diagnosis beside the FMU leaves open.

    Args:
        fmu: the corrected model.
        old: gains of the bench.
        settings: of the tuning.
        task: the set-points by which both are compared.
        travel_um: where the bench ends a run.
        out: directory for the gains, and for the FMU that they follow.
        follow_model: a controller that follows the FMU is tuned too.

    Raises:
        InputError: the FMU will not do.
        RunError: the plant failed, or no gains were found.
        KeyboardInterrupt: by the user.
    """
    session = _session(fmu, settings, follow_model=follow_model)
    write_controller(session, out)
    followed = None if session.following is None else session.following.model
    new = Controller(_gains_of(session), followed, None if followed is None else out / followed.fmu)
    old_cost, new_cost = (_expected(fmu, x, settings, task, travel_um) for x in (Controller(old), new))
    return Retuned(new, old_cost, new_cost, session.following_note)


def tuned(fmu: Path, settings: TuneSettings) -> Gains:
    """Return the gains that the tuner finds for an FMU.

    Raises:
        InputError, RunError, KeyboardInterrupt: as `retune` does.
    """
    return _gains_of(_session(fmu, settings, follow_model=False))


def _session(fmu: Path, settings: TuneSettings, *, follow_model: bool) -> Session:
    can_follow = follow_model and read_description(fmu).coSimulation.canGetAndSetFMUstate
    with open_guarded(fmu, found=diagnosed(fmu)) as (plant, facts):
        return run_session(plant, facts, pose_problem(plant, settings), follow_model=bool(can_follow))


def _gains_of(session: Session) -> Gains:
    if session.ended is Ended.INTERRUPTED:
        raise KeyboardInterrupt
    gains = session.contenders[0].gains
    if session.ended is not Ended.COMPLETE or gains is None:
        raise RunError(session.reason or "the tuning found no gains")
    return gains


def _expected(
    fmu: Path, controller: Controller, settings: TuneSettings, task: Task, travel_um: tuple[float, float]
) -> float:
    """Return the cost of the two set-points by simulation; inf for a loop that the bench would end."""
    limits = Limits(settings.lower_V, settings.upper_V)
    with FmuPlant(fmu) as plant:
        trace = _simulated(plant, controller, limits, settings, task)
    if trace.diverged or would_be_ended(trace, limits, travel_um):
        return float("inf")
    return cost_um_s2(trace.time_s, trace.displacement_um, task)


def _simulated(plant: FmuPlant, controller: Controller, limits: Limits, settings: TuneSettings, task: Task) -> Trace:
    gains, slew, sampling = controller.gains, settings.slew_V_per_s, settings.sampling
    length_s, rng = task.duration_s, np.random.default_rng(settings.seed)
    if controller.model is None or controller.fmu is None:
        return simulate(plant, gains, limits, task.reference, sampling, length_s, rng, slew_V_per_s=slew)
    weights = tuple(sampling.exposure_weights().tolist())
    loop = Loop(sampling.period_s, limits, slew, sampling.latency_frames, weights)
    return run_following(plant, controller.model, controller.fmu, gains, loop, task.reference, sampling, length_s, rng)


def would_be_ended(trace: Trace, limits: Limits, travel_um: tuple[float, float]) -> bool:
    """Return whether the guard's travel or the runner's watch over oscillation would end a run like this one."""
    low_um, high_um = travel_um
    watch = OscillationWatch(Ranges(high_um - low_um, limits.upper_V - limits.lower_V))
    rows = zip(trace.setpoint_um.tolist(), trace.measured_um.tolist(), trace.voltage_V.tolist(), strict=True)
    return any(not low_um <= tip <= high_um or watch.add(aim, tip, volts) is not None for aim, tip, volts in rows)
