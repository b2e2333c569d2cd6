"""Effects of the catalogue as small changes of a model: what each would add to the reading, sized to be seen.

The sensitivity of a reading to an effect is the difference that a small size of it makes. Many effects have no
derivative where they vanish (a threshold, a play), so the size is one whose difference is a few times the noise.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from bender_compiled.stream import Stream
from bender_effects.catalogue import EFFECTS, Sizes, forms
from bender_effects.form import Form, Free
from bender_effects.rigs import is_piezo_bender
from bender_plant.model import Model, ModelError
from bender_plant.plant import effective_settings

Array = NDArray[np.float64]

COARSER = 32.0
"""Sub-steps of signatures are longer: what they miss is missed beside the effect and with it."""
TARGET, LEAST = 3.0, 0.5
"""Of the noise: rms that a candidate's difference aims at, and less than which it is not seen at all."""
MOST_NUMBERS, STARTS, TRIES = 3, 3, 10
NEAR_ENOUGH = math.log(1.5)
"""Of the logarithm of a size: a signature far larger than a change has another shape."""
SMALLEST = 1e-6
"""Part of the range of a number: where its effect begins to be looked for."""
NOT_TRIED = ("surroundings", "calibration")
"""Stages whose effects show as level, gain, colour or variance."""
WITHOUT_MODES_Hz = 100.0


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A small effect in a model.

    Attributes:
        effect: id.
        model: with it.
        one_sided: it has one sign only, and is in proportion to its size.
        grows_only: it is there or not, with one sign only.
        added_um: (n,) what it adds on the rows that it was sized on.
    """

    effect: str
    model: Model
    one_sided: bool
    grows_only: bool
    added_um: Array


def candidates(
    base: Model, time_s: Array, voltage_V: Array, readings_um: Array, noise_um: float, *, linear: bool
) -> list[Candidate]:
    """Return the effects that the rows would show, each at a size of a few times the noise.

    Args:
        base: the model.
        time_s: (n,) of the rows.
        voltage_V: (n,) commands.
        readings_um: (n,) expected ones.
        noise_um: deviation of the noise.
        linear: the command runs straight from row to row.
    """
    rows = _Rows(base, time_s, voltage_V, linear)
    found = []
    for form in _forms(base, time_s, voltage_V, readings_um):
        for others in _others(form):
            sized = _sized(rows, form, others, noise_um)
            if sized is not None:
                found.append(sized)
    return found


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    base: Model
    time_s: Array
    voltage_V: Array
    linear: bool

    def added_um(self, model: Model) -> Array | None:
        """Return what a model reads beyond the base (n,), None where it cannot be simulated."""
        try:
            stream = Stream((self.base, model), self.linear, COARSER)
            own, other = stream.advance(self.time_s, self.voltage_V)
        except (ArithmeticError, ModelError, ValueError):
            return None
        return other - own


def _forms(base: Model, time_s: Array, voltage_V: Array, readings_um: Array) -> Iterator[Form]:
    modes = next((x for x in effective_settings(base) if x[0].id == "bending_modes"), None)
    numbers = modes[0].constants(modes[1], base.beam)[0] if modes else (2.0 * math.pi * WITHOUT_MODES_Hz, 0.0)
    sizes = Sizes(
        span_V=max(float(np.max(np.abs(voltage_V))), 1e-9),
        stroke_um=max(float(np.ptp(readings_um)), 1e-9),
        duration_s=float(time_s[-1] - time_s[0]),
        first_Hz=numbers[0] / (2.0 * math.pi),
        piezo_bender=is_piezo_bender(base),
        highest_Hz=0.5 / float(np.median(np.diff(time_s))),
        damping_ratio=numbers[1],
    )
    present = {x.id for x in base.blocks} - {"bending_modes", "calibration"}
    for form in forms(sizes):
        few = len(form.free) <= MOST_NUMBERS and sum(x.solved for x in form.free) <= 1 and not form.refines
        if few and form.effect not in present and EFFECTS[form.effect].stage not in NOT_TRIED:
            yield form


def _size(form: Form) -> int:
    """Return the place of the number that says how large the effect is."""
    for k, free in enumerate(form.free):
        if free.solved:
            return k
    return next((k for k, free in enumerate(form.free) if free.vanishes_at is not None), 0)


def _others(form: Form) -> Iterator[tuple[float, ...]]:
    """Yield values of the other numbers: a few of their starts."""
    own = _size(form)
    choices = []
    for k, free in enumerate(form.free):
        if k != own:
            starts = free.starts or (0.5 * (free.low + free.high),)
            places = sorted({0, len(starts) // 2, len(starts) - 1})[:STARTS]
            choices.append([starts[x] for x in places])
    yield from product(*choices)


def _sized(rows: _Rows, form: Form, others: tuple[float, ...], noise_um: float) -> Candidate | None:
    place = _size(form)
    free = form.free[place]

    def made(value: float) -> _Made | None:
        try:
            model = form.apply(rows.base, (*others[:place], value, *others[place:]))
        except (ModelError, ValueError, ArithmeticError):
            return None
        added = rows.added_um(model)
        return None if added is None else (model, added, float(np.sqrt(np.mean(added**2))))

    found = _search(made, free, TARGET * noise_um)
    if found is None or found[2] < LEAST * noise_um:
        return None
    inside = free.vanishes_at is not None and free.low < free.vanishes_at < free.high
    return Candidate(form.effect, found[0], free.low >= 0.0 and free.solved, free.low >= 0.0 and not inside, found[1])


_Made = tuple[Model, Array, float]


def _search(made: Callable[[float], _Made | None], free: Free, target_um: float) -> _Made | None:
    """Return the largest effect whose difference is not above the target, or the nearest to it."""
    if free.solved:
        trial = made(free.starts[0])
        if trial is None or trial[2] == 0.0:
            return None
        value = min(max(free.starts[0] * target_um / trial[2], free.low), free.high)
        return made(value) or trial
    near, far = _ends(free)
    one, other = made(near), made(far)
    if one is not None and other is not None and one[2] > other[2]:
        near, far = far, near
    best = _nearer(_nearer(None, one, target_um), other, target_um)
    for _ in range(TRIES):
        if best is not None and _off(best[2], target_um) < NEAR_ENOUGH:
            break
        middle = math.sqrt(near * far) if near * far > 0.0 else 0.5 * (near + far)
        trial = made(middle)
        best = _nearer(best, trial, target_um)
        if trial is None or trial[2] > target_um:
            far = middle
        else:
            near = middle
    return best


def _nearer(best: _Made | None, trial: _Made | None, target_um: float) -> _Made | None:
    """Return the one whose size is nearer to the target."""
    if trial is None or trial[2] == 0.0:
        return best
    return trial if best is None or _off(trial[2], target_um) < _off(best[2], target_um) else best


def _off(size_um: float, target_um: float) -> float:
    return abs(math.log(size_um / target_um))


def _ends(free: Free) -> tuple[float, float]:
    """Return where the effect is small and where it is large; the right way round or not.

    A number that is nought where the effect vanishes has no decade there to begin with: a delay of milliseconds and one
    of half a second are both looked for.
    """
    inside = free.vanishes_at is not None and free.low < free.vanishes_at < free.high
    if inside:
        assert free.vanishes_at is not None
        return free.vanishes_at + SMALLEST * (free.high - free.vanishes_at), free.high
    return (free.low or SMALLEST * free.high), free.high
