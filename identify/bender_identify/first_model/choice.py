"""Which structure the records support: by what it simulates of blocks that its fit has not seen.

Every structure is fitted to two thirds of the blocks of an excerpt and judged on the third, three times over, so that
every block is judged once. Of the structures, the simplest is taken that is within one standard error of the best
(Breiman and others, Classification and Regression Trees, 1984, section 3.4.3): the standard error of the difference
between the two, block by block. What stays in all blocks alike, however slowly it moves, counts as evidence that way.

A further order may imitate what is not linear. So a loop without time and one nonlinear part at a time are tried beside
the simple structures, see `loop_rival` and `rivals`: where one of them simulates unseen blocks better than the best
structure, the simple one beside it is written, and the part is said. Times that a loop explains are shortened. They are
judged on the same blocks as the structures, all of them: the one figure of a structure is the one in the table.
"""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np
from threadpoolctl import threadpool_limits

from bender_identify.first_model.excerpt import excerpts
from bender_identify.first_model.fit import Array, FirstFit, FitTask, Mask, evaluated, fitted, with_deviations
from bender_identify.first_model.loop_rival import Fold, LoopRival, behind_leaning_plays, loop_rival, without_plays
from bender_identify.first_model.rivals import Rival, best_rival, refitted
from bender_identify.first_model.start_values import starts
from bender_identify.first_model.structures import STRUCTURES, Structure
from bender_identify.records.experiment import Experiment
from bender_plant.model import Model

BLOCKS = 18
FOLDS = 3
STARTS = 2
WHITE_LAGS, WHITE_PROBABILITY = 20, 0.95
MOST_IN_VAIN = 2
"""Orders in turn that bring nothing; one alone may, where two modes show only together."""
AS_GOOD, MOST_WORSE = 1.02, 1.05
"""How much more a simpler structure may leave in any case, and at most, whatever the standard error."""
BEHIND_A_LOOP = 0.5
"""Of the mean square of most blocks that a structure leaves without the loop: with it, no more."""
ROUGH_EVALUATIONS, REFINED_EVALUATIONS = 25, 8

Tell = Callable[[str], None]


@dataclass(frozen=True, slots=True, eq=False)
class Losses:
    """What something leaves on blocks that its fit has not seen.

    Attributes:
        losses: (blocks,) mean square of the residual on every block.
        weights: (blocks,) rows of every block over all of them.
    """

    losses: Array
    weights: Array

    @property
    def held_out_rms(self) -> float:
        """The rms of all rows, each by a fit that has not seen its block."""
        return math.sqrt(float(self.weights @ self.losses))


@dataclass(frozen=True, slots=True, eq=False)
class Scored:
    """A structure with what it leaves.

    Attributes:
        fits: to the rows of every fold.
        rms: on all rows of the excerpt, by the first of them.
        left: on unseen blocks.
    """

    fits: tuple[FirstFit, ...]
    rms: float
    left: Losses

    @property
    def fit(self) -> FirstFit:
        """The fit to the rows of the first fold."""
        return self.fits[0]

    @property
    def held_out_rms(self) -> float:
        """The rms of all rows, each by a fit that has not seen its block."""
        return self.left.held_out_rms

    @property
    def numbers(self) -> int:
        """How many numbers the structure has beside gain and offsets."""
        return len(self.fit.structure.names)


@dataclass(frozen=True, slots=True, eq=False)
class FirstModel:
    """The first model of records.

    Attributes:
        chosen: the supported structure, fitted to all rows, with standard deviations.
        scores: every structure that was tried, simple ones first.
        selected: the entry of `scores` with the chosen structure.
        task: the records that it was fitted to.
        loop: plays that simulate unseen blocks better than every structure, with what is chosen beside them.
        loop_rms: what they leave on unseen blocks.
        rival: a nonlinear part that simulates unseen blocks better than every structure, and the structure beside it.
        rival_rms: what it leaves on unseen blocks.
    """

    chosen: FirstFit
    scores: tuple[Scored, ...]
    selected: Scored
    task: FitTask
    loop: LoopRival | None = None
    loop_rms: float = math.nan
    rival: Rival | None = None
    rival_rms: float = math.nan

    @property
    def best(self) -> Scored:
        """The structure that leaves least on unseen blocks."""
        return _best_of(self.scores)

    def model(self, name: str) -> Model:
        """Return the chosen model, which says of which records it is and of when."""
        fit, records = self.chosen, self.task.experiments
        fitted = f"fitted to {', '.join(x.name for x in records)} on {datetime.now(UTC):%Y-%m-%d}"
        found = fit.structure.model(fit.values, fit.gain, fit.offsets[0], name)
        return replace(found, description=f"{found.description}; {fitted}")


def blocks_of(task: FitTask) -> list[tuple[int, slice]]:
    """Return the blocks of all records as (record, rows): equal parts of every record."""
    found = []
    each = max(FOLDS, -(-BLOCKS // len(task.experiments)))
    for k, x in enumerate(task.experiments):
        edges = np.linspace(0, x.time_s.size, each + 1).astype(int)
        found += [(k, slice(int(a), int(b))) for a, b in itertools.pairwise(edges)]
    return found


def row_masks(task: FitTask, fold: int = 0) -> tuple[list[Mask], list[Mask]]:
    """Return the fitted and the held-out rows of every record: every third block is held out."""
    counted = [x.fitted | x.held_out for x in task.experiments]
    held_out = [np.zeros_like(x) for x in counted]
    for number, (k, rows) in enumerate(blocks_of(task)):
        if (number + fold) % FOLDS == FOLDS - 1:
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
    search = FitTask.of(excerpts(experiments), rough=True)
    scores = structures_scored(search, tell, only)
    wanted = [x for x in scores if only is None or x.fit.structure in (only, only.with_delay())]
    selected = select(wanted)
    final_task = FitTask.of(experiments)
    everything = [x.fitted | x.held_out for x in final_task.experiments]
    if any(x.fit.structure == Structure() for x in wanted):
        loop = better_loop(search, scores, wanted, selected.numbers)
        if loop is not None:
            plays, left = loop
            selected = next(x for x in wanted if x.fit.structure == plays.structure)
            beside = evaluated(final_task, plays.structure, plays.values, everything) or selected.fit
            return FirstModel(beside, tuple(scores), selected, final_task, plays, left.held_out_rms)
    rival, rival_rms = None, math.nan
    if only is None:
        if tell is not None:
            tell("trying nonlinear parts beside it")
        if (found := _better_rival(search, scores, selected)) is not None:
            rival, rival_rms = found[0], found[1].held_out_rms
            selected = _beside(rival, scores, selected)
    if tell is not None:
        tell(f"fitting {selected.fit.structure.name} to all rows")
    final = fitted(final_task, selected.fit.structure, selected.fit.values, everything) or selected.fit
    chosen = with_deviations(final_task, final, everything)
    return FirstModel(chosen, tuple(scores), selected, final_task, rival=rival, rival_rms=rival_rms)


def structures_scored(task: FitTask, tell: Tell | None = None, only: Structure | None = None) -> list[Scored]:
    """Return a fit of every structure with what it leaves on unseen blocks, simple ones first.

    They end where one leaves nothing but white noise, and with the second order in turn that simulates unseen blocks no
    better than those before: where something leaves more that is not linear, no order does.

    Raises:
        ArithmeticError: no structure can be simulated over the records.
    """
    scores: list[Scored] = []
    in_vain = 0
    seen, _ = row_masks(task)
    for order in sorted({x.order for x in _in_order(only)}):
        simpler = list(scores)
        known = [x.fit for x in simpler]
        for delayed in (False, True):
            same = [x for x in _in_order(only) if x.order == order and x.delay == delayed]
            if tell is not None and same:
                tell("fitting " + ", ".join(x.name for x in same))
            beside = [*known, *(x.fit for x in scores[len(simpler) :])]
            found = [_scored(task, x, beside) for x in same]
            scores += [x for x in found if x is not None]
        # one order more than the first that leaves white noise: a part of it may hide in the noise
        if only is None and any(_leaves_white_noise(x, seen) for x in known):
            break
        in_vain = in_vain + 1 if simpler and not _is_any_better(simpler, scores[len(simpler) :]) else 0
        if only is None and in_vain == MOST_IN_VAIN:
            break
    if not scores:
        raise ArithmeticError("no first model can be simulated over the records")
    return scores


def select(scores: Sequence[Scored]) -> Scored:
    """Return the simplest entry within one standard error of the best one on unseen blocks."""
    return scores[_simplest([(x.numbers, x.left) for x in scores])]


def _simplest(judged: Sequence[tuple[int, Losses]]) -> int:
    """Return which of these, each with how many numbers it has, is the simplest that is as good as the best."""
    best = min(range(len(judged)), key=lambda k: judged[k][1].held_out_rms)
    most, least = judged[best]
    as_good = [
        k
        for k, (numbers, left) in enumerate(judged)
        if numbers < most
        and (
            left.held_out_rms <= AS_GOOD * least.held_out_rms
            or (not is_better(left, least) and left.held_out_rms <= MOST_WORSE * least.held_out_rms)
        )
    ]
    return min(as_good, key=lambda k: (judged[k][0], judged[k][1].held_out_rms), default=best)


def _best_of(scores: Sequence[Scored]) -> Scored:
    return min(scores, key=lambda x: x.held_out_rms)


def is_better(simple: Losses, rich: Losses) -> bool:
    """Return whether the second leaves less on unseen blocks, by more than a standard error of the difference."""
    return losses_differ(simple.losses, rich.losses, rich.weights)


def losses_differ(simple: Array, rich: Array, weights: Array) -> bool:
    """Return whether mean squares (blocks,) fall by more than a standard error of the difference."""
    shares = weights * weights.size
    fall = shares * (simple - rich)
    return bool(fall.mean() > fall.std(ddof=1) / math.sqrt(fall.size))


def _is_any_better(simpler: Sequence[Scored], others: Sequence[Scored]) -> bool:
    best = _best_of(simpler)
    return any(is_better(best.left, x.left) and AS_GOOD * x.held_out_rms < best.held_out_rms for x in others)


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
        found = fitted(task, structure, start, masks, ROUGH_EVALUATIONS)
        if found is not None and (best is None or found.square(masks) < best.square(masks)):
            best = found
    return best


def _scored(task: FitTask, structure: Structure, simpler: Sequence[FirstFit]) -> Scored | None:
    """Return a structure fitted to every fold in turn, None where it cannot be simulated."""
    first = _best(task, structure, simpler, row_masks(task)[0])
    if first is None:
        return None
    fits = [first]
    for fold in range(1, FOLDS):
        again = fitted(task, structure, first.values, row_masks(task, fold)[0], REFINED_EVALUATIONS)
        if again is None:
            return None
        fits.append(again)
    every = [x.fitted | x.held_out for x in task.experiments]
    rms = math.sqrt(first.square(every) / max(sum(int(m.sum()) for m in every), 1))
    return Scored(tuple(fits), rms, _losses(task, _unseen(task, [x.residuals for x in fits])))


def _unseen(task: FitTask, residuals: Sequence[Sequence[Array]]) -> list[Array]:
    """Return the residual of every row by the fold that has not seen it, NaN where a row is judged by none."""
    found = [np.full(x.time_s.size, np.nan) for x in task.experiments]
    for fold, of_fold in enumerate(residuals):
        _, judged = row_masks(task, fold)
        found = [np.where(j, r, known) for known, r, j in zip(found, of_fold, judged, strict=True)]
    return found


def _losses(task: FitTask, residuals: Sequence[Array]) -> Losses:
    return Losses(*block_losses(task, residuals))


def block_losses(task: FitTask, residuals: Sequence[Array]) -> tuple[Array, Array]:
    """Return the mean square of a residual on every block that has rows, and their parts of all rows (blocks,)."""
    squares, counts = [], []
    for k, rows in blocks_of(task):
        left = residuals[k][rows]
        left = left[np.isfinite(left)]
        if left.size:
            squares.append(float(np.mean(left**2)))
            counts.append(left.size)
    return np.array(squares), np.array(counts) / sum(counts)


def better_loop(
    task: FitTask, scores: Sequence[Scored], wanted: Sequence[Scored], most_numbers: int
) -> tuple[LoopRival, Losses] | None:
    """Return plays that simulate unseen blocks better than every structure, before the simplest that serves as well.

    Args:
        task: the records.
        scores: what plays are compared with.
        wanted: what may stand behind them.
        most_numbers: of a structure behind plays that do not lean: a linear fit shows no more.
    """
    folds: list[Fold] = [row_masks(task, k) for k in range(FOLDS)]
    few = [x for x in wanted if x.numbers <= most_numbers]
    tried = [loop_rival(task, folds, x.fit.structure, [y.values for y in x.fits]) for x in few]
    known = [x for x in tried if x is not None]
    found = _simplest_loop(task, known)
    if found is None or not is_better(_best_of(scores).left, found[1]):
        return None
    simple = [x.fit.structure for x in wanted if x.fit.structure.lags + x.fit.structure.modes <= 1]
    leaning = [behind_leaning_plays(task, folds, x, known) for x in simple]
    better = _simplest_loop(task, [x for x in leaning if x is not None])
    best = better if better is not None and is_better(found[1], better[1]) else found
    plain = without_plays(task, folds, best[0])
    return best if plain is None or _is_less_in_most_blocks(_losses(task, plain), best[1]) else None


def _is_less_in_most_blocks(simple: Losses, rich: Losses) -> bool:
    """Return whether the second leaves clearly less in most blocks: what only takes up the beginning does not."""
    return bool(np.median(rich.losses / np.maximum(simple.losses, 1e-300)) < BEHIND_A_LOOP)


def _simplest_loop(task: FitTask, loops: Sequence[LoopRival]) -> tuple[LoopRival, Losses] | None:
    judged = [(x, _losses(task, x.residuals)) for x in loops]
    return judged[_simplest([(len(x.values), y) for x, y in judged])] if judged else None


def _better_rival(task: FitTask, scores: Sequence[Scored], selected: Scored) -> tuple[Rival, Losses] | None:
    """Return the best nonlinear part beside a simple structure where it simulates unseen blocks better than any order.

    The first fold chooses it; the others only say what it leaves there.
    """
    seen, held_out = row_masks(task)
    best = _best_of(scores)
    bases = {x.fit.structure: x.fit for x in scores if x.fit.structure.order <= max(selected.fit.structure.order, 2)}
    rival = best_rival(task, list(bases.values()), selected.fit, seen, held_out)
    if rival is None:
        return None
    again = [refitted(task, rival, *row_masks(task, fold)) for fold in range(1, FOLDS)]
    residuals = [rival.residuals, *(x.residuals for x in again if x is not None)]
    if len(residuals) < FOLDS:
        return None
    left = _losses(task, _unseen(task, residuals))
    better = is_better(best.left, left) and AS_GOOD * left.held_out_rms < best.held_out_rms
    return (rival, left) if better else None


def _beside(rival: Rival, scores: Sequence[Scored], selected: Scored) -> Scored:
    """Return the structure beside a nonlinear part where it is simpler than the selected one."""
    simplest = min(scores, key=lambda x: x.numbers)
    # a structure that no linear fit shows is not among them
    found = next((x for x in scores if x.fit.structure == rival.structure and not rival.hidden), simplest)
    return found if found.numbers < selected.numbers else selected
