"""An FMU that is not linear, followed to what was found: its own answer takes the place of the linear model's.

A search computes an effect by way of the linear model that stands in for the FMU, and takes from the readings what both
differ by under the voltage of the records. Behind an effect the FMU sees another voltage, or another output is seen,
and they differ by something else. So the leading hypotheses are put around the FMU itself, what FMU and stand-in then
differ by is taken from the readings instead, and the hypothesis is fitted again: where that comes to rest, the residual
is that of the FMU (Bandler and others 2004, Space mapping: the state of the art, doi:10.1109/TMTT.2003.820904; here the
output is mapped). The search is then done once more from there.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bender_compiled.simulation import Simulator
from bender_discrepancy.conclusion.findings import Findings
from bender_discrepancy.conclusion.measurement.corrected_model import corrected
from bender_discrepancy.conclusion.measurement.gap import Measured, compared, recalibrated_readings
from bender_discrepancy.foreign.container_stages import Original, stages_around
from bender_discrepancy.foreign.corrected_fmu import Container, Containers, build_corrected_fmu, driven_container
from bender_effects.form import Values
from bender_inference.fitting.criterion import cost
from bender_inference.fitting.fit_problem import Calibration, FitProblem
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.fitting.output_error import Fitted, fit, judge
from bender_inference.search.archive import Archive
from bender_inference.search.budget import BUDGET
from bender_inference.search.result import SearchResult
from bender_inference.search.search import Searched
from bender_loop.errors import RunError
from bender_loop.records.record import Record

Array = NDArray[np.float64]

LEADERS = 4
"""Hypotheses that are put around the FMU where the stand-in shows none to be right."""
REFINED = 2
"""Of these, fitted again to the FMU's own answer."""
TURNS = 4
"""Of fitting one again to the FMU's answer around it."""
HARDLY_LESS = 0.98
"""Of the square: a turn that leaves more of it than that is the last one."""
ROUNDS = 3
"""Of searching again."""
NOTHING_MISSING = ("no_gap", "recalibrated")
AT_REST = 0.1
"""Of the noise: an answer of the FMU that moves by less is at rest."""


@dataclass(frozen=True, slots=True, eq=False)
class Around:
    """A hypothesis around the FMU itself.

    Attributes:
        fitted: its numbers, and the residual that the FMU leaves.
        differences_um: (n,) of every record, what FMU and stand-in differ by there.
    """

    fitted: Fitted
    differences_um: Sequence[Array]


@dataclass(slots=True)
class SpaceMapping:
    """What FMU and stand-in differ by around what was found last.

    Attributes:
        original: the FMU.
        records: as they were measured.
        given_um: (n,) of every record, what both differ by under its voltage.
        is_led: the first search was for the leading effect only.
        differences_um: the same around what was found last: what the readings of the last search lack.
        alone: calibration of the model as given, by the first search.
        best: the hypothesis around the FMU that leaves least so far.
        rounds: of searching again, so far.
        containers: that were made for it.
    """

    original: Original
    records: Sequence[Record]
    given_um: Sequence[Array]
    is_led: bool = True
    differences_um: Sequence[Array] = field(init=False)
    alone: Calibration | None = None
    best: Around | None = None
    rounds: int = 0
    containers: Containers = field(default_factory=Containers)

    def __post_init__(self) -> None:
        self.differences_um = self.given_um

    def again(self, search: SearchResult, tell: Callable[[str], None]) -> list[Record] | None:
        """Return the records without what FMU and stand-in differ by around what a search found; None at rest.

        Where the first search was for the leading effect only, and that leaves structure, another one has to follow.
        """
        if self.rounds == 0:
            self.alone = search.found.base.calibration
        if search.verdict.word in NOTHING_MISSING:
            return None
        tell("fitting the correction around the FMU itself")
        nearer = self._around_what_leads(search)
        is_all = nearer is None and search.verdict.word == "named" and search.verdict.complete
        is_open = self.is_led and self.rounds == 0 and not is_all
        if (nearer is None and not is_open) or self.rounds == ROUNDS or self._is_below_the_stand_in(search):
            return None
        self.rounds += 1
        if nearer is not None:
            self.differences_um = nearer.differences_um
        return self._lacking(self.differences_um)

    def _is_below_the_stand_in(self, search: SearchResult) -> bool:
        """Return whether the inside of the FMU is changed, and less is left than the stand-in is off as given.

        Nothing shows how it is off with another inside: that would be taken for one effect after the other.
        """
        model = corrected(search.base, search.best)
        if stages_around(search.base, model, self.original.rest_um).inside is None:
            return False
        return _training_rms(search, search.best) < size_um(self.differences_um)

    def _around_what_leads(self, search: SearchResult) -> Around | None:
        """Return what leads, where it leaves least around the FMU; None where it stood there before."""
        leaders = _leaders(search)
        if not leaders:
            return None
        first = self._once(search, fit(search.problem, leaders[0]))
        if search.best.hypothesis.parts and first is not None and not self._has_moved(search, first):
            self.best = first
            return None
        around = [first, *(self._once(search, fit(search.problem, x)) for x in leaders[1:])]
        leading = sorted((x for x in around if x is not None), key=lambda x: self._cost(search, x))[:REFINED]
        best: Around | None = None
        for x in leading:
            now = self._nearer(search, x)
            best = min((best or now, now), key=lambda y: self._cost(search, y))
            if self._is_done(search, best):
                break
        if best is None or (self.best is not None and self._cost(search, self.best) <= self._cost(search, best)):
            return None
        if not search.best.hypothesis.parts and not _is_better(search, best.fitted):
            return None
        self.best = best
        return best

    def settled(self, search: SearchResult) -> SearchResult:
        """Return what a search found, or what leaves less on the FMU itself than that does."""
        best = self.best
        if best is None:
            return search
        if search.best.hypothesis.parts:
            now = self._once(search, search.best)
            if now is not None and not self._has_moved(search, now):
                return search
            if now is not None and self._cost(search, now) <= self._cost(search, best):
                best = now
        best = self._needed(search, best)
        settled = self._with(search, best.differences_um, best.fitted.hypothesis)
        if settled is None or not settled.best.hypothesis.parts:
            settled, left = self._with(search, self.given_um, Hypothesis()) or search, self.given_um
        else:
            left = best.differences_um
        self.differences_um = left
        return settled

    def _with(
        self, search: SearchResult, differences_um: Sequence[Array], hypothesis: Hypothesis
    ) -> SearchResult | None:
        """Return a search of readings that lack what FMU and stand-in differ by elsewhere, as if that were its best."""
        moved = [x - y for x, y in zip(differences_um, self.differences_um, strict=True)]
        problem = _without(search, moved)
        fitted, base = judge(problem, hypothesis), judge(problem, Hypothesis())
        if fitted is None or base is None:
            return None
        archive = Archive(problem, search.archive.noise_um, [base, fitted] if hypothesis.parts else [base])
        found = Searched(archive, base, archive.fits[-1], search.found.stopped)
        return replace(search, records=tuple(self._lacking(differences_um))).with_search(found)

    def measured(self, search: SearchResult, findings: Findings) -> tuple[Measured, Container]:
        """Return the gap at its three stages, the last one measured by driving the container, and the container.

        Raises:
            RunError: the container could not be made, or fails.
        """
        given, recalibrated = self._as_given(search)
        if findings.model is search.base:
            content = Container(self.original.path.read_bytes(), b"", dict(self.original.start_values), 0.0)
            return replace(compared(search, given, recalibrated, given), is_corrected=False), content
        made: Container | None = None
        after = []
        own = findings.calibration.offsets_um[findings.of_record]
        best = search.best.hypothesis
        rows = zip(search.whole, self.differences_um, search.records, strict=True)
        for k, (seen, difference, record) in enumerate(rows):
            apart = best.has_surroundings and k != findings.of_record
            model = best.around(findings.model, k) if apart else findings.model
            if made is None or best.has_surroundings:
                made = build_corrected_fmu(search, model, self.original)
            reading = driven_container(made, self.original, seen, record)
            after.append(reading - difference + findings.calibration.offsets_um[k] - own)
        if best.has_surroundings:
            made = build_corrected_fmu(search, findings.model, self.original)
        assert made is not None
        return compared(search, given, recalibrated, after), made

    def _as_given(self, search: SearchResult) -> tuple[list[Array], list[Array]]:
        """Return the readings of the FMU as given and after calibration alone, without what the records lack."""
        if self.alone is not None:
            base = replace(search.found.base, calibration=self.alone)
            search = replace(search, found=replace(search.found, base=base))
        moved = [x - y for x, y in zip(self.given_um, self.differences_um, strict=True)]
        given, recalibrated = recalibrated_readings(search)
        return [y + d for y, d in zip(given, moved, strict=True)], [
            y + d for y, d in zip(recalibrated, moved, strict=True)
        ]

    def _lacking(self, differences_um: Sequence[Array]) -> list[Record]:
        rows = zip(self.records, differences_um, strict=True)
        return [replace(x, displacement_um=x.displacement_um - d) for x, d in rows]

    def _moved(self, around: Around) -> list[Array]:
        return [x - y for x, y in zip(around.differences_um, self.differences_um, strict=True)]

    def _has_moved(self, search: SearchResult, around: Around) -> bool:
        return size_um(self._moved(around)) >= AT_REST * search.archive.noise_um

    def _is_done(self, search: SearchResult, around: Around) -> bool:
        return _training_rms(search, around.fitted) < BUDGET.nearly_done * search.archive.noise_um

    def _cost(self, search: SearchResult, around: Around) -> float:
        return cost(around.fitted, search.grades.by)

    def _once(self, search: SearchResult, fitted: Fitted | None) -> Around | None:
        """Return a hypothesis around the FMU with the residual that it leaves there; None where it cannot be there."""
        if fitted is None:
            return None
        found = self._differences(search, fitted)
        if found is None:
            return None
        moved = [x - y for x, y in zip(found, self.differences_um, strict=True)]
        here = judge(_without(search, moved), fitted.hypothesis)
        return None if here is None else Around(here, found)

    def _differences(self, search: SearchResult, fitted: Fitted) -> list[Array] | None:
        """Return what FMU and stand-in differ by with a hypothesis around them; None where it cannot be there."""
        apart, found = fitted.hypothesis.has_surroundings, []
        for k, (seen, record) in enumerate(zip(search.whole, search.records, strict=True)):
            model = corrected(search.base, fitted, record=k if apart else 0)
            try:
                answer = self.containers.driven(search, model, self.original, seen, record)
            except RunError:  # the effect's numbers are beyond what can be put around it
                return None
            found.append(answer - Simulator(seen.drive).run(model).reading_um)
        return found

    def _nearer(self, search: SearchResult, around: Around) -> Around:
        """Return a hypothesis where it leaves least around the FMU, of those that it is fitted to there in turn.

        Where the stand-in answers an effect more or less than the FMU does, the numbers come nearer by the same part at
        every turn: each third turn sets out from where that leads (Aitken's process).
        """
        way = [around.fitted.hypothesis.values()]
        for _ in range(TURNS):
            fitted = fit(_without(search, self._moved(around)), around.fitted.hypothesis)
            now = self._once(search, fitted)
            if now is None or fitted is None:
                break
            way.append(fitted.hypothesis.values())
            best = min((now, around), key=lambda x: x.fitted.training_square)
            if len(way) == 3:
                led = self._once(search, judge(search.problem, extrapolate_values(fitted.hypothesis, *way)))
                best = min((best, led or best), key=lambda x: x.fitted.training_square)
                way = [best.fitted.hypothesis.values()]
            hardly = best.fitted.training_square > HARDLY_LESS * around.fitted.training_square
            around = best
            if hardly or self._is_done(search, around):
                break
        return around

    def _needed(self, search: SearchResult, around: Around) -> Around:
        """Return a hypothesis without the effects that make no difference around the FMU."""
        for k in reversed(range(len(around.fitted.hypothesis.parts))):
            shorter = around.fitted.hypothesis.minus(k)
            if not shorter.parts:
                break
            without = self._once(search, fit(_without(search, self._moved(around)), shorter))
            if without is None:
                continue
            lost = self._cost(search, without) - self._cost(search, around) > search.grades.by.threshold
            is_material = search.rules.is_material(search.archive, search.found.base, without.fitted, around.fitted)
            if not lost or not is_material:
                around = without
        return around


def size_um(differences_um: Sequence[Array]) -> float:
    """Return the rms of differences (n,) of every record."""
    return float(np.sqrt(np.mean(np.concatenate(differences_um) ** 2)))


def _leaders(search: SearchResult) -> list[Hypothesis]:
    """Return what the search found, or the simplest hypotheses that came nearest; the FMU's inside stays as it is."""
    best = replace(search.best.hypothesis, own=None)
    if len(best.parts) > 1:
        return [best, *(best.minus(k) for k in range(len(best.parts)))]
    if best.parts:
        return [best]
    found: dict[tuple[str, ...], Hypothesis] = {}
    for x in search.archive.by_square(y for y in search.archive.fits if len(y.hypothesis.parts) == 1):
        found.setdefault(x.hypothesis.effects, replace(x.hypothesis, own=None))
    return list(found.values())[:LEADERS]


def extrapolate_values(hypothesis: Hypothesis, first: Values, second: Values, third: Values) -> Hypothesis:
    """Return a hypothesis with the numbers that three turns lead to, each within its bounds."""
    found = []
    for free, x, y, z in zip(hypothesis.free, first, second, third, strict=True):
        bend = z - 2.0 * y + x
        led = x - (y - x) ** 2 / bend if bend != 0.0 else z
        found.append(min(max(led, free.low), free.high) if math.isfinite(led) else z)
    return hypothesis.with_values(found)


def _is_better(search: SearchResult, fitted: Fitted) -> bool:
    by = search.grades.by
    return cost(fitted, by) - cost(search.best, by) < -by.threshold


def _training_rms(search: SearchResult, fitted: Fitted) -> float:
    rows = sum(int(x.training.sum()) for x in search.problem.observations)
    return math.sqrt(fitted.training_square / max(rows, 1))


def _without(search: SearchResult, moved: Sequence[Array]) -> FitProblem:
    """Return the problem of a search with readings that lack something more."""
    windows = search.searched
    rows = zip(search.problem.observations, moved, windows, strict=True)
    return search.problem.observing([replace(x, measured_um=x.measured_um - d[w]) for x, d, w in rows])
