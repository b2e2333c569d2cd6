"""The linear candidates of records as plain models, best first: where a search for effects may set out from."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from bender_identify.first_model.choice import Scored, better_loop, row_masks, select, structures_scored
from bender_identify.first_model.course import experiments_of
from bender_identify.first_model.excerpt import excerpts
from bender_identify.first_model.fit import FitTask, Mask, evaluated, solved
from bender_identify.first_model.rivals import best_rival
from bender_identify.first_model.structures import MOST_DAMPING, Structure
from bender_identify.records.experiment import Experiment
from bender_identify.settings import InputHold
from bender_loop.records.record import Record
from bender_plant.blocks import bending_modes
from bender_plant.model import Model

NEARLY = 1.01
LEAST_GAIN = 1e-6
"""Of the spread of the readings over that of what a structure gives: a model needs some gain."""


@dataclass(frozen=True, slots=True, eq=False)
class LinearStructure:
    """A linear candidate.

    Attributes:
        model: gain, lags, modes, delay and offset with their numbers, in the units of the records.
        structure: what it consists of.
        numbers: how many numbers it has beside gain and offset.
        unseen_rms: what it leaves on blocks that its fit has not seen, in the unit of the readings.
        losses: (blocks,) mean square of what it leaves on each of them; the same blocks for every candidate.
        hidden_behind: id of the effect that hides this structure from a linear fit, None where nothing does. Its
            `unseen_rms` is then that of structure and effect together.
        behind_a_loop: it was fitted behind a loop without time, which leads the numbers of all others astray.
    """

    model: Model
    structure: Structure
    numbers: int
    unseen_rms: float
    losses: tuple[float, ...]
    hidden_behind: str | None = None
    behind_a_loop: bool = False

    @property
    def rings(self) -> bool:
        """Whether every mode oscillates; one at the largest damping stands in for two lags."""
        modes = [x.parameters for x in self.model.blocks if isinstance(x.parameters, bending_modes.Parameters)]
        return not any(NEARLY * x.damping_ratio >= MOST_DAMPING for x in modes)


def linear_structures(
    records: Record | Sequence[Record],
    input_hold: InputHold = "hold",
    name: str = "auto",
    names: Sequence[str] = (),
) -> list[LinearStructure]:
    """Return linear models of one or several records of a device, best first.

    The first one is what `bender model fit` would take if nothing nonlinear were likelier: the simplest structure
    within one standard error of the best on unseen blocks. The others follow by what they leave there. Where no linear
    model follows the records, the structure hidden behind an even curve comes last. Where a loop without time hides
    dynamics, so does the structure behind it.

    Args:
        records: of one device, in the same quantities.
        input_hold: what the input does between two rows.
        name: of the models.
        names: of the records, for messages.

    Raises:
        InputError: the input or the reading stands still, or there are too few readings.
        ArithmeticError: no structure can be simulated over the records.
    """
    given = [records] if isinstance(records, Record) else list(records)
    return of_experiments(experiments_of(given, names, input_hold), name)


@threadpool_limits.wrap(limits=1)
def of_experiments(experiments: Sequence[Experiment], name: str = "auto") -> list[LinearStructure]:
    """Return the same of records made ready.

    Raises:
        ArithmeticError: no structure can be simulated over the records.
    """
    task, whole = FitTask.of(excerpts(experiments), rough=True), FitTask.of(experiments, rough=True)
    scores = structures_scored(task)
    selected = select(scores)
    others = sorted((x for x in scores if x is not selected), key=lambda x: x.held_out_rms)
    counted = [x.fitted | x.held_out for x in whole.experiments]
    found = [_candidate(whole, counted, x, name) for x in (selected, *others)]
    alive = [x for x in found if x is not None]
    return [*alive, *_hidden(task, whole, counted, selected, name), *_looped(task, whole, counted, scores, name)]


def _candidate(whole: FitTask, counted: Sequence[Mask], x: Scored, name: str) -> LinearStructure | None:
    fit = evaluated(whole, x.fit.structure, x.fit.values, counted)
    if fit is None:
        return None
    gain = fit.gain or LEAST_GAIN
    model = fit.structure.model(fit.values, gain, fit.offsets[0], name)
    return LinearStructure(model, fit.structure, x.numbers, x.held_out_rms, tuple(x.left.losses.tolist()))


def _hidden(
    task: FitTask, whole: FitTask, counted: Sequence[Mask], selected: Scored, name: str
) -> list[LinearStructure]:
    """Return the structure behind an even curve that simulates unseen blocks better than the selected one, or none."""
    seen, held_out = row_masks(task)
    rival = best_rival(task, [], selected.fit, seen, held_out)
    if rival is None or not rival.held_out_rms < selected.held_out_rms:
        return []
    plain = whole.simulated(rival.structure, rival.values)
    if plain is None:
        return []
    curve = whole.readings(rival.structure.model(rival.values).with_block(rival.effect, **rival.part))
    gain, offsets = solved(whole, curve, counted)
    size = abs(gain) or LEAST_GAIN
    model = rival.structure.model(rival.values, size, 0.0, name)
    model = model.with_block("calibration", gain=-1.0 if gain < 0.0 else 1.0, offset_um=offsets[0])
    losses = tuple(float(np.nanmean(np.square(r))) for r in rival.residuals if np.isfinite(r).any())
    return [LinearStructure(model, rival.structure, len(rival.values), rival.held_out_rms, losses, rival.effect)]


def _looped(
    task: FitTask, whole: FitTask, counted: Sequence[Mask], scores: Sequence[Scored], name: str
) -> list[LinearStructure]:
    """Return the structure behind a loop without time that simulates unseen blocks better than all, or none."""
    if not any(not x.fit.structure.parts for x in scores):
        return []
    found = better_loop(task, scores, scores, select(scores).numbers)
    if found is None or not found[0].structure.names:
        return []
    loop, left = found
    fit = evaluated(whole, loop.structure, loop.values, counted)
    if fit is None:
        return []
    model = loop.structure.model(loop.values, fit.gain or LEAST_GAIN, fit.offsets[0], name)
    losses = tuple(left.losses.tolist())
    return [LinearStructure(model, loop.structure, len(loop.values), left.held_out_rms, losses, behind_a_loop=True)]
