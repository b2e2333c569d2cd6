"""What a diagnosis says, made ready to be told: effects with numbers, what was recalibrated, the corrected model."""

import math
from dataclasses import dataclass, replace

import numpy as np

from bender_discrepancy.conclusion.coarse_readings import QUANTISER, Lattice, lattice
from bender_discrepancy.conclusion.contenders import Contender, contenders, leaders
from bender_discrepancy.conclusion.corrected_model import corrected
from bender_discrepancy.conclusion.numbers import Span, form_of, number, numbers
from bender_discrepancy.effects.catalogue import EFFECTS
from bender_discrepancy.fitting.fit_problem import Calibration
from bender_discrepancy.fitting.output_error import Fitted
from bender_discrepancy.fitting.own_numbers import own_numbers
from bender_discrepancy.fitting.uncertainty import Uncertainty, uncertainty
from bender_discrepancy.search.result import Diagnosis
from bender_plant.model import Model
from bender_report.number import Number

# a calibration is reported when it is off by this many standard deviations
SIGNIFICANT = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class Named:
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
    contender: Contender | None
    by_record: tuple[tuple[Number, ...], ...] = ()


@dataclass(frozen=True, slots=True)
class Changed:
    """Gain or offset of the reading, before and after; `afters` has one value for each record where they differ.

    Where an effect has a part that a gain has as well, the records leave their shares open (`std` is inf); `alone` says
    whether the model as given had to be recalibrated before any effect was added.
    """

    name: str
    before: float
    after: float
    std: float
    unit: str
    afters: tuple[float, ...] = ()
    alone: bool = False

    @property
    def is_significant(self) -> bool:
        """Whether it changed by more than the records leave open."""
        return self.alone if math.isinf(self.std) else abs(self.after - self.before) > SIGNIFICANT * self.std


@dataclass(frozen=True, slots=True, eq=False)
class Findings:
    """Everything that is told of a diagnosis, before the corrected FMU is driven.

    Attributes:
        diagnosis: what it is told of.
        verdict: the contract's word.
        effects: in the order of adding; the rivals of an ambiguous verdict after them.
        leaders: hypotheses that the records cannot tell apart, the best first.
        recalibrated: what changed of gain and offset.
        calibration: that of the corrected model, relative to the model as given.
        lattice: of the readings, where they are coarse and the model as given does not say so.
        model: the corrected model.
        of_record: the record whose surroundings and offset the corrected model has: the one with the largest gap where
            records differ in their surroundings, else the first.
    """

    diagnosis: Diagnosis
    verdict: str
    effects: tuple[Named, ...]
    leaders: tuple[Fitted, ...]
    recalibrated: tuple[Changed, ...]
    calibration: Calibration
    lattice: Lattice | None
    model: Model
    of_record: int = 0

    @property
    def added(self) -> tuple[Named, ...]:
        """The effects that are in the corrected model: all but the rivals of an ambiguous verdict."""
        return tuple(x for x in self.effects if x.contender is None or x.contender.rival_of is None)


def span_of(diagnosis: Diagnosis) -> Span:
    """Return the largest voltage of the records and the peak-to-peak of their readings."""
    volts = max(float(np.max(np.abs(x.drive.voltage_V))) for x in diagnosis.bench.observations)
    microns = max(float(np.ptp(x.measured_um[x.usable])) for x in diagnosis.bench.observations)
    return Span(volts, microns)


def find(diagnosis: Diagnosis) -> Findings:
    """Return what is told of a diagnosis."""
    span, record = span_of(diagnosis), reference_record(diagnosis)
    known: dict[int, Uncertainty] = {}
    effects = []
    for x in contenders(diagnosis):
        open_ = known.setdefault(id(x.fitted), uncertainty(diagnosis.bench, x.fitted))
        effects.append(_named(diagnosis, x, open_, span, record))
    coarse = lattice(diagnosis)
    quantiser = _quantiser(coarse, span)
    changed = _changed(diagnosis, uncertainty(diagnosis.bench, diagnosis.best), record)
    verdict = _verdict(diagnosis, quantiser is not None)
    kept = _kept(verdict, changed)
    step = coarse.step_um if coarse and quantiser else 0.0
    untouched = not kept and not diagnosis.best.hypothesis.parts
    calibration = _as_given(diagnosis) if untouched else diagnosis.best.calibration
    return Findings(
        diagnosis=diagnosis,
        verdict=verdict,
        effects=_in_order(effects, quantiser),
        leaders=leaders(diagnosis),
        recalibrated=kept,
        calibration=calibration,
        lattice=coarse,
        model=_model(diagnosis, calibration, [x.id for x in effects], kept, step),
        of_record=record,
    )


def worst_record(diagnosis: Diagnosis) -> int:
    """Return the record in which the recalibrated model leaves most."""
    rows = zip(diagnosis.found.base.residuals, diagnosis.bench.observations, strict=True)
    return int(np.argmax([float(np.sum(r[x.usable] ** 2)) for r, x in rows]))


def reference_record(diagnosis: Diagnosis) -> int:
    """Return the record as which the corrected model is: records may differ in their surroundings."""
    return worst_record(diagnosis) if diagnosis.best.hypothesis.has_surroundings else 0


def _in_order(effects: list[Named], quantiser: Named | None) -> tuple[Named, ...]:
    """Return what is in the corrected model, then the rivals that could stand in it instead."""
    rivals = [x for x in effects if x.contender is not None and x.contender.rival_of]
    added = [x for x in effects if x not in rivals]
    return (*added, *([quantiser] if quantiser else []), *rivals)


def _named(diagnosis: Diagnosis, contender: Contender, open_: Uncertainty, span: Span, record: int) -> Named:
    part = contender.fitted.hypothesis.parts[contender.index]
    found = [
        numbers(diagnosis.base, contender.fitted, contender.index, open_.coordinates, span, k)
        for k in range(part.form.records)
    ]
    form = form_of(part.form.apply(diagnosis.base, part.form.of_record(part.values, 0)), contender.id)
    if len(found) == 1:
        return Named(contender.id, form, found[0], contender)
    return Named(contender.id, form, found[record], contender, tuple(found))


def _quantiser(found: Lattice | None, span: Span) -> Named | None:
    """Return the steps of the sensor as an effect, where simulating them brings the simulation nearer."""
    if found is None or not found.is_worth_it:
        return None
    step = number(EFFECTS[QUANTISER], "step_um", found.step_um, 0.0, span, is_scale=True)
    return Named(QUANTISER, None, (step,), None)


def _verdict(diagnosis: Diagnosis, quantised: bool) -> str:
    """Return the word; steps of the sensor are an effect that is named, read off the record and never fitted."""
    word = diagnosis.verdict.word
    return "named" if quantised and word in ("no_gap", "recalibrated") else word


def _changed(diagnosis: Diagnosis, open_: Uncertainty, record: int) -> tuple[Changed, ...]:
    values, found = diagnosis.base.values(), diagnosis.best.calibration
    gain, offset = values.get("calibration.gain", 1.0), values.get("calibration.offset", 0.0)
    offsets = tuple(found.gain * offset + x for x in found.offsets_um)
    changed = (
        Changed("gain", gain, found.gain * gain, abs(gain) * open_.gain, "1"),
        Changed("offset", offset, offsets[record], open_.offsets_um[record], "um", offsets if len(offsets) > 1 else ()),
    )
    changed += _own_changed(diagnosis, open_)
    if not diagnosis.best.hypothesis.parts or all(math.isfinite(x.std) for x in changed[:2]):
        return changed
    base = diagnosis.found.base
    bare = uncertainty(diagnosis.bench, base)
    off = (
        abs(base.calibration.gain - 1.0) > SIGNIFICANT * bare.gain,
        abs((base.calibration.gain - 1.0) * offset + base.calibration.offsets_um[record])
        > SIGNIFICANT * bare.offsets_um[record],
    )
    return (*(replace(x, alone=y) for x, y in zip(changed[:2], off, strict=True)), *changed[2:])


def _own_changed(diagnosis: Diagnosis, open_: Uncertainty) -> tuple[Changed, ...]:
    """Return the model's own linear numbers, before and after, where they were freed."""
    own = diagnosis.best.hypothesis.own
    if own is None:
        return ()
    spreads = np.sqrt(np.diag(open_.coordinates))[-len(own.values) :]
    return tuple(
        Changed(x.name, x.given, after, after * float(spread), "s" if x.parameter.endswith("_s") else "1")
        for x, after, spread in zip(own_numbers(diagnosis.problem.base), own.values, spreads, strict=True)
    )


def _kept(verdict: str, changed: tuple[Changed, ...]) -> tuple[Changed, ...]:
    """Return what changed; of a verdict `recalibrated` at least the one that changed most."""
    kept = tuple(x for x in changed if x.is_significant)
    if verdict != "recalibrated" or kept:
        return kept
    return (max(changed, key=lambda x: abs(x.after - x.before) / x.std if x.std else 0.0),)


def _model(
    diagnosis: Diagnosis, calibration: Calibration, ids: list[str], kept: tuple[Changed, ...], step_um: float
) -> Model:
    base, best = diagnosis.base, diagnosis.best
    count = len(best.hypothesis.parts)
    if not count and not step_um and calibration == _as_given(diagnosis):
        return base
    changes = [f"{x} added" for x in ids[:count]]
    changes += [f"{QUANTISER} added"] if step_um else []
    changes += [f"{x.name} of the reading recalibrated" for x in kept]
    before = f"{base.description}; " if base.description else ""
    description = f"{before}corrected: {', '.join(changes)}" if changes else base.description
    record = reference_record(diagnosis)
    return replace(corrected(base, replace(best, calibration=calibration), step_um, record), description=description)


def _as_given(diagnosis: Diagnosis) -> Calibration:
    return Calibration(1.0, (0.0,) * len(diagnosis.records))
