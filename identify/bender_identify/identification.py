"""Identification from records to a model: learn, fit the rivals, score all of them on held-out rows."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from bender_identify.fitting.candidate import Candidate, with_delay
from bender_identify.fitting.identifiability import examine
from bender_identify.fitting.resimulation import Array, Bank, Score, quasi_static, score
from bender_identify.identification_result import Identification, Row
from bender_identify.operators.bouc_wen_fit import fit_bouc_wen
from bender_identify.operators.first_order_lag import fit_lag
from bender_identify.operators.prandtl_ishlinskii_fit import fit_prandtl_ishlinskii
from bender_identify.operators.remanence import remanence_um
from bender_identify.records.excitation import cycle_scatter_um
from bender_identify.records.experiment import Experiment
from bender_identify.records.extrapolation import compare_unseen, cycle_of
from bender_identify.regression.equation_search import Learned, learn, silent
from bender_identify.report.remarks import remarks
from bender_identify.settings import Settings
from bender_loop.errors import InputError, RunError
from bender_loop.shell.extras import require
from bender_plant.model import Model, ModelError

CLEARLY_BETTER = 0.9
"""An operator is written instead of the learned equation where its held-out error is below this part of it."""
MOST_FOLDS = 4
DELAY_ROWS = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0)


def identify(
    experiments: Sequence[Experiment],
    base: Model,
    settings: Settings,
    rng: np.random.Generator,
    held_out: Sequence[Experiment] = (),
    progress: Callable[[str], None] = silent,
) -> Identification:
    """Identify hysteresis from records.

    A single record is split in time. Of several, each is left out in turn to score the others' fit, and the models are
    then fitted to all. Records given as `held_out` are never fitted; with them the others are fitted as a whole.

    Args:
        experiments: records to fit.
        base: model that gives supply, structure, surroundings and sensor.
        settings: how.
        rng: draws the resamples of the ensemble and of the coefficients.
        held_out: records that are excluded from fits.
        progress: told what is being done.

    Raises:
        InputError: the records hold too little to learn from, or PySINDy is not installed.
        RunError: no model that a model file can hold follows the records.
    """
    if not experiments:
        raise InputError("no record was given to fit, expected at least one")
    for library in ("pysindy", "matplotlib"):
        require(library, "identify", "bender identify")
    # products of a few columns: more threads than one wait for each other longer than they compute
    with threadpool_limits(limits=1):
        try:
            return _identified(tuple(experiments), base, settings, rng, tuple(held_out), progress)
        except (ModelError, ArithmeticError) as error:
            advice = "check the units of the columns, or give another --model"
            raise RunError(f"no model could be learned: {error}; {advice}") from error


def _identified(
    experiments: tuple[Experiment, ...],
    base: Model,
    settings: Settings,
    rng: np.random.Generator,
    held_out: tuple[Experiment, ...],
    progress: Callable[[str], None],
) -> Identification:
    fitting = tuple(x.fitting_all() for x in experiments) if held_out else experiments
    everything = (*fitting, *(x.holding_out_all() for x in held_out))
    delay_s = settings.delay_s
    if delay_s is None:
        progress("transport delay")
        delay_s = _delay_s(fitting, base)
    base = with_delay(base, delay_s)
    learned = learn(fitting, base, settings, rng, progress)
    candidates = _candidates(learned, fitting, base, progress)
    crossed = len(experiments) > 1 and not held_out
    if crossed:
        whole = tuple(x.fitting_all() for x in experiments)
        progress("fit to all records")
        candidates = [replace(c.refit(whole), id=c.id, title=c.title) for c in candidates]
        learned = replace(learned, candidate=candidates[0])
        everything = whole
    rows = tuple(_row(c, everything, crossed, progress) for c in candidates)
    written = _written(rows, settings)
    identifiability = examine(learned, everything)
    unseen = compare_unseen(written.candidate, [r.candidate for r in rows], learned, everything, base, rng)
    judged = everything if crossed else [x for x in everything if x.held_out.any()]
    outcome = Identification(
        everything, rows, written, learned, identifiability, unseen,
        held_out_by=_how(experiments, held_out, crossed),
        floor_percent=_floor_percent(judged),
        delay_s=delay_s,
        still_percent=_still_percent(written.candidate.model, everything),
        findings=(),
    )  # fmt: skip
    return replace(outcome, findings=tuple(remarks(outcome)))


def _candidates(
    learned: Learned, fitting: Sequence[Experiment], base: Model, progress: Callable[[str], None]
) -> list[Candidate]:
    rivals: dict[str, Callable[[], Candidate | None]] = {
        "Prandtl-Ishlinskii": lambda: fit_prandtl_ishlinskii(fitting, base),
        "Bouc-Wen": lambda: fit_bouc_wen(fitting, base),
        "first-order lag": lambda: fit_lag(fitting, base),
    }
    found = [learned.candidate]
    for name, fit in rivals.items():
        progress(name)
        try:
            rival = fit()
        except ModelError:
            # its parameters are beyond what a model file takes: no rival
            continue
        found += [rival] if rival is not None else []
    return found


def _delay_s(fitting: Sequence[Experiment], base: Model) -> float:
    """Return the delay, in parts of a row, with which the operator fits best."""
    row_s = float(np.median(np.diff(fitting[0].time_s)))
    errors = {}
    for rows in DELAY_ROWS:
        fit = fit_prandtl_ishlinskii(fitting, with_delay(base, rows * row_s)).fit
        errors[rows * row_s] = float(fit.residual_um @ fit.residual_um)
    return min(errors, key=lambda delay_s: errors[delay_s])


def _row(
    candidate: Candidate, experiments: Sequence[Experiment], crossed: bool, progress: Callable[[str], None]
) -> Row:
    progress(f"held-out error of {candidate.title}")
    bank = Bank(experiments)
    readings = bank.run(candidate.model)
    fitted = score(bank.fitted(bank.measured()), bank.fitted(readings))
    if crossed:
        held_out = _left_out(candidate, experiments)
    else:
        held_out = score(bank.held_out(bank.measured()), bank.held_out(readings))
    peak_V = max((float(x.acting_V[np.argmax(np.abs(x.acting_V))]) for x in experiments), key=abs)
    left_um, remanent = remanence_um(candidate.model, peak_V, 0.5 * cycle_of(experiments[0]))
    return Row(candidate, fitted, held_out, left_um, remanent)


def _left_out(candidate: Candidate, experiments: Sequence[Experiment]) -> Score:
    """Score each record with the structure refitted to the others."""
    folds = np.array_split(np.arange(len(experiments)), min(len(experiments), MOST_FOLDS))
    measured: list[Array] = []
    simulated: list[Array] = []
    for fold in folds:
        others = [x for k, x in enumerate(experiments) if k not in fold]
        tested = Bank([experiments[k].holding_out_all() for k in fold])
        measured.append(tested.held_out(tested.measured()))
        simulated.append(tested.held_out(tested.run(candidate.refit(others).model)))
    return score(np.concatenate(measured), np.concatenate(simulated))


def _written(rows: Sequence[Row], settings: Settings) -> Row:
    if settings.keep != "auto":
        found = [row for row in rows if row.candidate.id == settings.keep]
        if not found:
            raise InputError(f"--keep: found {settings.keep!r}, which could not be fitted to these records")
        return found[0]
    best = min(rows[1:], key=lambda row: row.held_out.rms_um, default=rows[0])
    usable = math.isfinite(rows[0].remanence_um)
    return best if best.held_out.rms_um < CLEARLY_BETTER * rows[0].held_out.rms_um or not usable else rows[0]


def _still_percent(model: Model, experiments: Sequence[Experiment]) -> float:
    bank = Bank(experiments)
    return score(bank.fitted(bank.measured()), bank.fitted(bank.run(quasi_static(model)))).error_percent


def _floor_percent(experiments: Sequence[Experiment]) -> float:
    """Return what no periodic model can beat on the held-out rows, or the noise where no cycle repeats."""
    floors, readings = [], []
    for x in experiments:
        scored = x.held_out if x.held_out.any() else x.fitted
        reading = x.measured_um[scored]
        period_s = x.excitation.period_s if x.excitation.one_amplitude else None
        scatter = None if period_s is None else cycle_scatter_um(x.time_s[scored], reading, period_s)
        floors.append(np.full(len(reading), x.excitation.noise_um if scatter is None else scatter))
        readings.append(reading)
    floor, reading = np.concatenate(floors), np.concatenate(readings)
    return 100.0 * float(np.sqrt(np.mean(floor * floor))) / float(reading.std())


def _how(experiments: Sequence[Experiment], held_out: Sequence[Experiment], crossed: bool) -> str:
    if held_out:
        return f"held-out records: {', '.join(x.name for x in held_out)}"
    if crossed:
        return "each record in turn, with the coefficients fitted to the others"
    last = experiments[0]
    start_s = float(last.time_s[np.argmax(last.held_out)])
    return f"{last.name} from {start_s:.4g} s on, the earlier part fitted"
