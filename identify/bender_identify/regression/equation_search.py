"""The learned equation: supports from sparse regression, each judged and refined by simulation.

Sparse regression proposes; what it proposes is fitted by output error, compared by the information criterion of the
re-simulated readings, and pruned term by term as long as that criterion falls.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_identify.fitting.candidate import Candidate, described, with_offset
from bender_identify.fitting.output_error import Build, OutputFit, fit_output, information
from bender_identify.fitting.resimulation import Bank, search_bank, with_transducer
from bender_identify.records.experiment import Experiment
from bender_identify.regression.rates import Regression, regression_of
from bender_identify.regression.sparse_fit import Ensemble, ensemble_of, least_squares, likely, supports
from bender_identify.regression.terms import equation, scale_of, unit_of
from bender_identify.settings import Settings
from bender_loop.errors import InputError, RunError
from bender_plant.blocks.sparse_equation import bounds, constants, powers_of
from bender_plant.model import Model

Array = NDArray[np.float64]

MOST_TRIED = 3
"""Supports of one library that are simulated, best regression first, beside the whole library."""
ROUNDING = 1e-9
NO_OFFSET = 2.0
INSIGNIFICANT = 3.0
FEWEST_INDEPENDENT = 50.0
EVALUATIONS, MOST_EVALUATIONS = 8, 10
STIFFEST = 5.0
TITLE = "SINDy, refined by simulation"
DEFAULT_THRESHOLD = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """One support fitted by simulation."""

    terms: tuple[str, ...]
    fit: OutputFit


@dataclass(frozen=True, slots=True, eq=False)
class Learned:
    """The learned equation and how it was found.

    Attributes:
        candidate: the model.
        terms: of the equation.
        library: the candidate terms it was chosen from.
        regression: the regression on that library.
        ensemble: its bootstrap, None where none was asked for.
        trials: every support that was simulated.
    """

    candidate: Candidate
    terms: tuple[str, ...]
    library: tuple[str, ...]
    regression: Regression
    ensemble: Ensemble | None
    trials: tuple[Trial, ...]


def silent(text: str) -> None:
    """Show no progress."""
    del text


def learn(
    experiments: Sequence[Experiment],
    base: Model,
    settings: Settings,
    rng: np.random.Generator,
    progress: Callable[[str], None] = silent,
) -> Learned:
    """Learn the equation from the fitted rows.

    Args:
        experiments: records made ready.
        base: gives everything but the material.
        settings: libraries, ensemble.
        rng: draws the resamples.
        progress: told what is being tried.

    Raises:
        InputError: no stretch of the records is long enough for a regression.
        RunError: no equation could be simulated.
    """
    bank = search_bank(experiments, base)
    trials: list[Trial] = []
    found: dict[tuple[str, ...], tuple[Regression, Ensemble | None]] = {}
    for name, terms in _libraries(experiments, settings).items():
        regression = regression_of(terms, experiments, zero_of(experiments), "auto")
        if regression is None:
            names = ", ".join(x.name for x in experiments)
            raise InputError(f"{names}: found no 16 consecutive rows without a gap to learn from; record for longer")
        proposed, ensemble = _proposed(regression, settings, rng)
        found[terms] = regression, ensemble
        for support in _best(regression, proposed):
            chosen = tuple(regression.terms[k] for k in support)
            progress(f"{name}: {len(chosen)} terms")
            trial = _tried(bank, base, chosen, least_squares(regression, support))
            trials += [trial] if trial is not None else []
    if not trials:
        raise RunError("no equation of the library can be simulated over the records; try another --library")
    best = _pruned(bank, base, _least(trials), progress)
    candidate, terms = _settled(best, experiments, base, progress)
    library = next(library for library in found if set(terms) <= set(library))
    return Learned(candidate, terms, library, *found[library], (*trials, best))


def _libraries(experiments: Sequence[Experiment], settings: Settings) -> dict[str, tuple[str, ...]]:
    """Return the libraries to try, without the terms that run with time where a record is untimed."""
    libraries = settings.libraries()
    if all(x.timed for x in experiments):
        return libraries
    kept = {name: tuple(t for t in terms if powers_of(t).rate) for name, terms in libraries.items()}
    if not any(kept.values()):
        raise InputError("--terms: found only terms that run with time, expected some with u' or |u'| for --untimed")
    return {name: terms for name, terms in kept.items() if len(terms) > 1 or len(kept) == 1}


def _proposed(
    regression: Regression, settings: Settings, rng: np.random.Generator
) -> tuple[list[tuple[int, ...]], Ensemble | None]:
    proposed = supports(regression)
    if not settings.ensemble:
        return proposed, None
    ensemble = ensemble_of(regression, settings.ensemble, DEFAULT_THRESHOLD, rng)
    return [*proposed, likely(ensemble)], ensemble


def _settled(
    best: Trial, experiments: Sequence[Experiment], base: Model, progress: Callable[[str], None]
) -> tuple[Candidate, tuple[str, ...]]:
    """Refine by the whole model, and drop what is insignificant there as long as the criterion falls."""
    terms = best.terms
    progress(f"refine {len(terms)} terms")
    candidate = equation_of(terms, best.fit.values, experiments, base)
    while len(terms) > 1:
        fit = candidate.fit
        sizes = np.abs(fit.values) / np.sqrt(np.maximum(np.diag(fit.covariance)[:-1], 1e-300))
        least = int(np.argmin(sizes))
        if sizes[least] > INSIGNIFICANT:
            break
        fewer = tuple(term for k, term in enumerate(terms) if k != least)
        progress(f"refine without {terms[least]}")
        other = equation_of(fewer, np.delete(fit.values, least), experiments, base)
        if _criterion(other.fit, fit.correlation_rows) >= _criterion(fit, fit.correlation_rows):
            break
        candidate, terms = other, fewer
    return candidate, terms


def zero_of(experiments: Sequence[Experiment]) -> float:
    """Return the reading at rest under 0 V: the first one where the record starts there, else by a straight line."""
    first = experiments[0]
    seen = np.flatnonzero(np.isfinite(first.measured_um))
    _, offset = np.polyfit(first.acting_V[seen], first.measured_um[seen], 1)
    at_rest = not first.in_motion and seen[0] == 0
    noisy = abs(first.measured_um[0] - offset) < 4.0 * first.excitation.noise_um
    return float(first.measured_um[0]) if at_rest and not noisy else float(offset)


def equation_of(terms: tuple[str, ...], start: Array, experiments: Sequence[Experiment], base: Model) -> Candidate:
    """Fit the coefficients of an equation by the whole simulated model, from a good start.

    An offset within its own uncertainty is taken for zero.
    """
    bank = Bank(experiments)
    build, scales = _build(base, terms, experiments), _scales(bank, terms)
    fit = fit_output(bank, build, start, scales, EVALUATIONS)
    if abs(fit.offset_um) < NO_OFFSET * np.sqrt(fit.covariance[-1, -1]):
        fit = fit_output(bank, build, fit.values, scales, EVALUATIONS, free_offset=False)
    return Candidate(
        id="sindy",
        title=TITLE,
        equation=equation(terms, fit.values.tolist()),
        model=with_offset(build(fit.values), fit.offset_um),
        coefficients=described(terms, [unit_of(term) for term in terms], fit),
        parameters=len(terms) + int(fit.covariance[-1, -1] > 0.0),
        fit=fit,
        refit=lambda others: equation_of(terms, fit.values, others, base),
    )


def _build(base: Model, terms: tuple[str, ...], experiments: Sequence[Experiment]) -> Build:
    """Return the making of models; it refuses equations that relax many times within a row of the records."""
    w_um = max(float(np.ptp(x.measured_um[np.isfinite(x.measured_um)])) for x in experiments)
    u_V = max(float(np.abs(x.acting_V).max()) for x in experiments)
    row_s = max(float(np.median(np.diff(x.time_s))) for x in experiments)
    row_V = max(float(np.quantile(np.abs(np.diff(x.acting_V)), 0.9)) for x in experiments)

    def build(values: Array) -> Model:
        model = with_transducer(base, "sparse_equation", terms=terms, coefficients=tuple(map(float, values)))
        numbers = constants(next(s.parameters for s in model.blocks if s.id == "sparse_equation"), None)
        if not bounds(w_um, u_V, row_s, row_V, numbers)[1] < STIFFEST:
            raise ValueError("the equation relaxes much faster than the rows follow each other")
        return model

    return build


def _scales(bank: Bank, terms: Sequence[str]) -> Array:
    measured = bank.fitted(bank.measured())
    voltage = bank.fitted([x.acting_V for x in bank.experiments])
    first = bank.experiments[0]
    duration = float(first.time_s[-1] - first.time_s[0]) / max(first.excitation.turns, 1)
    w_um, u_V = float(measured.std()), float(np.sqrt(np.mean(voltage * voltage)))
    return np.array([scale_of(term, w_um, u_V, duration / np.pi) for term in terms])


def _best(regression: Regression, proposed: Sequence[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """Return the supports worth simulating: those of the least criterion in the regression, and the whole library."""
    whole = tuple(range(len(regression.terms)))
    count = len(regression.rates)

    def criterion(support: tuple[int, ...]) -> float:
        columns = regression.library[:, support]
        error = regression.rates - columns @ np.linalg.lstsq(columns, regression.rates, rcond=None)[0]
        return information(float(error @ error), count, len(support), regression.block_rows, ROUNDING)

    ranked = sorted({s for s in proposed if s} - {whole}, key=lambda s: (criterion(s), s))
    return [*ranked[:MOST_TRIED], whole]


def _tried(bank: Bank, base: Model, terms: tuple[str, ...], start: Array) -> Trial | None:
    """Fit a support by simulation, None where what the regression found cannot be simulated."""
    try:
        fit = _roughly(bank, base, terms, start)
    except ValueError:
        return None
    return Trial(terms, fit)


def _least(trials: Sequence[Trial]) -> Trial:
    """Return the trial of least criterion, the readings counted as often as the closest fit leaves them independent."""
    closest = min((trial.fit for trial in trials), key=lambda fit: float(fit.residual_um @ fit.residual_um))
    rows = min(closest.correlation_rows, len(closest.residual_um) / FEWEST_INDEPENDENT)
    return min(trials, key=lambda trial: _criterion(trial.fit, rows))


def _roughly(bank: Bank, base: Model, terms: tuple[str, ...], start: Array) -> OutputFit:
    build = _build(base, terms, bank.experiments)
    return fit_output(bank, build, start, _scales(bank, terms), MOST_EVALUATIONS, rough=True)


def _criterion(fit: OutputFit, rows: float) -> float:
    size_um = float(np.std(fit.output_um + fit.residual_um))
    rss = float(fit.residual_um @ fit.residual_um)
    return information(rss, len(fit.residual_um), len(fit.values), max(rows, 1.0), ROUNDING * size_um)


def _pruned(bank: Bank, base: Model, trial: Trial, progress: Callable[[str], None]) -> Trial:
    """Drop the least significant term as long as the criterion falls."""
    while len(trial.terms) > 1:
        rows = trial.fit.correlation_rows
        std = np.sqrt(np.maximum(np.diag(trial.fit.covariance)[:-1], 1e-300))
        least = int(np.argmin(np.abs(trial.fit.values) / std))
        fewer = tuple(term for k, term in enumerate(trial.terms) if k != least)
        progress(f"without {trial.terms[least]}")
        try:
            fit = _roughly(bank, base, fewer, np.delete(trial.fit.values, least))
        except ValueError:
            break
        if _criterion(fit, rows) >= _criterion(trial.fit, rows):
            break
        trial = Trial(fewer, fit)
    return trial
