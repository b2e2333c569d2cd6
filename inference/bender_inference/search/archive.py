"""Every fit that a search makes, once, with what it predicts of blocks that its fit did not see."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from bender_effects.form import Form
from bender_inference.fitting.blocked import predicted_residuals
from bender_inference.fitting.fit_problem import FitProblem
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.fitting.output_error import Fitted, fit, judge, recounted
from bender_inference.fitting.own_numbers import names_of
from bender_inference.records.observations import Array, Mask
from bender_inference.search.judgement.score import Difference, difference, likelihood_deviate, log_deviate
from bender_inference.search.noise import floor_square_um2, noise_of
from bender_inference.search.set_aside import with_outlying_aside
from bender_plant.model import Model

SAME_NUMBERS = 1e-3
"""Of a coordinate: a fit that sets out so near to where another one did is that one."""
MOST_TURNS = 3
"""So often readings are set aside: without some the noise is smaller, and others stand out."""


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """What a hypothesis predicts of every block from the others.

    Attributes:
        errors: (n,) of every record, measured minus predicted, 0 where a row does not count.
        blocks: (b,) sums of squares of all blocks.
        rows: (b,) how many rows of each count.
        square: over all rows that count.
    """

    errors: tuple[Array, ...]
    blocks: Array
    rows: Array
    square: float


@dataclass(slots=True, eq=False)
class Archive:
    """The fits of a search.

    Attributes:
        problem: what they are fitted to; readings may be set aside as the search goes on.
        noise_um: the smallest noise floor that any residual has shown.
        fits: in the order in which they were made.
    """

    problem: FitProblem
    noise_um: float = float("inf")
    fits: list[Fitted] = field(default_factory=list)
    _starts: dict[tuple[object, ...], Fitted | None] = field(default_factory=dict)
    _scanned: set[tuple[object, ...]] = field(default_factory=set)
    _predictions: dict[int, Prediction | None] = field(default_factory=dict)
    _mirrored: FitProblem | None = None
    _spans: dict[Hypothesis, float] = field(default_factory=dict)
    _added_up: dict[Hypothesis, float] = field(default_factory=dict)

    def fit(self, hypothesis: Hypothesis, most_evaluations: int = 12, *, closely: bool = False) -> Fitted | None:
        """Return a hypothesis fitted from where it stands; None where it cannot be simulated there."""
        key = (*_start_key(hypothesis), most_evaluations, closely)
        if key not in self._starts:
            fitted = fit(self.problem, hypothesis, most_evaluations, closely=closely)
            self._starts[key] = fitted
            self.add([fitted])
        return self._starts[key]

    def compared(self, hypothesis: Hypothesis) -> Fitted | None:
        """Return a hypothesis fitted to be compared with others: it is not kept, nobody may choose it."""
        key = (*_start_key(hypothesis), "compared")
        if key not in self._starts:
            self._starts[key] = fit(self.problem, hypothesis)
        return self._starts[key]

    def add(self, fits: Iterable[Fitted | None]) -> list[Fitted]:
        """Keep fits that were made elsewhere; returns those that can be simulated."""
        alive = [x for x in fits if x is not None and np.isfinite(x.training_square)]
        known = {id(x) for x in self.fits}
        self.fits += [x for x in alive if id(x) not in known]
        return alive

    def not_scanned(self, parent: Fitted, forms: Iterable[Form]) -> list[Form]:
        """Return the forms that have not been scanned on a hypothesis before, and take them as scanned."""
        known = _start_key(parent.hypothesis)[:-1]
        fresh = [x for x in forms if (*known, x.name) not in self._scanned]
        self._scanned |= {(*known, x.name) for x in fresh}
        return fresh

    @property
    def counted(self) -> list[Mask]:
        """(n,) of every record, the rows that fits and choices see."""
        return [x.searched for x in self.problem.observations]

    def prediction(self, fitted: Fitted) -> Prediction | None:
        """Return what a fit predicts of blocks that it did not see; None where it cannot be simulated."""
        key = id(fitted)
        if key not in self._predictions:
            self._predictions[key] = _prediction(self.problem, fitted)
        return self._predictions[key]

    def square(self, fitted: Fitted) -> float:
        """Return the mean squared error of those predictions; inf where there are none."""
        found = self.prediction(fitted)
        return np.inf if found is None else found.square / max(self.problem.all_rows, 1)

    def mirrored_span_um(self, fitted: Fitted) -> float:
        """Return the largest span of the readings under the mirrored commands of a record, inf where it runs away."""
        if self._mirrored is None:
            self._mirrored = self.problem.observing([x.mirrored() for x in self.problem.observations])
        hypothesis = fitted.hypothesis
        if hypothesis not in self._spans:
            readings = self._mirrored.readings(hypothesis)
            self._spans[hypothesis] = np.inf if readings is None else max(float(np.ptp(x)) for x in readings)
        return abs(fitted.calibration.gain) * self._spans[hypothesis]

    def adds_up_um(self, fitted: Fitted) -> float:
        """Return how far the linear part still goes in the second half of a record that leads from end to end.

        A plant that adds its commands up, which may be an effect's doing, goes farther there than it went in a closed
        loop; others stand still. Records that never pass the command at which such a plant would stand still are of
        none.
        """
        parts = tuple(x for x in fitted.hypothesis.parts if x.form.adds_up)
        linear = replace(fitted.hypothesis, parts=parts, equation=None)
        if linear not in self._added_up:
            self._added_up[linear] = self._adds_up_um(linear)
        return abs(fitted.calibration.gain) * self._added_up[linear]

    def _adds_up_um(self, linear: Hypothesis) -> float:
        if not all(x.passes_zero for x in self.problem.observations):
            return 0.0
        problem = self.problem.observing([x.held_at_largest() for x in self.problem.observations])
        readings = problem.readings(linear)
        return 0.0 if readings is None else max(abs(float(x[-1] - x[x.size // 2])) for x in readings)

    def difference(self, better: Fitted, worse: Fitted) -> Difference:
        """Return by how much the first fit predicts blocks better that neither has seen."""
        one, other = self.prediction(better), self.prediction(worse)
        if one is None or other is None:
            return Difference(0.0 if one is None and other is None else (-40.0 if one is None else 40.0), 1.0)
        rows = difference(one.errors, other.errors, self.counted)
        floor = one.rows * floor_square_um2(self.problem, self.noise_um)
        logarithms = log_deviate(one.blocks + floor, other.blocks + floor)
        likelihood = likelihood_deviate(one.errors, other.errors, self.counted)
        return Difference(max(rows.deviations, logarithms, likelihood), rows.ratio)

    def by_square(self, fits: Iterable[Fitted] | None = None) -> list[Fitted]:
        """Return fits with the one first that predicts best."""
        return sorted(self.fits if fits is None else fits, key=self.square)

    def by_fit(self, fits: Iterable[Fitted] | None = None) -> list[Fitted]:
        """Return fits with the one first that leaves least of the rows that fits and choices see."""
        return sorted(self.fits if fits is None else fits, key=left_square)

    def best(self, fits: Iterable[Fitted]) -> Fitted | None:
        """Return the fit that predicts best; None of none.

        What a fit leaves of all rows is hardly more than what it predicts: those that leave more need no prediction.
        """
        best: Fitted | None = None
        for x in self.by_fit(fits):
            if best is not None and left_square(x) > self.square(best) * self.problem.all_rows:
                break
            if best is None or self.square(x) < self.square(best):
                best = x
        return best

    def bare(self, structure: Model | None) -> Fitted | None:
        """Return the fit of a linear structure without any effect; None where it could not be simulated."""
        own = (x for x in self.fits if not x.hypothesis.all_parts and x.hypothesis.structure is structure)
        return next(own, None)

    def lacking(self, effect: str) -> Iterator[Fitted]:
        """Yield the fits without an effect; one with the number free that the effect is a change of has it."""
        for x in self.fits:
            if effect not in x.hypothesis.effects and effect not in names_of(x.hypothesis.own):
                yield x

    def current(self, fitted: Fitted) -> Fitted:
        """Return a fit as it counts now: readings may have been set aside since."""
        same = next((x for x in self.fits if x.hypothesis is fitted.hypothesis), None)
        return same or self.add([recounted(fitted, self.problem)])[0]

    def set_aside(self, leader: Fitted) -> Fitted:
        """Set isolated readings aside by what a leader leaves, count everything anew, and return that leader.

        What is misread, and how large the noise is, show best where least structure is left; every estimate of the
        noise errs upwards where some is.
        """
        self.noise_um = min(self.noise_um, noise_of(leader, self.problem))
        for _ in range(MOST_TURNS):
            problem, changed = with_outlying_aside(self.problem, leader, self.noise_um)
            if not changed:
                break
            again = fit(problem, leader.hypothesis) or recounted(leader, problem)
            self._recount(problem, leader, again)
            leader = again
            self.noise_um = min(self.noise_um, noise_of(leader, self.problem))
        return leader

    def rebase(self, problem: FitProblem, moved: Mapping[int, Fitted]) -> None:
        """Take another model as given; `moved` has every fit as it is called beside that, by its identity."""
        self.problem = problem
        self._predictions = {id(moved[k]): v for k, v in self._predictions.items() if k in moved}
        self.fits = [moved[id(x)] for x in self.fits]
        self._starts.clear()
        self._scanned.clear()
        self._spans.clear()
        self._added_up.clear()
        self._mirrored = None

    def _recount(self, problem: FitProblem, leader: Fitted, again: Fitted) -> None:
        self.problem = problem
        fits = {id(x): recounted(x, problem) for x in self.fits}
        fits[id(leader)] = again
        self.fits = list(fits.values())
        # what was only compared is fitted again where it is asked for
        kept = {k: x for k, x in self._starts.items() if x is None or id(x) in fits}
        self._starts = {k: None if x is None else fits[id(x)] for k, x in kept.items()}
        # what forms promised, they promised with the readings that do not count any more
        self._scanned.clear()
        self._predictions.clear()


def left_square(fitted: Fitted) -> float:
    """Return the sum of squares over all rows that fits and choices see."""
    return fitted.training_square + fitted.held_square


def judged(archive: Archive, hypothesis: Hypothesis) -> Fitted | None:
    """Return a hypothesis as it is, with gain and offsets solved for, kept in the archive."""
    fitted = judge(archive.problem, hypothesis)
    archive.add([fitted])
    return fitted


def _start_key(hypothesis: Hypothesis) -> tuple[object, ...]:
    numbers = zip(hypothesis.free, hypothesis.values(), strict=True)
    coordinates = tuple(round(f.inward(v) / SAME_NUMBERS) if np.isfinite(f.inward(v)) else v for f, v in numbers)
    own = None if hypothesis.own is None else tuple(x.name for x in hypothesis.own.form.free)
    structure = None if hypothesis.structure is None else hypothesis.structure.name
    equation = None if hypothesis.equation is None else hypothesis.equation.form.name
    return (structure, tuple(x.form.name for x in hypothesis.parts), own, equation, coordinates)


def _prediction(problem: FitProblem, fitted: Fitted) -> Prediction | None:
    try:
        errors = predicted_residuals(problem, fitted)
    except np.linalg.LinAlgError:
        return None
    if errors is None or not all(np.all(np.isfinite(x)) for x in errors):
        return None
    blocks, rows = [], []
    for e, x in zip(errors, problem.observations, strict=True):
        own = x.folds[x.searched]
        squares, counts = (np.bincount(own, weights=w) for w in (e[x.searched] ** 2, np.ones(own.size)))
        blocks += squares[counts > 0.0].tolist()
        rows += counts[counts > 0.0].tolist()
    return Prediction(tuple(errors), np.array(blocks), np.array(rows), float(sum(blocks)))
