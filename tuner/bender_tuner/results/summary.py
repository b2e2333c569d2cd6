"""What a tuning prints: the task, the table, the gains, the findings in a sentence each."""

import math
from collections.abc import Iterator, Sequence

from bender_loop.control.metrics import has_settled
from bender_loop.control.pid import Gains
from bender_loop.shell.progress import Cell
from bender_report.wording import is_other_rig, listed, percent
from bender_tuner.optimisers.methods import METHODS
from bender_tuner.results.tuning_file import FmuFacts
from bender_tuner.rules.gain_forms import to_discrete, to_isa
from bender_tuner.rules.ziegler_nichols import ZieglerNichols
from bender_tuner.task.contenders import Contender
from bender_tuner.task.judgement import Judgement
from bender_tuner.task.practitioner import PractitionerReport, Priorities
from bender_tuner.task.recommendation import Recommendation
from bender_tuner.task.settings import PAPER_METHOD, RULES, TuneSettings

_HIDDEN_PERCENT = 5.0
_COUNTS = 0.05
"""A part of the controller below this share of the largest one moves the loop by about a twentieth of a radian."""
_RISE = 2.2
"""Bandwidth in rad/s times rise time in s, of a first-order answer."""
DECIDING = "method", "objective", "rms_um", "settle_s", "over_%", "bounds"
COLUMNS: tuple[str, ...] = ("method", "objective", "rise_s", "settle_s", "over_%", "worst_Ms", "bounds")


def task_lines(settings: TuneSettings, fmu: str, input_name: str, output_name: str) -> Iterator[str]:
    """What is about to be done."""
    limits = f"{settings.lower_V:g}..{settings.upper_V:g} V"
    slew = "" if math.isinf(settings.slew_V_per_s) else f", at most {settings.slew_V_per_s:g} V/s"
    yield f"plant: {fmu}, {input_name} -> {output_name}, command {limits}{slew}"
    yield f"loop: {camera_words(settings)}; step to {settings.setpoint_um:g} µm, {settings.duration_s:g} s a run"
    if settings.method in RULES:
        yield f"method: {RULES[settings.method]}, a closed formula; judged by {settings.objective}"
    else:
        about = METHODS[settings.method].description
        yield (
            f"method: {settings.method} ({about}); objective {settings.objective}, "
            f"{settings.evaluations} evaluations, seed {settings.seed}"
        )
    if settings.method == PAPER_METHOD:
        yield "paper mode: the derivative acts on the error, unfiltered"


def camera_words(settings: TuneSettings) -> str:
    """How the loop sees the plant."""
    exposure = f"{settings.exposure_s * 1e3:.3g} ms exposure" if settings.exposure_s else "snapshots"
    latency = f"{settings.latency_frames} frame{'' if settings.latency_frames == 1 else 's'} of latency"
    noise = f", noise {settings.noise_um:g} µm" if settings.noise_um else ""
    return f"{settings.rate_Hz:g} Hz, {latency}, {exposure}{noise}"


def deciding_title(settings: TuneSettings) -> str:
    """Of the table of what decides: its figures are of coarser steps than those of the table of all methods."""
    seen = f"every {1e3 * settings.sampling.plant_step_s:.3g} ms" if settings.sampling.substeps > 1 else "at the frames"
    return f"by what decides whether the model is followed: the same step seen {seen} for {settings.duration_s:g} s"


def taken_units(facts: FmuFacts) -> str:
    """In which units variables are taken for which the FMU declares none."""
    told = listed([f"{name}, taken as {unit}" for name, unit in facts.taken_units.items()])
    return f"the FMU declares no unit for {told}; for another one say, for example, --units V,um"


def table_rows(contenders: Sequence[Contender]) -> tuple[list[str], list[list[Cell]]]:
    """(columns, rows); a column for Monte Carlo where it was run."""
    with_monte_carlo = any(contender.monte_carlo is not None for contender in contenders)
    columns = [*COLUMNS, "unstable"] if with_monte_carlo else list(COLUMNS)
    rows = [_row(contender) for contender in contenders]
    if with_monte_carlo:
        rows = [[*row, _unstable(contender)] for row, contender in zip(rows, contenders, strict=True)]
    return columns, rows


def recommendation_rows(found: Recommendation) -> tuple[list[str], list[list[Cell]]]:
    """(columns, rows) of what decides whether a model is followed: the PID block alone, with the model, the rules."""
    return list(DECIDING), [
        [
            x.label,
            _number(x.report.value),
            _number(x.rms_um),
            None if math.isnan(x.report.settling_time_s) else round(x.report.settling_time_s, 3),
            round(x.report.overshoot_percent, 2) if math.isfinite(x.report.overshoot_percent) else "runs away",
            "kept" if x.report.bounds_kept else "broken",
        ]
        for x in found.scores
    ]


def gain_lines(gains: Gains, rate_Hz: float) -> Iterator[str]:
    """The gains in three forms."""
    acts = "the error" if gains.derivative_on_error else "the measurement"
    yield (
        f"parallel: Kp {gains.proportional_V_per_um:.5g} V/µm, Ki {gains.integral_V_per_um_s:.5g} V/(µm s), "
        f"Kd {gains.derivative_V_s_per_um:.5g} V s/µm, filter {gains.filter_time_s:.4g} s, derivative of {acts}"
    )
    isa = to_isa(gains)
    yield (
        "ISA: none, it has no place for I or D without P"
        if isa is None
        else (f"ISA: Kc {isa.gain_V_per_um:.5g} V/µm, Ti {isa.integral_time_s:.5g} s, Td {isa.derivative_time_s:.5g} s")
    )
    discrete = to_discrete(gains, 1.0 / rate_Hz)
    _, a1, a2 = discrete.denominator
    yield (
        f"discrete at {rate_Hz:g} Hz: u[k] = {-a1:.5g} u[k-1] {-a2:+.5g} u[k-2] "
        f"+ ({_polynomial(discrete.setpoint_V_per_um)}) setpoint "
        f"- ({_polynomial(discrete.measurement_V_per_um)}) measurement"
    )


def finding_lines(
    contenders: Sequence[Contender], priorities: Priorities, rule: ZieglerNichols, notes: Sequence[str]
) -> Iterator[str]:
    """Bounds and margins of the tuned gains, Ziegler-Nichols' verdict, what else is worth knowing."""
    tuned = contenders[0].judgement
    if tuned is not None:
        yield _bounds_line(tuned, priorities)
        yield _margins_line(tuned)
        yield from kind_line(tuned.gains, tuned.metrics.rise_time_s)
        yield from _hidden_line(tuned)
    yield f"Ziegler-Nichols, {'well' if rule.well_posed else 'not well'} posed here: {rule.sentence}"
    yield from _unstable_line(contenders)
    yield from (f"{contender.label}: {contender.remark}" for contender in contenders if _speaks(contender))
    yield from (f"note: {note}" for note in notes)


def _bounds_line(tuned: Judgement, priorities: Priorities) -> str:
    p = tuned.practitioner
    worst = f"{p.worst_sensitivity_peak:.3g}" if math.isfinite(p.worst_sensitivity_peak) else "without bound"
    rivals = listed(list(dict.fromkeys(x.rival for x in p.cases if x.rival)))
    return (
        f"bounds {'kept' if p.bounds_kept else 'NOT kept'}: worst Ms {worst} over gain and latency (at most "
        f"{priorities.sensitivity_bound:g}), overshoot {p.overshoot_percent:.3g} % "
        f"(at most {100.0 * priorities.overshoot_bound:g} %){_further(p, priorities)}"
        + (f"; also with {rivals}, which the records leave open" if rivals else "")
    )


def _further(p: PractitionerReport, priorities: Priorities) -> str:
    said = ""
    if priorities.settling_bound_s is not None:
        settling_s = p.settling_time_s
        found = "never settles" if math.isnan(settling_s) else f"settles in {settling_s:.3g} s"
        said += f", {found} (at most {priorities.settling_bound_s:g} s)"
    if priorities.noise_gain_bound_V_per_um is not None:
        bound = priorities.noise_gain_bound_V_per_um
        said += f", noise gain {p.noise_gain_V_per_um:.3g} V/µm (at most {bound:g} V/µm)"
    return said


def kind_line(gains: Gains, rise_time_s: float) -> Iterator[str]:
    """What the controller is in practice: the parts that count where the loop is as quick as its rise."""
    if not (math.isfinite(rise_time_s) and rise_time_s > 0.0):
        return
    omega = _RISE / rise_time_s
    parts = {
        "P": gains.proportional_V_per_um,
        "I": gains.integral_V_per_um_s / omega,
        "D": gains.derivative_V_s_per_um * omega,
    }
    counting = "".join(name for name, x in parts.items() if x > _COUNTS * max(parts.values()))
    if counting in ("", "PID"):
        return
    shares = ", ".join(f"{name} {percent(x / max(parts.values()))}" for name, x in parts.items())
    article = "an" if counting[0] == "I" else "a"
    yield f"in practice {article} {counting} controller: at {omega:.3g} rad/s its parts are {shares} of the largest"


def _margins_line(tuned: Judgement) -> str:
    robustness = tuned.robustness
    if not robustness.nominal.stable:
        return "the nominal loop is unstable in linear analysis"
    margins = robustness.nominal
    return (
        f"nominal margins: gain x {margins.gain_margin:.3g}, phase {margins.phase_margin_deg:.3g} deg, delay "
        f"{margins.delay_margin_s:.3g} s; noise gain {robustness.noise_gain_V_per_um:.3g} V/µm; 1 V of load moves the "
        f"{'output' if is_other_rig() else 'tip'} by {robustness.load_rejection.peak_um_per_V:.3g} µm at most"
    )


def _hidden_line(tuned: Judgement) -> Iterator[str]:
    shown, whole = tuned.at_frames.overshoot_percent, tuned.metrics.overshoot_percent
    if whole > shown + _HIDDEN_PERCENT:
        yield (
            f"between the frames the tip overshoots by {whole:.3g} %, at the frames by {shown:.3g} %: "
            "an objective that looks at the frames alone does not see it"
        )


def _unstable_line(contenders: Sequence[Contender]) -> Iterator[str]:
    for contender in contenders:
        unstable = contender.judgement.robustness.unstable_cases if contender.judgement is not None else 0
        if contender.judgement is not None and unstable:
            cases = len(contender.judgement.robustness.cases)
            yield f"{contender.label}: the loop is unstable in {unstable} of {cases} cases of gain and latency"


def _speaks(contender: Contender) -> bool:
    return contender.kind == "search" and bool(contender.remark)


def _row(contender: Contender) -> list[Cell]:
    judgement = contender.judgement
    if judgement is None:
        return [contender.label, *[None] * (len(COLUMNS) - 1)]
    m = judgement.metrics
    return [
        contender.label,
        _number(judgement.value),
        _number(round(m.rise_time_s, 4)),
        _settled(m.settling_time_s, float(judgement.trace.time_s[-1])),
        round(m.overshoot_percent, 2) if math.isfinite(m.overshoot_percent) else "runs away",
        _peak(judgement.practitioner.worst_sensitivity_peak),
        "kept" if judgement.practitioner.bounds_kept else "broken",
    ]


def _settled(settling_s: float, run_s: float) -> Cell:
    if math.isnan(settling_s):
        return "never"
    return round(settling_s, 3) if has_settled(settling_s, run_s) else f"not within {run_s:.3g} s"


def _number(value: float) -> Cell:
    return value if math.isfinite(value) else None


def _peak(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "unstable"


def _unstable(contender: Contender) -> Cell:
    if contender.monte_carlo is None:
        return None
    return f"{contender.monte_carlo.unstable} of {len(contender.monte_carlo.outcomes)}"


def _polynomial(coefficients: tuple[float, float, float]) -> str:
    b0, b1, b2 = coefficients
    return f"{b0:.5g} {b1:+.5g}/z {b2:+.5g}/z^2"
