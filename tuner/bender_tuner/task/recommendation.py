"""Whether a model is followed: shapers and horizons tried, and judged beside the PID block alone and the rules.

Two questions have two ensembles. Whether the loop holds is asked of a device that is off by as much as the settings
say, for the block's gains decide it and nothing that a record shows makes a loop safe for good. Whether following is
worth it is asked of what the device may be as far as is known: after a diagnosis, what its residual leaves open; else
it may also lack any effect that the model has. Judged with a gain that is 30 % off, a set-point that is reached in one
move behind a dead time is passed by 30 %, and slow gains that wait and see look better than a model that has shown to
be right.

A model is followed for two things. A set-point that nobody knew is reached sooner, and a reference that is known
beforehand is followed nearer. Where the source is what limits a step, as a slew limit does, no controller is much
quicker than another, and the second alone is worth it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

from bender_loop.control.pid import Gains
from bender_loop.errors import RunError
from bender_loop.fmu.diagnosed import Known
from bender_loop.fmu.followed_model import FollowedModel
from bender_tuner.model.ensemble import Rival
from bender_tuner.model.margins import margins
from bender_tuner.task.contenders import Contender
from bender_tuner.task.doubts import WORSE, Doubt, doubts_of, harm
from bender_tuner.task.following import Following, Scored, candidates, choose, held_back
from bender_tuner.task.practitioner import PractitionerObjective, PractitionerReport
from bender_tuner.task.problem import Report, TuningProblem, as_known
from bender_tuner.task.settings import GAIN_ERROR_PERCENT, LATE_FRAMES, TuneSettings

METHOD, LABEL = "model_following", "model following"
_REFUSAL = "model following is not recommended: "
_KNOWN_SHARE, _KNOWN_RATIO = 0.15, 0.5
"""Of the frequency at which the loop still follows, a known reference; and how near it has to come where steps gain
nothing, in parts of the error of the PID block alone."""
_SLOW_RAD_PER_S = 1.0
RUNS_AWAY = _REFUSAL + "it runs away on a device that is off by as much as the gains hold for"


class Device(NamedTuple):
    """How far a device may be from its model: its gain in per cent, its frames; as its diagnosis says, or settings.

    `source` says by which file and numbers it is known, or why not; empty where a user has said both.
    """

    gain_error_percent: float
    late_frames: int
    by_diagnosis: bool
    source: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Score:
    """One controller by the yardstick that decides."""

    method: str
    label: str
    report: PractitionerReport

    @property
    def rms_um(self) -> float:
        """From the set-point, on the nominal plant."""
        return math.sqrt(self.report.nominal.metrics.mse_um2)


@dataclass(frozen=True, slots=True, eq=False)
class Recommendation:
    """What was decided, and by which figures.

    Attributes:
        following: what is followed; None where that is not recommended.
        sentence: the reason, for people.
        device: how far it may be from its model, where that was decided.
        scores: the PID block alone, model following (where it is refused, at its best), the rules.
        tried: every shaper and horizon.
    """

    following: Following | None
    sentence: str
    device: Device
    scores: tuple[Score, ...]
    tried: tuple[Scored, ...]


def recommend(
    problem: TuningProblem,
    contenders: Sequence[Contender],
    model: FollowedModel,
    fmu: Path,
    known: Known | None,
    report: Report,
    doubted: Sequence[Rival] = (),
    known_by: str = "",
) -> Recommendation | None:
    """Tune shaper and horizon with the gains as they are, and recommend them where the block alone is no better.

    Where it is a little better at steps, they are recommended for what is known beforehand.

    The feedforward is no part of the loop, so Ms and noise gain are those of the gains.

    Args:
        problem: the plant, posed.
        contenders: the tuned gains first; None is returned where there are none.
        model: what may be followed, unshaped.
        fmu: of it.
        known: how well the diagnosis of the model bounds the device; None where it does not.
        report: is told how far the work is.
        doubted: devices without an effect that nothing vouches for, named after what they are without.
        known_by: by which file and numbers it bounds the device, or why not.

    Raises:
        RunError: the plant failed.
    """
    gains = contenders[0].gains
    if gains is None:
        return None
    settings = problem.settings
    device = device_of(settings, known, known_by)
    judge = problem.practitioner
    if device.by_diagnosis:
        judge = as_known(problem, device.gain_error_percent, device.late_frames)
    alone = judge.evaluate(gains)
    known_Hz = _known_frequency_Hz(problem, gains)
    doubted = () if settings.gain_error_percent is not None else doubted
    doubts = doubts_of(problem.experiment, doubted, gains, known_Hz)
    spread = partial(judge.spread, gains)
    tried: list[Scored] = []
    best: Scored | None = None
    for group in candidates(model, fmu, settings.setpoint_um, settings.sampling, problem.reduced.lag_s):
        for count, following in enumerate(group, start=1):
            tried.append(_scored(judge, gains, following, doubts))
            report("tuning model following", count, len(group), f"best {min(x.value for x in tried):.4g}")
        best = choose(tried, alone.value, spread)
        if best is not None:
            break
    ratio = math.nan
    if best is None and (near := choose(tried, WORSE * alone.value, spread)) is not None:
        ratio = judge.known_sine_ratio(known_Hz, gains, near.following)
        best = near if ratio <= _KNOWN_RATIO else None
    if best is not None and (device.by_diagnosis or settings.gain_error_percent is not None):
        best = _careful(judge, gains, best, doubts, max(alone.value, best.value))
    holds = best is None or math.isfinite(problem.practitioner.evaluate(gains, best.following).value)
    shown = best or min(tried, key=lambda x: (not x.bounds_kept, bool(x.harm), x.value))
    scores = [
        Score(contenders[0].method, contenders[0].label, alone),
        Score(METHOD, LABEL, judge.evaluate(gains, shown.following)),
        *_of_rules(judge, contenders),
    ]
    return Recommendation(
        following=best.following if best is not None and holds else None,
        sentence=_why(scores[0], scores[1], best is not None, device, shown.harm, ratio) if holds else RUNS_AWAY,
        device=device,
        scores=tuple(scores),
        tried=tuple(tried),
    )


def device_of(settings: TuneSettings, known: Known | None, known_by: str = "") -> Device:
    """Return how far a device may be off; a user's word stands, for the rest the diagnosis, or what nobody knows."""
    percent, late = settings.gain_error_percent, settings.late_frames
    usual = Device(GAIN_ERROR_PERCENT if percent is None else percent, LATE_FRAMES if late is None else late, False)
    if None not in (percent, late):
        return usual
    if known is None:
        return usual._replace(source=known_by)
    if known.gain_error_percent >= GAIN_ERROR_PERCENT:
        return usual._replace(source=f"{known_by}: it leaves the gain open by {known.gain_error_percent:.3g} %")
    frames = min(LATE_FRAMES, math.floor(known.delay_error_s * settings.rate_Hz + 0.5))
    percent = known.gain_error_percent if percent is None else percent
    return Device(percent, frames if late is None else late, True, known_by)


def _scored(judge: PractitionerObjective, gains: Gains, following: Following, doubts: Sequence[Doubt]) -> Scored:
    found = judge.evaluate(gains, following)
    kept = found.bounds_kept and judge.keeps_overshoot(gains, following)
    harmed = harm(doubts, gains, following, 100.0 * judge.priorities.overshoot_bound) if kept else ""
    return Scored(following, found.value, math.sqrt(found.nominal.metrics.mse_um2), kept, harmed)


def _careful(judge: PractitionerObjective, gains: Gains, best: Scored, doubts: Sequence[Doubt], most: float) -> Scored:
    """Return the candidate with so much held back that no device passes its bound that is as far off as it may be.

    It stays as it is where that would cost it a bound, or make it worse than `most`.
    """
    bound = judge.priorities.overshoot_bound
    cases = judge.evaluate(gains, best.following).cases
    share = held_back(0.01 * max(x.metrics.overshoot_percent for x in cases), bound)
    if not 0.0 < share < 1.0:
        return best
    model = replace(best.following.model, held_back=share)
    found = _scored(judge, gains, replace(best.following, model=model), doubts)
    return found if found.bounds_kept and not found.harm and found.value <= most else best


def _known_frequency_Hz(problem: TuningProblem, gains: Gains) -> float:
    """Of a reference that the loop follows, and that is told beforehand."""
    crossover = margins(gains, problem.ensemble.nominal.delayed).crossover_rad_per_s
    follows_rad_per_s = crossover if math.isfinite(crossover) else _SLOW_RAD_PER_S
    return _KNOWN_SHARE * follows_rad_per_s / (2.0 * math.pi)


def _of_rules(judge: PractitionerObjective, contenders: Sequence[Contender]) -> list[Score]:
    found: list[Score] = []
    for x in contenders:
        if x.kind == "rule" and x is not contenders[0] and x.gains is not None:
            try:
                found.append(Score(x.method, x.label, judge.evaluate(x.gains)))
            except RunError:  # the plant does not survive the gains of a rule
                continue
    return found


def _why(alone: Score, followed: Score, recommended: bool, device: Device, harmed: str, ratio: float) -> str:
    """Return why a model is followed or not, and what would change a refusal where it is better on itself."""
    values = f"objective {followed.report.value:.4g} against {alone.report.value:.4g} of the PID block alone"
    judged = _judged(device)
    if recommended and followed.report.value >= alone.report.value:
        nearer = f"a reference that is known beforehand is followed with {ratio:.2g} of its error"
        return f"model following: {values}, as quick as that within {100.0 * (WORSE - 1.0):.0f} %; {nearer}"
    if recommended:
        return f"model following: {values}, with the same gains{judged and '; '}{judged}"
    if harmed:
        return f"{_REFUSAL}{harmed}; say with --gain-error how well the device is known, or diagnose a record of it"
    if not followed.report.bounds_kept:
        return _REFUSAL + "no shaper and horizon keeps the bounds"
    if followed.rms_um >= alone.rms_um or not judged:
        return _REFUSAL + values
    return (
        f"{_REFUSAL}{_known_better(device)}; on the model itself it is nearer to the set-point, {followed.rms_um:.4g} "
        f"against {alone.rms_um:.4g} µm rms. The {values}, {judged}"
    )


def _known_better(device: Device) -> str:
    """Return the options that may turn a refusal round, and what was assumed in their place."""
    percent = f"{device.gain_error_percent:.3g} %"
    if device.by_diagnosis:
        assumed = "as the diagnosis has it"
    else:
        assumed = "the default assumption" if device.gain_error_percent == GAIN_ERROR_PERCENT else "as you said"
    gain = f"--gain-error PERCENT where the gain is known better than within {percent} ({assumed})"
    late = "--late-frames 0 where one clock times the loop"
    said = [x for x, counts in ((gain, device.gain_error_percent), (late, device.late_frames)) if counts]
    return f"try {', or '.join(said)}" if said else "it was judged on the model itself"


def _judged(device: Device) -> str:
    """Return on which devices it was decided; empty for the model itself."""
    percent, late = device.gain_error_percent, device.late_frames
    if device.by_diagnosis:
        frames = f"a frame {late} late" if late else "frames in time"
        told = f"judged with a gain that is off by {percent:.3g} % and {frames}, as the diagnosis of the model has it"
        return f"{told} ({device.source})" if device.source else told
    causes = [f"a gain that is off by {percent:.3g} % (--gain-error)"] if percent else []
    causes += [f"a frame that comes {late} late (--late-frames; 0 where one clock times the loop)"] if late else []
    if not causes:
        return ""
    return f"judged with {' and '.join(causes)}{f', for {device.source}' if device.source else ''}"
