"""One nonlinear part beside a simple structure, as the rival of a further order.

A cubic spring shifts a resonance as the amplitude changes, and a second mode close by imitates it; friction looks like
a lag, a fold hides any structure. Each part is tried at a few sizes, relative to the span of the input and of the
motion, and fitted together with the numbers of the structure. Which part it is, `bender diagnose` decides: here it only
keeps the linear structure from standing in for it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bender_identify.first_model.fit import Array, FirstFit, FitTask, Mask, from_search, solved, to_search
from bender_identify.first_model.start_values import time_constants_s
from bender_identify.first_model.structures import Structure
from bender_plant.parameter import ModelError

REFINED, EVALUATIONS, HARDLY_MORE, AS_GOOD = 3, 15, 1.1, 1.05
SIMPLE_ORDER = 2
HIDDEN_BELOW = 0.3
"""Share of the variance that a linear structure explains below which its times may be hidden by an even curve."""

EVEN, HIDDEN_MODES = "fold", 12

Sizes = dict[str, float]


@dataclass(frozen=True, slots=True)
class Part:
    """A nonlinear part: its block, how many of its numbers are free, and a start."""

    effect: str
    free: Sizes
    fixed: dict[str, Any]


@dataclass(frozen=True, slots=True, eq=False)
class Rival:
    """A structure with a nonlinear part, fitted to the fitted rows.

    Attributes:
        effect: id of the part's block.
        structure: beside it.
        values: the numbers of the structure.
        part: the numbers of the block.
        fixed: those of them that are not fitted.
        held_out_rms: what it leaves on held-out rows, in the unit of the readings.
        residuals: (n,) for every record, NaN where a row is not held out.
        hidden: no linear fit shows the structure.
    """

    effect: str
    structure: Structure
    values: tuple[float, ...]
    part: dict[str, Any]
    fixed: dict[str, Any]
    held_out_rms: float
    residuals: tuple[Array, ...]
    hidden: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class _Try:
    structure: Structure
    values: tuple[float, ...]
    part: Part
    square: float
    hidden: bool = False


def best_rival(
    task: FitTask, bases: Sequence[FirstFit], selected: FirstFit, seen: Sequence[Mask], held_out: Sequence[Mask]
) -> Rival | None:
    """Return the nonlinear part and structure that leave least on held-out rows; None where none can be simulated.

    Args:
        task: the records.
        bases: fits of the structures that a part may stand beside.
        selected: the fit whose explained variance tells whether the structure may be hidden.
        seen: rows that are fitted, for every record.
        held_out: rows that the fits are judged on.
    """
    hidden = _explained(task, selected, seen) < HIDDEN_BELOW
    wanted = [(x.structure, x.values) for x in bases]
    found = [_scanned(task, *x, seen) for x in wanted]
    if hidden:
        found += [_scanned(task, *x, seen, even=True) for x in _hidden(task)]
    leaders = _leaders([y for x in found for y in x])
    refined = (_refined(task, x, seen, held_out) for x in leaders)
    rivals = [x for x in refined if x is not None]
    least = min((x.held_out_rms for x in rivals), default=0.0)
    near = [x for x in rivals if x.held_out_rms <= AS_GOOD * least]
    return min(near, key=lambda x: (len(x.values), x.held_out_rms), default=None)


def refitted(task: FitTask, rival: Rival, seen: Sequence[Mask], held_out: Sequence[Mask]) -> Rival | None:
    """Return a rival fitted to other rows, from its own numbers on; None where it cannot be simulated there."""
    free = {n: float(x) for n, x in rival.part.items() if n not in rival.fixed}
    part = Part(rival.effect, free, rival.fixed)
    left = _residuals(task, rival.structure, rival.values, rival.effect, rival.part, seen)
    if left is None:
        return None
    start = _Try(rival.structure, rival.values, part, _square(left, seen), rival.hidden)
    return _refined(task, start, seen, held_out)


def _leaders(tried: Sequence[_Try]) -> list[_Try]:
    """Return what is refined.

    The parts that leave least, beside their best structure and the simplest one that leaves hardly more; and every part
    beside its best simple structure, since the numbers of a linear fit may hide what a part does: a spring that
    stiffens has raised the frequency that it is tried with.
    """
    pairs: list[tuple[_Try, _Try]] = []
    for effect in dict.fromkeys(x.part.effect for x in tried):
        same = [x for x in tried if x.part.effect == effect]
        best = min(same, key=lambda x: x.square)
        near = [x for x in same if x.square <= HARDLY_MORE * best.square]
        pairs.append((best, min(near, key=lambda x: (len(x.values), x.square))))
    pairs = sorted(pairs, key=lambda x: x[0].square)
    first = [x for best, simple in pairs[:REFINED] for x in ((best,) if simple is best else (simple, best))]
    simple = [x for x in tried if x.structure.order <= SIMPLE_ORDER]
    effects = dict.fromkeys(x.part.effect for x in simple)
    others = [min((x for x in simple if x.part.effect == name), key=lambda x: x.square) for name in effects]
    return first + [x for x in others if x not in first]


def _explained(task: FitTask, fit: FirstFit, masks: Sequence[Mask]) -> float:
    readings = [x.measured_um[m] for x, m in zip(task.experiments, masks, strict=True)]
    spread = sum(float(np.sum((y - y.mean()) ** 2)) for y in readings if y.size)
    return 1.0 - fit.square(masks) / spread if spread > 0.0 else 1.0


def parts(structure: Structure, span_V: float, half_um: float, row_s: float, duration_s: float) -> Iterator[Part]:
    """Yield nonlinear parts of a few sizes each.

    Args:
        structure: beside which they stand; some act on a mode.
        span_V: largest size of the input.
        half_um: half of the peak-to-peak of what the structure gives at gain 1.
        row_s: time between two rows.
        duration_s: of the longest record.
    """
    yield from _of_the_input(span_V, half_um, row_s, duration_s)
    yield from _of_the_output(half_um)
    if structure.modes:
        yield from _of_a_mode(half_um)


def _of_the_input(span_V: float, half_um: float, row_s: float, duration_s: float) -> Iterator[Part]:
    for x in (0.03, 0.1, 0.3):
        yield Part("dead_zone", {"threshold_V": x * span_V}, {})
    for x in (0.3, 0.6, 1.2):
        yield Part("saturation", {"scale_V": x * span_V}, {})
    for x in (0.3, 3.0):
        for sign in (1.0, -1.0):
            yield Part("electrostriction", {"coefficient_um_per_V2": sign * x * half_um / span_V**2}, {})
    for x in np.geomspace(2.0 * row_s, max(0.05 * duration_s, 4.0 * row_s), 4):
        for force in (1.0, 10.0):
            slip = {"force_um": force * half_um, "slip_V_s": 0.3 * span_V * float(x)}
            yield Part("presliding_friction", slip, {})


def _of_the_output(half_um: float) -> Iterator[Part]:
    for x in (0.3, -0.3, 3.0, -3.0):
        yield Part("output_curve", {"quadratic_1_per_um": x / half_um}, {})
    for x in (0.02, 0.08, 0.2):
        yield Part("backlash", {"half_width_um": x * half_um}, {})
    yield Part("fold", {"centre_um": 0.02 * half_um}, {"share": 1.0})
    for side in ("above", "below"):
        for x in (0.3, 0.7):
            yield Part("output_limit", {"level_um": x * half_um}, {"form": side})


def _of_a_mode(half_um: float) -> Iterator[Part]:
    for x in (0.05, 0.3, -0.05):
        yield Part("stiffening", {"cubic_1_per_um2": x / half_um**2}, {})
    for x in (0.2, 0.8):
        for bends in (2.0, 10.0):
            yield Part("hysteretic_spring", {"share": x, "beta_1_per_um": bends / half_um}, {})
    for x in (0.03, 0.15):
        yield Part("coulomb_friction", {"level_um": x * half_um}, {})
        yield Part("quadratic_drag", {"drag_1_per_um": x / half_um}, {})


def _hidden(task: FitTask) -> Iterator[tuple[Structure, tuple[float, ...]]]:
    """Yield structures whose numbers no linear fit tells: lags, modes, and one of each, all over what rows show."""
    lags = [float(x) for x in time_constants_s(task)]
    low, high = 3.0 / task.duration_s, 0.4 / task.delay_unit_s
    modes = [(float(f), z) for f in np.geomspace(low, max(high, 2.0 * low), HIDDEN_MODES) for z in (0.05, 0.3)]
    yield from ((Structure(lags=1), (tau,)) for tau in lags)
    yield from ((Structure(modes=1), x) for x in modes)
    yield from ((Structure(lags=1, modes=1), (tau, *x)) for tau in lags[::2] for x in modes)


def _scanned(
    task: FitTask, structure: Structure, values: tuple[float, ...], masks: Sequence[Mask], even: bool = False
) -> list[_Try]:
    """Return every part of every size beside a structure, or an even curve alone."""
    plain = task.simulated(structure, values)
    if plain is None:
        return []
    half_um = 0.5 * max(float(np.ptp(y)) for y in plain)
    span_V = max(float(np.max(np.abs(x.acting_V))) for x in task.experiments)
    duration_s = task.duration_s
    if not (half_um > 0.0 and span_V > 0.0):
        return []
    tried = []
    known = list(parts(structure, span_V, half_um, task.delay_unit_s, duration_s))
    for part in (x for x in known if not even or x.effect == EVEN):
        left = _residuals(task, structure, values, part.effect, part.free | part.fixed, masks)
        if left is not None:
            tried.append(_Try(structure, values, part, _square(left, masks), even))
    return tried


def _square(residuals: Sequence[Array], masks: Sequence[Mask]) -> float:
    return float(sum(np.sum(r[m] ** 2) for r, m in zip(residuals, masks, strict=True)))


def _residuals(
    task: FitTask, structure: Structure, values: Sequence[float], effect: str, part: dict[str, Any],
    masks: Sequence[Mask],
) -> list[Array] | None:  # fmt: skip
    """Return the residual (n,) of every record, gain and offsets fitted; None where it cannot be simulated."""
    try:
        readings = task.readings(structure.model(values).with_block(effect, **part))
    except (ModelError, ArithmeticError):
        return None
    gain, offsets = solved(task, readings, masks)
    pairs = zip(readings, task.experiments, offsets, strict=True)
    return [x.measured_um - gain * y - offset for y, x, offset in pairs]


def _refined(task: FitTask, start: _Try, seen: Sequence[Mask], held_out: Sequence[Mask]) -> Rival | None:
    from scipy.optimize import least_squares

    names, sizes = list(start.part.free), np.array(list(start.part.free.values()))
    own = to_search(start.structure, start.values, task)

    def at(point: Array) -> tuple[tuple[float, ...], dict[str, Any]]:
        # sizes move by factors, so that none changes its sign
        part = {n: float(s * np.exp(np.clip(p, -20.0, 20.0))) for n, s, p in zip(names, sizes, point, strict=False)}
        return from_search(start.structure, point[len(names) :], task), part | start.part.fixed

    scale = np.sqrt(max(start.square, 1e-300) / max(sum(int(m.sum()) for m in seen), 1))

    def residual(point: Array) -> Array:
        values, part = at(point)
        left = _residuals(task, start.structure, values, start.part.effect, part, seen)
        if left is None:
            return np.full(sum(int(m.sum()) for m in seen), 1e3)
        return np.concatenate([r[m] for r, m in zip(left, seen, strict=True)]) / scale

    begin = np.concatenate([np.zeros(len(names)), own])
    steps = 1e-4 / np.maximum(1.0, np.abs(begin))
    try:
        point = least_squares(residual, begin, max_nfev=EVALUATIONS, diff_step=steps, x_scale=1.0).x
    except np.linalg.LinAlgError:
        return None
    values, part = at(point)
    left = _residuals(task, start.structure, values, start.part.effect, part, seen)
    if left is None:
        return None
    judged = tuple(np.where(m, r, np.nan) for r, m in zip(left, held_out, strict=True))
    rows = max(sum(int(m.sum()) for m in held_out), 1)
    rms = float(np.sqrt(_square(left, held_out) / rows))
    return Rival(start.part.effect, start.structure, values, part, start.part.fixed, rms, judged, start.hidden)
