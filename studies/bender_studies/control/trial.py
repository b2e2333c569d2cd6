"""One hidden bench: recorded, diagnosed, tuned on what was found, run with the PID block alone and with the model."""

import json
import math
import time
from contextlib import ExitStack, closing
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bender_effects.catalogue import EFFECTS as CATALOGUE
from bender_loop.control import model_following, pid
from bender_loop.control.metrics import step_metrics
from bender_loop.control.model_following import Memory, ModelFollower
from bender_loop.control.pid import Gains, Limits, PidState
from bender_loop.control.references import Profile, Reference, Sine
from bender_loop.control.trace import Trace
from bender_loop.fmu.diagnosed import NOTHING, Diagnosed, diagnosed
from bender_loop.fmu.followed_model import FollowedModel, Loop, open_follower
from bender_loop.fmu.plant import FmuPlant
from bender_loop.records.record import Record, write_record
from bender_loop.shell.files import prepare_directory
from bender_plant.model import Model, load_model
from bender_proving import NOISE_UM, Bench, Case
from bender_proving.records.excitation import Excitation
from bender_studies.control.hidden_loop import Controller, rms_um, run_hidden
from bender_studies.control.spread import LATER_FRAMES, Late, is_unstable, off_nominal

if TYPE_CHECKING:
    from bender_tuner.task.session import Session

MODEL = "paper"
RATE_HZ = 30.0
SETPOINT_UM = 10.0
SLEW_V_PER_S = 225.0
VOLTS = 0.0, 50.0
FAILED = "error"
"""In the place of the verdict of a bench on which something went wrong."""
SHARES_OF_LIMIT = (0.1, 0.15, 0.2)
"""Frequencies of triangles and sines, in parts of the frequency at which the plain loop still follows."""
LOWEST_UM, HIGHEST_UM = 2.0, 10.0
"""Of triangles and sines where the device comes down so far again at 0 V."""
RESERVE = 0.1
"""Of the way from the highest down to where 0 V leads, kept for corrections."""
PERIODS = 2
STAIR_TIMES_S, STAIR_LEVELS_UM = (0.0, 0.5, 3.0, 5.5), (0.0, 10.0, 4.0, 14.0)
STAIRS_S = 8.0
_RAMP_S, _RAMP_V = 10.0, 50.0
_TRIANGLE_POINTS = 400


@dataclass(frozen=True, slots=True)
class Tried:
    """What came of one bench; figures of the PID block alone, then of model following, by the true displacement.

    Attributes:
        id, truth: of the case.
        verdict, effects: of the diagnosis.
        recommended: whether the tuner recommends model following.
        worst_ms: of the gains, which both have.
        tracking: for each reference (plain rms, rms with the model) in µm.
        settling_s: median settling time of the stairs that settle while seen; NaN where one does not.
        overshoot_percent: largest of the stairs.
        stairs_um: rms over the stairs.
        dead_time_um: rms of a tip that is exact behind the dead time that was found.
        open_loop_percent: width of the loop that the inverse alone leaves of a slow triangle, of its height.
        possible_um: rms that no controller can go below on this bench, from where the run with the model stood.
        wrong: effect that the model has been given on purpose; empty for none.
        spread, unstable: runs of the stairs with the model on devices that are not what was diagnosed, and how many of
            them do not come to rest.
        seconds: of processor time.
        error: what went wrong.
    """

    id: str
    truth: tuple[str, ...]
    verdict: str = FAILED
    effects: tuple[str, ...] = ()
    recommended: bool = False
    worst_ms: float = math.nan
    tracking: tuple[tuple[str, float, float], ...] = ()
    settling_s: tuple[float, float] = (math.nan, math.nan)
    overshoot_percent: tuple[float, float] = (math.nan, math.nan)
    stairs_um: tuple[float, float] = (math.nan, math.nan)
    dead_time_um: float = math.nan
    open_loop_percent: float = math.nan
    possible_um: float = math.nan
    wrong: str = ""
    spread: int = 0
    unstable: int = 0
    seconds: float = 0.0
    error: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return it for a file."""
        return asdict(self)

    @classmethod
    def from_dict(cls, table: dict[str, Any]) -> "Tried":
        """Return what a file has: lists for tuples, None for what is no number."""
        return cls(**{name: _as_it_was(value) for name, value in table.items()})


def _as_it_was(value: Any) -> Any:
    if isinstance(value, list):
        return tuple(map(_as_it_was, value))
    return math.nan if value is None else value


@dataclass(frozen=True, slots=True)
class Trial:
    """How every bench is tried.

    Attributes:
        evaluations: of every tuning.
        wrong_names: effects, one of which the model is given on purpose where it is neither hidden nor named.
        spread: so many runs on devices that are not what was diagnosed.
    """

    evaluations: int
    wrong_names: tuple[str, ...] = ()
    spread: int = 0


def try_bench(case: Case, folder: Path, trial: Trial) -> Tried:
    """Try one bench; what goes wrong is an answer too."""
    begin = time.process_time()
    found: dict[str, Any] = {"id": case.id, "truth": case.effect_ids}
    try:
        found |= _tried(case, folder, trial)
    except Exception as error:
        found["error"] = f"{type(error).__name__}: {error}"
    return Tried(**found, seconds=time.process_time() - begin)


def _tried(case: Case, folder: Path, trial: Trial) -> dict[str, Any]:
    from bender_native.ready import ready_plant_fmu
    from bender_tuner.results.gains_file import read_controller

    diagnosis = _diagnosis(case, folder)
    effects = tuple(x["id"] for x in diagnosis["effects"])
    found: dict[str, Any] = {"verdict": diagnosis["verdict"], "effects": effects}
    file = folder / "diagnosis" / diagnosis["model"]
    model = load_model(file)
    if trial.wrong_names:
        wrong = [x for x in trial.wrong_names if x not in (*case.effect_ids, *effects)]
        found["wrong"] = wrong[case.seed % len(wrong)]
        model = model.with_block(found["wrong"], **CATALOGUE[found["wrong"]].example)
    told = diagnosed(file)
    if trial.wrong_names:  # what was put in is in no diagnosis
        told = replace(told, known=None, vouched_for=False)
    session = tuned(model, case, folder / "tuned", trial.evaluations, told)
    judgement = session.contenders[0].judgement
    found |= {
        "recommended": session.following is not None,
        "worst_ms": math.nan if judgement is None else judgement.robustness.worst_sensitivity_peak,
    }
    if session.following is None or judgement is None:
        return found | {"error": session.reason or session.following_note}
    gains, limits, _, followed = read_controller(folder / "tuned" / "gains.toml")
    if followed is None:
        return found
    crossover = judgement.robustness.nominal.crossover_rad_per_s
    limit_Hz = crossover / (2.0 * math.pi) if math.isfinite(crossover) else 1.0
    runs = _Runs(case, gains, limits, followed, folder / "tuned" / followed.fmu, ready_plant_fmu(load_model(file)))
    return found | _compared(runs, limit_Hz) | _spread(runs, trial.spread)


def _diagnosis(case: Case, folder: Path) -> dict[str, Any]:
    """Return the diagnosis of a bench by its record; that of an earlier run where it is there."""
    from bender_studies.demonstration.bench import diagnose_run

    earlier = folder / "diagnosis" / "diagnosis.json"
    if earlier.is_file():
        return json.loads(earlier.read_text(encoding="utf-8"))
    folder.mkdir(parents=True, exist_ok=True)
    bench = Bench(case)
    write_record(folder / "record.csv", bench.record(bench.excitation(), bench.noise()))
    return diagnose_run(folder / "record.csv", folder / "diagnosis", MODEL)


def tuned(model: Model, case: Case, out: Path, evaluations: int, found: Diagnosed = NOTHING) -> "Session":
    """Tune on a model and its rivals, with the camera and the supply of the benches."""
    from bender_native.lacking import lacking_fmus
    from bender_native.ready import ready_plant_fmu
    from bender_tuner.task.session import (
        open_beside,
        open_guarded,
        open_rivals,
        pose_problem_in_units,
        run_session,
        write_results,
    )
    from bender_tuner.task.settings import make_settings

    settings = make_settings(
        setpoint_um=SETPOINT_UM,
        rate_Hz=RATE_HZ,
        latency_frames=0,
        exposure_s=0.0,
        noise_um=NOISE_UM[case.sensor],
        slew_V_per_s=SLEW_V_PER_S,
        evaluations=evaluations,
    )
    found = found.with_fmus_of(ready_plant_fmu)
    with (
        open_guarded(ready_plant_fmu(model), found=found) as (plant, facts),
        open_rivals(plant, facts, found.rivals) as rivals,
        open_beside(plant, facts, () if found.vouched_for else lacking_fmus(model)) as lacking,
    ):
        problem = pose_problem_in_units(plant, settings, facts, rivals=rivals)
        session = run_session(plant, facts, problem, follow_model=True, doubted=lacking)
        write_results(session, facts, prepare_directory(out))
    return session


def _compared(runs: "_Runs", limit_Hz: float) -> dict[str, Any]:
    """The PID block alone, then with the model, on every reference."""
    lowest_um = lowest(runs.case)
    tracking = []
    for name, reference, length_s, period_s in _references(limit_Hz, max(LOWEST_UM, lowest_um)):
        plain, followed = (rms_um(runs.run(reference, length_s, x, preview=True), period_s) for x in (False, True))
        tracking.append((name, plain, followed))
    _, slowest, length_s, period_s = _references(limit_Hz, max(LOWEST_UM, lowest_um))[0]
    alone = replace(runs, gains=Gains(0.0, 0.0)).run(slowest, length_s, True, preview=True)
    stairs = _stairs_above(lowest_um)
    plain, followed = (runs.run(stairs, STAIRS_S, x, preview=False) for x in (False, True))
    one, two = _stairs(stairs, plain), _stairs(stairs, followed)
    return {
        "tracking": tuple(tracking),
        "settling_s": (one[0], two[0]),
        "overshoot_percent": (one[1], two[1]),
        "stairs_um": (rms_um(plain), rms_um(followed)),
        "dead_time_um": dead_time_um(stairs, plain, runs.model.dead_time_s),
        "open_loop_percent": loop_percent(alone, period_s),
        "possible_um": least_um(runs.case, stairs, followed),
    }


def _spread(runs: "_Runs", count: int) -> dict[str, Any]:
    """Stairs with the model on devices that are not what was diagnosed, seen one frame later."""
    if not count:
        return {}
    stairs = _stairs_above(lowest(runs.case))
    others = [replace(runs, case=x, later_frames=LATER_FRAMES) for x in off_nominal(runs.case, count)]
    ended = [is_unstable(x.run(stairs, STAIRS_S, True, preview=False), reach(x.case)) for x in others]
    return {"spread": count, "unstable": sum(ended)}


def _stairs_above(lowest_um: float) -> Profile:
    return Profile(STAIR_TIMES_S, tuple(max(x, lowest_um) if k > 1 else x for k, x in enumerate(STAIR_LEVELS_UM)))


@dataclass(frozen=True, slots=True)
class _Runs:
    case: Case
    gains: Gains
    limits: Limits
    model: FollowedModel
    fmu: Path
    like: Path
    later_frames: int = 0

    def run(self, reference: Reference, length_s: float, follow: bool, *, preview: bool) -> Record:
        loop = Loop(1.0 / RATE_HZ, self.limits, SLEW_V_PER_S, preview=preview)
        with ExitStack() as ends:
            if follow:
                follower = ends.enter_context(open_follower(self.model, self.fmu, self.gains, loop))
                ahead_s = 0.0 if follower.shaper is not None else follower.look_ahead_s + self.model.dead_time_s
                controller: Controller = Following(follower, reference, ahead_s)
            else:
                controller = _Plain(self.gains, self.limits, reference)
            if self.later_frames:
                controller = Late(controller, self.later_frames)
            like = ends.enter_context(closing(FmuPlant(self.like)))
            return run_hidden(self.case, controller, reference, RATE_HZ, length_s, self.case.seed, like)


@dataclass(frozen=True, slots=True)
class _Plain:
    gains: Gains
    limits: Limits
    reference: Reference

    def rest(self) -> tuple[PidState, float]:
        return PidState(), 0.0

    def step(
        self, state: tuple[PidState, float], time_s: float, reading_um: float
    ) -> tuple[tuple[PidState, float], float]:
        block, command_V = state
        bounds = pid.limits_at(self.limits, command_V, SLEW_V_PER_S / RATE_HZ)
        after = pid.step(self.gains, bounds, block, self.reference.value(time_s), reading_um, 1.0 / RATE_HZ)
        return after, after[1]


@dataclass(frozen=True, slots=True)
class Following:
    """A controller that follows a model, on a reference that it may see so much ahead."""

    follower: ModelFollower
    reference: Reference
    ahead_s: float

    def rest(self) -> Memory:
        """Return the memory before the first sample."""
        return model_following.rest(self.follower)

    def step(self, state: Memory, time_s: float, reading_um: float) -> tuple[Memory, float]:
        """Return the memory after a sample, and the command in V."""
        aim_um = self.reference.value(time_s + self.ahead_s)
        after = model_following.step(self.follower, state, aim_um, reading_um, self.follower.period_s)
        return after, after.command_V


def lowest(case: Case) -> float:
    """Return the height in um that a bench can be led to on the way down, with a reserve above where 0 V leads.

    A play, remanence or an offset keep it from 0 um, whatever leads it: nothing lower is asked of a controller.
    """
    count = round(_RAMP_S * RATE_HZ)
    time_s = np.arange(2 * count + 2) / RATE_HZ
    up = np.linspace(0.0, _RAMP_V, count)
    tip_um = Bench(case).clean(Excitation(case.sensor, time_s[: count + 1], np.append(up, _RAMP_V)))
    top_V = up[min(int(np.searchsorted(np.maximum.accumulate(tip_um), HIGHEST_UM)), count - 1)]
    volts = np.append(np.concatenate([np.linspace(0.0, top_V, count), np.linspace(top_V, 0.0, count)]), [0.0, 0.0])
    left_um = float(Bench(case).clean(Excitation(case.sensor, time_s, volts))[-1])
    return left_um + RESERVE * (HIGHEST_UM - left_um)


def reach(case: Case) -> tuple[float, float]:
    """Return the lowest and the highest set-point in um that a bench can be led to, with a reserve at both ends."""
    count = round(_RAMP_S * RATE_HZ)
    time_s, volts = np.arange(count + 1) / RATE_HZ, np.append(np.linspace(0.0, _RAMP_V, count), _RAMP_V)
    least_um, most_um = lowest(case), float(Bench(case).clean(Excitation(case.sensor, time_s, volts))[-1])
    return least_um, most_um - RESERVE * (most_um - least_um)


def _references(limit_Hz: float, lowest_um: float) -> list[tuple[str, Reference, float, float]]:
    """Name, reference, length and period of every triangle and sine; judged from the second period on."""
    found: list[tuple[str, Reference, float, float]] = []
    for share in SHARES_OF_LIMIT:
        frequency = share * limit_Hz
        length_s = PERIODS / frequency
        times = np.linspace(0.0, length_s, _TRIANGLE_POINTS * PERIODS, endpoint=False)
        phase = (times * frequency) % 1.0
        heights = lowest_um + (HIGHEST_UM - lowest_um) * (1.0 - np.abs(2.0 * phase - 1.0))
        triangle = Profile(tuple(times.tolist()), tuple(heights.tolist()))
        sine = Sine(0.5 * (HIGHEST_UM - lowest_um), frequency, 0.5 * (HIGHEST_UM + lowest_um), -0.5 * math.pi)
        found += [(f"triangle {frequency:.2g} Hz", triangle, length_s, 1.0 / frequency)]
        found += [(f"sine {frequency:.2g} Hz", sine, length_s, 1.0 / frequency)]
    return found


def _stairs(stairs: Profile, record: Record) -> tuple[float, float]:
    """Median settling time and largest overshoot of the stairs."""
    times, levels = stairs.times_s, stairs.setpoints_um
    settling, overshoot = [], []
    for k in range(1, len(times)):
        end_s = times[k + 1] if k + 1 < len(times) else STAIRS_S
        rows = (record.time_s >= times[k] - 1e-9) & (record.time_s < end_s - 1e-9)
        since, tip = record.time_s[rows] - times[k], record.displacement_um[rows]
        metrics = step_metrics(Trace(since, np.full(tip.size, levels[k]), tip, tip, record.voltage_V[rows]))
        settling.append(metrics.settling_time_s)
        overshoot.append(metrics.overshoot_percent)
    return (math.nan if any(map(math.isnan, settling)) else float(np.median(settling))), max(overshoot)


def loop_percent(record: Record, period_s: float) -> float:
    """Return the widest gap between the way up and the way down of the last period of a triangle, of its height in %.

    Args:
        record: with set-points, the last period of them from the lowest to the highest and back.
        period_s: of the triangle.
    """
    if record.setpoint_um is None:
        raise ValueError("setpoint_um must be there, found None")
    since_s = record.time_s - (record.time_s[-1] + 1.0 / RATE_HZ - period_s)
    asked_um, missed_um = record.setpoint_um, record.displacement_um - record.setpoint_um
    up, down = (since_s >= 0.0) & (since_s < 0.5 * period_s), since_s >= 0.5 * period_s
    low_um, high_um = float(asked_um[up].min()), float(asked_um[up].max())
    levels_um = np.linspace(low_um, high_um, 100)[10:-10]
    rising, falling = (np.argsort(asked_um[x]) for x in (up, down))
    ways = (
        np.interp(levels_um, asked_um[x][order], missed_um[x][order])
        for x, order in zip((up, down), (rising, falling), strict=True)
    )
    first, second = ways
    return 100.0 * float(np.max(np.abs(first - second))) / (high_um - low_um)


def least_um(case: Case, stairs: Profile, record: Record) -> float:
    """Return the rms of a tip that is led to each level by commands that go as far as they may as soon as they may.

    More command never means less tip, so until it arrives no controller is nearer; from then on it counts as exact.

    Args:
        case: of the bench.
        stairs: the levels.
        record: of a run; where it stood before each level.
    """
    change_V, time_s = SLEW_V_PER_S / RATE_HZ, np.append(record.time_s, record.time_s[-1] + 1.0 / RATE_HZ)
    ends, missed_um = (*stairs.times_s[1:], math.inf), np.zeros(record.time_s.size)
    for begin_s, end_s, level_um in zip(stairs.times_s, ends, stairs.setpoints_um, strict=True):
        rows = np.flatnonzero((record.time_s >= begin_s - 1e-9) & (record.time_s < end_s - 1e-9))
        way = math.copysign(1.0, level_um - record.displacement_um[rows[0]])
        volts = np.append(record.voltage_V, 0.0)
        before_V = volts[rows[0] - 1] if rows[0] else 0.0
        volts[rows[0] :] = np.clip(before_V + way * change_V * np.arange(1, volts.size - rows[0] + 1), *VOLTS)
        upto = rows[-1] + 2
        tips = Bench(case).clean(Excitation(case.sensor, time_s[:upto], volts[:upto]))[rows]
        beyond = way * (tips - level_um) >= 0.0
        missing = slice(0, int(np.argmax(beyond)) if beyond.any() else rows.size)
        missed_um[rows[missing]] = tips[missing] - level_um
    return float(np.sqrt(np.mean(missed_um**2)))


def dead_time_um(stairs: Profile, record: Record, dead_time_s: float) -> float:
    """Return the rms of a tip that is exact as soon as dead time and sampling let it.

    A command acts after the dead time at the earliest, and shows in the sample behind that.
    """
    acting = np.searchsorted(record.time_s, record.time_s - dead_time_s - 1e-9) - 1
    answered = np.where(acting < 0, stairs.setpoints_um[0], stairs.sample(record.time_s[np.maximum(acting, 0)]))
    exact = replace(record, displacement_um=answered.astype(float))
    return rms_um(exact)
