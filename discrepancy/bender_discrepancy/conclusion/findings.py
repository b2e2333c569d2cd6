"""What a diagnosis says, made ready to be told: effects with numbers, what was recalibrated, the corrected model."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from bender_discrepancy.conclusion.coarse_readings import Lattice, lattice
from bender_discrepancy.conclusion.contenders import Contender, contenders, contested, leaders
from bender_discrepancy.conclusion.measurement.corrected_model import carried, corrected, straight_beyond
from bender_discrepancy.conclusion.measurement.gap import Measured
from bender_discrepancy.conclusion.measurement.reading_units import gain_of_the_device, in_reading_units
from bender_discrepancy.conclusion.numbers import MovedGain, Span, form_of, number, numbers
from bender_discrepancy.conclusion.shares import shares_of_gap, split
from bender_effects.catalogue import EFFECTS, READ_OFF
from bender_effects.rigs import is_piezo_bender
from bender_inference.fitting.fit_problem import Calibration, FitProblem
from bender_inference.fitting.output_error import Fitted
from bender_inference.fitting.own_numbers import own_numbers
from bender_inference.fitting.profile import Ends, interval_ends, may_vanish
from bender_inference.fitting.uncertainty import Uncertainty, uncertainty
from bender_inference.records.first_look import ANOTHER_DEVICE
from bender_inference.records.observations import have_same_zero
from bender_inference.search.judgement.grades import Doubt, Grade
from bender_inference.search.judgement.verdict import Verdict, calibration_matters
from bender_inference.search.result import SearchResult
from bender_inference.search.set_aside import with_late_stamps
from bender_plant.model import Model, ModelError
from bender_plant.valid_range import ValidRange
from bender_report.number import Number
from bender_report.wording import HALF_WIDTH

OF_THE_READING = ("gain", "offset")
# a calibration is reported when it is off by this many standard deviations
SIGNIFICANT = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class ReportedEffect:
    """One effect that is reported, with its numbers.

    Attributes:
        id: the contract's name.
        form: the form its block takes, None where it has but one.
        numbers: of its block.
        contender: where it stands in the search; None for what was read off the record itself.
        by_record: its numbers in every record, where they differ; () otherwise. `numbers` are those of one of them.
    """

    id: str
    form: str | None
    numbers: tuple[Number, ...]
    contender: Contender | None = field(repr=False)
    by_record: tuple[tuple[Number, ...], ...] = ()

    @property
    def share_of_gap(self) -> float:
        """Part of the recalibrated residual's variance above the noise floor that it closes, on held-out readings.

        Those of the corrected model add up to what it closes. Steps of the sensor close nothing of it: they are part
        of the floor.
        """
        return 0.0 if self.contender is None else self.contender.share_of_gap

    @property
    def grade(self) -> Grade:
        """How sure it is: certain, likely or possible; what is read off the record itself is certain."""
        return "certain" if self.contender is None else self.contender.grade

    @property
    def probability(self) -> float:
        """That it is there: of what is told with p, a part p is right."""
        return 1.0 if self.contender is None else self.contender.probability

    @property
    def stage(self) -> str:
        """Where in the chain it acts."""
        return EFFECTS[self.id].stage


@dataclass(frozen=True, slots=True)
class RecalibratedNumber:
    """Gain or offset of the reading, before and after; `afters` and `stds` have one of each record where they differ.

    Where an effect has a part that a gain has as well, the records leave their shares open (`std` is inf); `alone` says
    whether the model as given had to be recalibrated before any effect was added; `at_end`, whether it is at the end of
    the range that it may have.
    """

    name: str
    before: float
    after: float
    std: float
    unit: str
    afters: tuple[float, ...] = ()
    stds: tuple[float, ...] = ()
    alone: bool = False
    at_end: bool = False

    @property
    def is_significant(self) -> bool:
        """Whether it changed by more than the records leave open, in one of them."""
        return self.alone if math.isinf(self.std) else max(self.changes_in_stds) > SIGNIFICANT

    @property
    def changes_in_stds(self) -> tuple[float, ...]:
        """By how many of its standard deviations it changed, in every record where these differ."""
        told = zip(self.afters or (self.after,), self.stds or (self.std,), strict=True)
        changes = ((abs(x - self.before), std) for x, std in told)
        return tuple((x / std if std > 0.0 else math.inf if x > 0.0 else 0.0) for x, std in changes)

    @property
    def most_changed(self) -> int:
        """The record in which it changed most, where records differ."""
        return int(np.argmax(self.changes_in_stds))

    @property
    def interval_95(self) -> tuple[float, float] | None:
        """Where the number lies; None where the records leave it open."""
        if not math.isfinite(self.std):
            return None
        return self.after - HALF_WIDTH * self.std, self.after + HALF_WIDTH * self.std


@dataclass(frozen=True, slots=True, eq=False)
class Findings:
    """Everything that is told of a diagnosis, before the corrected FMU is driven.

    Attributes:
        search: what it is told of.
        verdict: the final word, that of the contract.
        complete: whether nothing above the noise stays unexplained.
        reason: why it stands.
        effects: in the order of adding; the rivals of an ambiguous verdict after them.
        leaders: hypotheses that the records cannot distinguish, the best first.
        recalibrated: what changed of gain and offset.
        calibration: that of the corrected model, relative to the model as given.
        lattice: of the readings, where they are coarse and the model as given does not say so.
        model: the corrected model.
        of_record: the record whose surroundings and offset the corrected model has: the one with the largest gap where
            records differ in their surroundings, else the first.
        shares: of the gap, by what the corrected model has: effects, and the keys of `shares` beside them.
        changed: every number of the model itself that is another one in the corrected model, significant or not.
        of_a_device: a gain that was found stands before the effects, as one of the device.
    """

    search: SearchResult
    verdict: str
    complete: bool
    reason: str
    effects: tuple[ReportedEffect, ...]
    leaders: tuple[Fitted, ...]
    recalibrated: tuple[RecalibratedNumber, ...]
    calibration: Calibration
    lattice: Lattice | None
    model: Model
    of_record: int = 0
    shares: Mapping[str, float] = field(default_factory=dict)
    changed: tuple[RecalibratedNumber, ...] = ()
    of_a_device: bool = False

    @property
    def added(self) -> tuple[ReportedEffect, ...]:
        """The effects that are said to be missing: all but the rivals of an ambiguous verdict."""
        return tuple(x for x in self.effects if x.contender is None or x.contender.rival_of is None)

    @property
    def certain(self) -> tuple[ReportedEffect, ...]:
        """Those of them that nothing else may stand for: beside rivals, what every hypothesis has that fits as well."""
        if self.verdict == "named":
            return self.added
        open_ = contested(self.search)
        return tuple(x for x in self.added if x.contender is None or x.id not in open_)

    @property
    def simulated(self) -> tuple[ReportedEffect, ...]:
        """Those of them that the corrected model has: not what belongs to a record, steps only where rounding helps."""
        rounded = self.lattice is not None and self.lattice.is_simulated
        kept = self.search.settings.with_record_effects
        carried = (x for x in self.added if kept or not EFFECTS[x.id].of_the_record)
        return tuple(x for x in carried if x.id != READ_OFF or rounded)

    @property
    def is_corrected(self) -> bool:
        """Whether the corrected model has effects, an equation or other numbers, and not another calibration alone."""
        hypothesis = self.search.best.hypothesis
        return bool(self.simulated) or hypothesis.own is not None or hypothesis.equation is not None

    @property
    def explains_more(self) -> bool:
        """Whether the gap after is that of the corrected model and of what belongs to the records, which has no FMU."""
        return not self.is_corrected and bool(self.search.best.hypothesis.parts)

    def closing(self, measured: Measured) -> "Findings":
        """Return them with shares of the gap that add up to what the corrected model was measured to close.

        Where all rows were searched, the residuals with an effect and without it are the measured ones as well.
        """
        shares = split(measured.closed[0], self.shares)
        return replace(self, shares=shares, effects=tuple(self._sharing(x, shares, measured) for x in self.effects))

    def _sharing(self, effect: ReportedEffect, shares: Mapping[str, float], measured: Measured) -> ReportedEffect:
        x = effect.contender
        if x is None:
            return effect
        if not self.search.excerpts:
            after_um = measured.after.rms_um if x.rival_of is None else x.after_um
            x = replace(x, before_um=measured.recalibrated.rms_um if x.is_all else x.before_um, after_um=after_um)
        share = shares.get(x.id, 0.0)
        if x.rival_of is not None:
            # what it would close more or less than the effect whose place it takes
            own = shares.get(x.rival_of, 0.0)
            share = min(max(own + x.share_of_gap - self.shares.get(x.rival_of, 0.0), 0.0), 1.0)
        return replace(effect, contender=replace(x, share_of_gap=share))

    @property
    def gain_ratio(self) -> float:
        """The gain of the records in units of the model's; 1 where it did not change or is not told from 0."""
        gain = next((x for x in self.recalibrated if x.name == "gain"), None)
        if gain is None or gain.before == 0.0 or abs(gain.after) <= SIGNIFICANT * gain.std:
            return 1.0
        return gain.after / gain.before

    @property
    def is_another_device(self) -> bool:
        """Whether the records rise against the model, or ten times as much, or as little: it is not of their device.

        An effect with a linear part of its own may take over that of the model, whose gain then tells nothing: only
        where calibration alone finds another device as well is it one.
        """
        ratios = self.gain_ratio, self.search.found.base.calibration.gain
        return not any(1.0 / ANOTHER_DEVICE < x < ANOTHER_DEVICE for x in ratios)


def span_of(search: SearchResult) -> Span:
    """Return the largest voltage of the records and the peak-to-peak of their readings."""
    volts = max(float(np.max(np.abs(x.drive.voltage_V))) for x in search.problem.observations)
    microns = max(float(np.ptp(x.measured_um[x.usable])) for x in search.problem.observations)
    return Span(volts, microns, is_piezo_bender(search.base))


def find(search: SearchResult, *, of_a_device: bool = False) -> Findings:
    """Return what is told of a diagnosis.

    Args:
        search: what it is told of.
        of_a_device: a gain that was found belongs to the device, not to a ruler or to a box around which effects stand.
    """
    span, record = span_of(search), reference_record(search)
    of_a_device = of_a_device and search.best.hypothesis.equation is None
    known: dict[int, tuple[FitProblem, Uncertainty]] = {}

    def determined(fitted: Fitted) -> tuple[FitProblem, Uncertainty]:
        if id(fitted) not in known:
            problem = with_late_stamps(search.problem, fitted, search.archive.noise_um)
            known[id(fitted)] = problem, uncertainty(problem, fitted)
        return known[id(fitted)]

    problem, open_ = determined(search.best)
    ends = interval_ends(problem, search.best, open_)
    shares = shares_of_gap(search.archive, search.found.base, search.best)
    search = search.with_doubts(_doubts(search, ends, shares))
    effects = [
        _named(search, x, determined(x.fitted)[1], ends if x.fitted is search.best else (), span, record, of_a_device)
        for x in contenders(search, shares)
    ]
    coarse = lattice(search)
    quantiser = _quantiser(coarse, span)
    changed = _changed(search, open_, record)
    final = _final(search.verdict, quantiser is not None)
    kept = _kept(_is_recalibrated(search, final.word), changed)
    step = coarse.step_um if coarse and coarse.is_simulated else 0.0
    untouched = not kept and not search.best.hypothesis.parts and search.best.hypothesis.equation is None
    calibration = _as_given(search) if untouched else search.best.calibration
    return Findings(
        search=search,
        verdict=final.word,
        complete=final.complete,
        reason=final.reason,
        effects=_in_order(effects, quantiser),
        leaders=leaders(search),
        recalibrated=kept,
        calibration=calibration,
        lattice=coarse,
        model=_model(search, calibration, kept, step, of_a_device),
        of_record=record,
        shares=shares,
        changed=() if untouched else tuple(x for x in changed if x.after != x.before),
        of_a_device=of_a_device,
    )


def _doubts(search: SearchResult, ends: Sequence[Ends | None], shares: Mapping[str, float]) -> dict[int, Doubt]:
    """Return why the final numbers of some effects, by their index, leave open whether they are there."""
    best = search.best
    hardly: dict[int, Doubt] = {
        k: "share"
        for k, x in enumerate(best.hypothesis.parts)
        if not (x.form.shown or EFFECTS[x.form.effect].of_the_record)
        and shares[x.form.effect] <= search.rules.last_percent
    }
    sizes: dict[int, Doubt] = dict.fromkeys(may_vanish(best, ends), "size")
    return {**hardly, **sizes}


def worst_record(search: SearchResult) -> int:
    """Return the record in which the recalibrated model leaves most."""
    rows = zip(search.found.base.residuals, search.problem.observations, strict=True)
    return int(np.argmax([float(np.sum(r[x.usable] ** 2)) for r, x in rows]))


def reference_record(search: SearchResult) -> int:
    """Return the record as which the corrected model is: records may differ in their surroundings."""
    return worst_record(search) if search.best.hypothesis.has_surroundings else 0


def _in_order(effects: list[ReportedEffect], quantiser: ReportedEffect | None) -> tuple[ReportedEffect, ...]:
    """Return what is in the corrected model, then the rivals that could stand in it instead."""
    rivals = [x for x in effects if x.contender is not None and x.contender.rival_of]
    added = [x for x in effects if x not in rivals]
    return (*added, *([quantiser] if quantiser else []), *rivals)


def _named(
    search: SearchResult,
    contender: Contender,
    open_: Uncertainty,
    ends: Sequence[Ends | None],
    span: Span,
    record: int,
    of_a_device: bool,
) -> ReportedEffect:
    hypothesis = contender.fitted.hypothesis
    # a rival may stand in another linear structure than what was found
    # with its own numbers as they were found: some effects take one of them over
    part, base = hypothesis.parts[contender.index], replace(hypothesis, parts=(), equation=None).model(search.base)
    factor = moved_gain(search, contender.fitted) if of_a_device else 1.0
    sign = math.copysign(1.0, contender.fitted.calibration.gain)
    moved = None if factor == 1.0 else MovedGain(factor, open_.gain, sign * open_.with_gain)
    found = [
        numbers(base, contender.fitted, contender.index, open_.coordinates, span, k, ends, moved)
        for k in range(part.form.records)
    ]
    form = form_of(part.form.apply(base, part.form.of_record(part.values, 0)), contender.id)
    if len(found) == 1:
        return ReportedEffect(contender.id, form, found[0], contender)
    return ReportedEffect(contender.id, form, found[record], contender, tuple(found))


def moved_gain(search: SearchResult, fitted: Fitted) -> float:
    """Return the factor of the calibration that belongs before the effects of a fit, 1 for none."""
    factor = gain_of_the_device(search.base, fitted.calibration.gain)
    if not fitted.hypothesis.parts:
        return 1.0
    try:
        in_reading_units(corrected(search.base, fitted), factor)
    except ModelError:
        return 1.0
    return factor


def _quantiser(found: Lattice | None, span: Span) -> ReportedEffect | None:
    """Return the steps of the sensor as an effect, where they are worth naming."""
    if found is None or not found.is_named:
        return None
    step = number(EFFECTS[READ_OFF], "step_um", found.step_um, 0.0, span, is_scale=True)
    return ReportedEffect(READ_OFF, None, (step,), None)


def _final(searched: Verdict, quantised: bool) -> Verdict:
    """Return the final verdict; steps of the sensor are an effect that is named, read off the record, never fitted."""
    if not quantised or searched.word not in ("no_gap", "recalibrated"):
        return searched
    beside = "gain and offset were off; " if searched.word == "recalibrated" else ""
    steps = "the readings are multiples of one step, which are no small part of the residual"
    reason = f"{steps}; {beside}nothing else is missing"
    return replace(searched, word="named", reason=reason)


def _changed(search: SearchResult, open_: Uncertainty, record: int) -> tuple[RecalibratedNumber, ...]:
    values, found = search.base.values(), search.best.calibration
    gain, offset = values.get("calibration.gain", 1.0), values.get("calibration.offset", 0.0)
    offsets = tuple(found.gain * offset + x for x in found.offsets_um)
    own = () if len(offsets) == 1 or have_same_zero(search.problem.observations) else offsets
    changed = (
        RecalibratedNumber("gain", gain, found.gain * gain, abs(gain) * open_.gain, "1"),
        RecalibratedNumber(
            "offset",
            offset,
            offsets[record],
            open_.offsets_um[record],
            "um",
            own,
            stds=tuple(open_.offsets_um) if own else (),
        ),
    )
    changed += _own_changed(search, open_)
    if not search.best.hypothesis.parts or all(math.isfinite(x.std) for x in changed[:2]):
        return changed
    base = search.found.base
    bare = uncertainty(search.problem, base)
    off = (
        abs(base.calibration.gain - 1.0) > SIGNIFICANT * bare.gain,
        abs((base.calibration.gain - 1.0) * offset + base.calibration.offsets_um[record])
        > SIGNIFICANT * bare.offsets_um[record],
    )
    return (*(replace(x, alone=y) for x, y in zip(changed[:2], off, strict=True)), *changed[2:])


def _own_changed(search: SearchResult, open_: Uncertainty) -> tuple[RecalibratedNumber, ...]:
    """Return the model's own linear numbers, before and after, where they were freed."""
    own = search.best.hypothesis.own
    if own is None:
        return ()
    spreads = np.sqrt(np.diag(open_.coordinates))[-len(own.values) :]
    known = {x.name: x for x in own_numbers(search.problem.base)}
    freed = [known[free.name] for free in own.form.free]
    found = (
        RecalibratedNumber(x.name, x.given, after, after * float(spread), "s" if x.parameter.endswith("_s") else "1")
        for x, after, spread in zip(freed, own.values, spreads, strict=True)
    )
    return tuple(replace(x, at_end=f.is_at_end(x.after)) for x, f in zip(found, own.form.free, strict=True))


def _is_recalibrated(search: SearchResult, verdict: str) -> bool:
    """Return whether gain and offset must be told: where no effect explains the rest, they may be all that helps."""
    if verdict == "unexplained" and not search.best.hypothesis.parts:
        return calibration_matters(search.archive, search.found.base, search.rules)
    return verdict == "recalibrated"


def _kept(at_least_one: bool, changed: tuple[RecalibratedNumber, ...]) -> tuple[RecalibratedNumber, ...]:
    """Return what changed significantly; where there must be one, at least the number that changed most."""
    kept = tuple(x for x in changed if x.is_significant)
    if kept or not at_least_one:
        return kept
    return (max(changed, key=lambda x: max(y if math.isfinite(y) else 0.0 for y in x.changes_in_stds)),)


def _model(
    search: SearchResult,
    calibration: Calibration,
    kept: tuple[RecalibratedNumber, ...],
    step_um: float,
    of_a_device: bool,
) -> Model:
    base, best = search.base, carried(search.best, with_record_effects=search.settings.with_record_effects)
    ids = list(best.hypothesis.effects)
    if not best.hypothesis.all_parts and not step_um and calibration == _as_given(search):
        return base
    changes = [f"{x} added" for x in ids]
    changes += ["an equation for the residual added"] if best.hypothesis.equation else []
    changes += [f"{READ_OFF} added"] if step_um else []
    changes += [f"{x.name}{' of the reading' if x.name in OF_THE_READING else ''} recalibrated" for x in kept]
    before = f"{base.description}; " if base.description else ""
    description = f"{before}corrected: {', '.join(changes)}" if changes else base.description
    record = reference_record(search)
    model = corrected(base, replace(best, calibration=calibration), step_um, record)
    valid = _valid(search)
    model = straight_beyond(model, search.best.hypothesis.effects, valid, search.whole)
    if of_a_device:
        model = in_reading_units(model, moved_gain(search, search.best))
    covered = valid.in_words(search.records[0].quantities.command)
    return replace(model, description=f"{description}; learned from {covered}", valid=valid)


def _valid(search: SearchResult) -> ValidRange:
    """Return what the records cover."""
    volts = [x.voltage_V for x in search.records]
    longest_s = 0.0 if search.settings.untimed else max(float(np.ptp(x.time_s)) for x in search.records)
    return ValidRange(float(min(x.min() for x in volts)), float(max(x.max() for x in volts)), longest_s)


def _as_given(search: SearchResult) -> Calibration:
    return Calibration(1.0, (0.0,) * len(search.records))
