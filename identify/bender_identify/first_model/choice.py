"""Which structure the records support: by a criterion on all rows, and by held-out rows.

A structure with more numbers replaces a simpler one only where both agree:

- Schwarz's criterion, n_eff ln(S / n) + k ln(n_eff), falls by more than the luckiest of the scanned starts may bring
  by chance, 2 ln(starts). n_eff counts the readings that the residual's correlation leaves independent.
- Its fit to two thirds of the blocks simulates the held-out third better: twice the log-likelihood ratio on those
  rows, n_eff ln(S_simple / S_rich), exceeds the 5 % point of chi-squared.

Where a loop without time simulates held-out rows better than every structure, by the same ratio, their phase is no
evidence of lags, modes or a delay. Then its times are shortened as far as the loop explains them, or are dropped.
"""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np
from threadpoolctl import threadpool_limits

from bender_identify.first_model.fit import Array, FirstFit, FitTask, Mask, evaluated, fitted, with_deviations
from bender_identify.first_model.loop_rival import LoopRival, loop_rival, with_times
from bender_identify.first_model.start_values import starts
from bender_identify.first_model.structures import STRUCTURES, Structure
from bender_identify.fitting.correlation import correlation_rows
from bender_identify.records.experiment import Experiment
from bender_plant.model import Model

BLOCKS = 18
HELD_OUT_OF = 3
STARTS, SCANNED = 3, 200
WHITE_LAGS, WHITE_PROBABILITY = 20, 0.95
MOST_IN_VAIN = 2
"""Orders in turn that bring nothing; one alone may, where two modes show only together."""

Tell = Callable[[str], None]


@dataclass(frozen=True, slots=True, eq=False)
class Scored:
    """A structure fitted to the fitted rows, with what it leaves on all rows and on the held-out ones."""

    fit: FirstFit
    rms: float
    held_out_rms: float
    criterion: float


@dataclass(frozen=True, slots=True, eq=False)
class FirstModel:
    """The first model of records.

    Attributes:
        chosen: the supported structure, fitted to all rows, with standard deviations.
        scores: every structure that was tried, simple ones first.
        selected: the entry of `scores` with the chosen structure.
        task: the records that it was fitted to.
        loop: plays that simulate held-out rows better than every structure, with what is chosen beside them.
    """

    chosen: FirstFit
    scores: tuple[Scored, ...]
    selected: Scored
    task: FitTask
    loop: LoopRival | None = None

    def model(self, name: str) -> Model:
        """Return the chosen model, which says of which records it is, of when, and between which commands."""
        fit, records = self.chosen, self.task.experiments
        acting_V = np.concatenate([x.acting_V for x in records])
        fitted = f"fitted to {', '.join(x.name for x in records)} on {datetime.now(UTC):%Y-%m-%d}"
        found = fit.structure.model(fit.values, fit.gain, fit.offsets[0], name)
        return replace(
            found, description=f"{found.description}; {fitted}; commands {acting_V.min():.4g} to {acting_V.max():.4g}"
        )


def blocks_of(task: FitTask) -> list[tuple[int, slice]]:
    """Return the blocks of all records as (record, rows): equal parts of every record."""
    found = []
    for k, x in enumerate(task.experiments):
        edges = np.linspace(0, x.time_s.size, BLOCKS + 1).astype(int)
        found += [(k, slice(int(a), int(b))) for a, b in itertools.pairwise(edges)]
    return found


def row_masks(task: FitTask) -> tuple[list[Mask], list[Mask]]:
    """Return the fitted and the held-out rows of every record: every third block is held out."""
    counted = [x.fitted | x.held_out for x in task.experiments]
    held_out = [np.zeros_like(x) for x in counted]
    for number, (k, rows) in enumerate(blocks_of(task)):
        if number % HELD_OUT_OF == HELD_OUT_OF - 1:
            held_out[k][rows] = counted[k][rows]
    return [c & ~h for c, h in zip(counted, held_out, strict=True)], held_out


# simulations have the cores: threads of linear algebra that wait for one take many times as long as one does
@threadpool_limits.wrap(limits=1)
def first_model(
    experiments: Sequence[Experiment], tell: Tell | None = None, only: Structure | None = None
) -> FirstModel:
    """Return the first model that the records support, or the given structure.

    Args:
        experiments: the records.
        tell: is told what is being fitted.
        only: take this structure, with a delay where the records support one.

    Raises:
        ArithmeticError: no structure can be simulated over the records.
    """
    search, final_task = FitTask.of(experiments, rough=True), FitTask.of(experiments)
    seen, held_out = row_masks(search)
    everything = [a | b for a, b in zip(seen, held_out, strict=True)]
    fits = _fits(search, seen, held_out, tell, only)
    if not fits:
        raise ArithmeticError("no first model can be simulated over the records")
    independent = _independent_rows(min(fits, key=lambda x: x.square(seen)), seen)
    scores = [_scored(x, seen, held_out, independent) for x in fits]
    wanted = [x for x in scores if only is None or x.fit.structure in (only, only.with_delay())]
    selected = select(wanted, independent)
    loop = None
    if any(x.fit.structure == Structure() for x in wanted):
        loop = _better_loop(search, seen, held_out, scores, selected, independent)
    if loop is not None:
        selected = next(x for x in wanted if x.fit.structure == loop.structure)
        beside = evaluated(final_task, loop.structure, loop.values, everything) or selected.fit
        return FirstModel(beside, tuple(scores), selected, final_task, loop)
    if tell is not None:
        tell(f"fitting {selected.fit.structure.name} to all rows")
    final = fitted(final_task, selected.fit.structure, selected.fit.values, everything) or selected.fit
    return FirstModel(with_deviations(final_task, final, everything), tuple(scores), selected, final_task, loop)


def select(scores: Sequence[Scored], independent: float) -> Scored:
    """Return the entry that the criterion favours, or the simplest that simulates held-out blocks as well as it."""
    lucky = 2.0 * math.log(SCANNED)
    best = min(scores, key=lambda x: x.criterion + lucky * x.fit.structure.parts)
    simpler = [x for x in scores if x.fit.structure.parts < best.fit.structure.parts]
    as_good = [x for x in simpler if not _predicts_better(x, best, independent)]
    return min(as_good, key=lambda x: (x.fit.structure.parts, x.criterion), default=best)


def _fits(
    task: FitTask, seen: Sequence[Mask], held_out: Sequence[Mask], tell: Tell | None, only: Structure | None
) -> list[FirstFit]:
    """Return a fit of every structure, simple ones first, until one leaves nothing but white noise.

    Where something leaves more that is not linear, no order does: they end with the second one in turn that simulates
    held-out blocks no better than those before.
    """
    fits: list[FirstFit] = []
    in_vain = 0
    for order in sorted({x.order for x in _in_order(only)}):
        simpler = list(fits)
        for structure in (x for x in _in_order(only) if x.order == order):
            if tell is not None:
                tell(f"fitting {structure.name}")
            best = _best(task, structure, fits, seen)
            fits += [best] if best is not None else []
        # one order more than the first that leaves white noise: a part of it may hide in the noise
        if only is None and any(_leaves_white_noise(x, seen) for x in fits if x.structure.order < order):
            break
        in_vain = in_vain + 1 if simpler and not _is_better(simpler, fits[len(simpler) :], seen, held_out) else 0
        if only is None and in_vain == MOST_IN_VAIN:
            break
    return fits


def _is_better(
    simpler: Sequence[FirstFit], others: Sequence[FirstFit], seen: Sequence[Mask], held_out: Sequence[Mask]
) -> bool:
    """Return whether one of some fits simulates held-out blocks better than the best simpler one."""
    independent = _independent_rows(min((*simpler, *others), key=lambda x: x.square(seen)), seen)
    known, new = ([_scored(x, seen, held_out, independent) for x in some] for some in (simpler, others))
    best = min(known, key=lambda x: x.held_out_rms)
    return any(_predicts_better(best, x, independent) for x in new)


def _leaves_white_noise(fit: FirstFit, masks: Sequence[Mask]) -> bool:
    """Return whether no autocorrelation of the residual within the longest lag is more than chance (Box and Pierce)."""
    from scipy.stats import chi2

    statistic, count = 0.0, 0
    for r, m in zip(fit.residuals, masks, strict=True):
        values = np.where(m, r, 0.0)
        values = np.where(m, values - values[m].mean(), 0.0) if m.any() else values
        power = float(values @ values)
        if power == 0.0:
            continue
        for lag in range(1, WHITE_LAGS + 1):
            pairs = int(np.sum(m[lag:] & m[:-lag]))
            rho = float(values[lag:] @ values[:-lag]) / power * (int(m.sum()) / max(pairs, 1))
            statistic += pairs * rho * rho
            count += 1
    return count > 0 and statistic < float(chi2.ppf(WHITE_PROBABILITY, count))


def _in_order(only: Structure | None) -> list[Structure]:
    wanted = [x for x in STRUCTURES if only is None or (x.lags <= only.lags and x.modes <= only.modes)]
    return [y for x in wanted for y in (x, x.with_delay())]


def _best(task: FitTask, structure: Structure, fits: Sequence[FirstFit], masks: Sequence[Mask]) -> FirstFit | None:
    best: FirstFit | None = None
    for start in starts(task, structure, fits, masks, STARTS):
        found = fitted(task, structure, start, masks)
        if found is not None and (best is None or found.square(masks) < best.square(masks)):
            best = found
    return best


def _rows(masks: Sequence[Mask]) -> int:
    return max(sum(int(m.sum()) for m in masks), 1)


def _independent_rows(fit: FirstFit, masks: Sequence[Mask]) -> float:
    pieces: list[Array] = [r[m] for r, m in zip(fit.residuals, masks, strict=True)]
    return float(sum(x.size / correlation_rows(x) for x in pieces if x.size))


def _scored(fit: FirstFit, seen: Sequence[Mask], held_out: Sequence[Mask], independent: float) -> Scored:
    mean_square = max(fit.square(seen) / _rows(seen), 1e-300)
    count = len(fit.structure.names) + 1 + len(fit.offsets)
    criterion = independent * math.log(mean_square) + count * math.log(max(independent, 2.0))
    every = [a | b for a, b in zip(seen, held_out, strict=True)]
    rms = math.sqrt(fit.square(every) / _rows(every))
    return Scored(fit, rms, math.sqrt(fit.square(held_out) / _rows(held_out)), criterion)


def _better_loop(
    task: FitTask,
    seen: Sequence[Mask],
    held_out: Sequence[Mask],
    scores: Sequence[Scored],
    selected: Scored,
    independent: float,
) -> LoopRival | None:
    """Return the loop where it simulates held-out rows better than every structure, with the times that are left."""
    loop = loop_rival(task, seen, held_out)
    best = min(scores, key=lambda x: x.held_out_rms)
    if loop is None:
        return None
    more = loop.numbers - len(best.fit.structure.names) - 1
    if not _is_shown(best.held_out_rms, loop.held_out_rms, more, independent):
        return None

    def is_better(one: LoopRival, other: LoopRival) -> bool:
        return _is_shown(one.held_out_rms, other.held_out_rms, other.numbers - one.numbers, independent)

    return with_times(task, seen, held_out, loop, selected.fit.structure, selected.fit.values, is_better)


def _predicts_better(simple: Scored, rich: Scored, independent: float) -> bool:
    """Return whether held-out rows favour the second."""
    more = len(rich.fit.structure.names) - len(simple.fit.structure.names)
    return _is_shown(simple.held_out_rms, rich.held_out_rms, more, independent)


def _is_shown(simple_rms: float, rich_rms: float, more: int, independent: float) -> bool:
    """Return whether twice the log-likelihood ratio of held-out rows exceeds its 5 % point for so many more numbers."""
    from scipy.stats import chi2

    ratio = max(simple_rms, 1e-150) / max(rich_rms, 1e-150)
    return independent / (HELD_OUT_OF - 1.0) * 2.0 * math.log(ratio) > float(chi2.ppf(0.95, max(more, 1)))
