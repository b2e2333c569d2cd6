"""The sentences of a diagnosis: the verdict, the evidence for each effect, where the disagreement lives."""

import math
import re
from dataclasses import replace
from typing import Any

from bender_discrepancy.conclusion.coarse_readings import Lattice
from bender_discrepancy.conclusion.contenders import Contender
from bender_discrepancy.conclusion.findings import OF_THE_READING, Findings, RecalibratedNumber, ReportedEffect
from bender_discrepancy.conclusion.measurement.gap import Measured
from bender_effects.catalogue import EFFECTS
from bender_inference.fitting.criterion import very_strong
from bender_inference.search.judgement.grades import Reach, Rival
from bender_inference.search.judgement.rules import RULES
from bender_inference.settings import Settings
from bender_report.wording import chance, figure, input_word, is_other_rig, listed, lower_first, percent, quantity

OF_THE_RECORD = " with what belongs to the record"
"""Drift, hum and ageing, which the corrected model is not given."""
_DIRECTIONS = {
    ("direction", 1.0): "while the {} rises",
    ("direction", -1.0): "while the {} falls",
    ("hold", 1.0): "while the {} is held",
    ("hold", 0.0): "in the rows right after a change of the {}",
}
# an id of several words; one of a single word is the word that a title has
_ID = re.compile(r"\b[a-z]+(?:_[a-z]+)+\b")
# significant ones, until two numbers look different
_DIGITS = range(3, 10)
_AXES = {"time": "time", "voltage": "{}s", "rate": "rates", "frequency": "frequencies"}


def number_title(name: str) -> str:
    """Return what one of the model's own numbers is called: the mode of another device need not bend."""
    return name.replace("bending_modes.", "mode.") if is_other_rig() else name


def heading_of(effect_id: str) -> str:
    """Return the title of an effect, in the words of the device."""
    about = EFFECTS[effect_id]
    return about.elsewhere if about.elsewhere and is_other_rig() else about.title


def title_of(effect_id: str) -> str:
    """Return the title of an effect as it stands inside a sentence."""
    return lower_first(heading_of(effect_id))


def _with_titles(text: str) -> str:
    """Return a text with the titles of effects in the place of their ids."""
    return _ID.sub(lambda found: title_of(found[0]) if found[0] in EFFECTS else found[0], text)


def headline(findings: Findings, measured: Measured) -> str:
    """Return the verdict in a sentence."""
    added = [title_of(x.id) for x in findings.added]
    if findings.verdict == "named":
        return f"Missing from the model: {listed(added)}{_unexplained(findings, measured)}."
    if findings.search.grades.commuting:
        alike = [title_of(x.id) for x in findings.added if EFFECTS[x.id].same_on_other_side]
        return _ambiguity(findings, listed(alike), "two lags that follow each other")
    if findings.verdict == "likely":
        return _likely(findings)
    if findings.verdict == "ambiguous":
        return _ambiguity(findings, *_alike(findings))
    if findings.verdict == "unexplained":
        known = f", beside {listed(added)}" if added else ""
        has_equation = findings.search.best.hypothesis.equation is not None
        then = "; the corrected model describes it by an equation" if has_equation else ""
        return f"The model lacks something that no effect of the catalogue explains{known}{then}."
    if findings.verdict == "recalibrated":
        changes = [_recalibrated(x) for x in findings.recalibrated]
        own = any(x.name not in ("gain", "offset") for x in findings.recalibrated)
        off = "numbers of the model were off" if own else "only the reading was off"
        return f"Nothing is missing, {'but ' if own else ''}{off}: {listed(changes)}."
    if not findings.complete:
        return f"Simulation and measurement agree: the residual is below {share_of_stroke(findings.search.settings)}."
    return "Simulation and measurement agree: they differ by noise only."


def share_of_stroke(settings: Settings) -> str:
    """Return the part of the stroke that is material to nobody, and the option that sets it."""
    whole = "range of the readings" if is_other_rig() else "stroke"
    return f"{100.0 * settings.relevant:g} % of the {whole} (--relevant)"


def _likely(findings: Findings) -> str:
    """Return the leading suspects, and how sure the first is."""
    first, *others = findings.added
    sure = "" if first.contender is None else f" (probability {chance(first.contender.probability)})"
    word = "Possibly" if first.grade == "possible" else "Probably"
    return f"{word} missing: {listed([title_of(first.id) + sure, *(title_of(x.id) for x in others)])}."


def _unexplained(findings: Findings, measured: Measured) -> str:
    """Return what stays unexplained beside named effects, and how much of the gap these close."""
    if findings.complete:
        return ""
    if measured.after.rms_um >= measured.recalibrated.rms_um:
        shown = "them" if len(findings.added) > 1 else "it"
        return f"; held-out readings, with a residual of {residual(measured)}, do not confirm {shown}"
    several = len(findings.added) > 1
    own = listed([number_title(x.name) for x in findings.recalibrated if x.name not in OF_THE_READING])
    closing = "they close" if several else "it closes"
    if own:
        closing = f"{'they' if several else 'it'} and another {own} close"
    told = "" if measured.closes is None else f"; {closing} {percent(measured.closes)} of the gap"
    if measured.after.rms_um**2 <= (1.0 + RULES.at_noise) * measured.floor_um**2:
        left = "On held-out readings the residual is {}; elsewhere in the record it is larger than noise"
        return f"{told}. {left.format(residual(measured))}"
    return f"{told}. A residual of {residual(measured)}, is left"


def residual(measured: Measured) -> str:
    """Return the rms of the residual and how many times the noise floor it is: the one that every sentence speaks of.

    It is measured on the reported rows, which no fit and no choice saw, by driving the corrected FMU.
    """
    left, floor = measured.after.rms_um, measured.floor_um
    if floor <= 0.0:
        return quantity(left, "um")
    times = figure(left / floor, 2)
    return f"{quantity(left, 'um')}, {'as large as' if times == '1' else f'{times} times'} the noise floor"


def reason(findings: Findings, measured: Measured) -> str:
    """Return why the verdict stands, with the size of the residual where that is the reason."""
    why = _with_titles(findings.reason)
    if findings.complete or findings.verdict in ("ambiguous", "likely"):
        return why
    # what was not corrected is the recalibrated model
    as_after = findings.is_corrected or findings.explains_more
    told = measured if as_after else replace(measured, after=measured.recalibrated)
    return f"{why}; on held-out readings the residual is {residual(told)}"


def _alike(findings: Findings) -> tuple[str, str]:
    """Return the effects in which the best hypothesis differs from the others that fit as well, and theirs."""
    known = {x.id for x in findings.certain}
    own = [listed([title_of(x) for x in y.hypothesis.effects if x not in known]) for y in findings.leaders]
    return own[0], listed([x for x in dict.fromkeys(own[1:]) if x], "or") or "another effect with memory"


def _ambiguity(findings: Findings, own: str, others: str) -> str:
    """Return what the records cannot distinguish, after what is certain beside it."""
    if not findings.certain:
        return f"These records cannot tell {own} from {others}."
    certain = listed([title_of(x.id) for x in findings.certain])
    beside = "it" if len(findings.certain) == 1 else "them"
    return f"Missing from the model: {certain}. Beside {beside}, these records cannot tell {own} from {others}."


def _recalibrated(x: RecalibratedNumber) -> str:
    """Return what became of a number, in the record where it changed most."""
    after = x.afters[x.most_changed] if x.afters else x.after
    where = f" in record {x.most_changed + 1}" if x.afters else ""
    return f"the {number_title(x.name)} is {_change(x.before, after, x.unit)}{where}"


def _change(before: float, after: float, unit: str) -> str:
    digits = next((n for n in _DIGITS if quantity(after, unit, n) != quantity(before, unit, n)), _DIGITS[-1])
    return f"{quantity(after, unit, digits)} instead of {quantity(before, unit, digits)}"


def gap_sentence(findings: Findings, measured: Measured) -> str:
    """Return how far the gap shrank, in a sentence."""
    before, alone, after = (x.rms_um for x in (measured.before, measured.recalibrated, measured.after))
    floor = f"the noise floor is {quantity(measured.floor_um, 'um')}"
    if findings.verdict == "no_gap":
        return f"On held-out readings they differ by {quantity(before, 'um')} rms; {floor}."
    if findings.simulated or findings.search.best.hypothesis.equation is not None or findings.explains_more:
        start = f"the gap falls from {quantity(alone, 'um')} rms, gain and offset recalibrated,"
    elif findings.verdict == "recalibrated":
        start = f"the gap falls from {quantity(before, 'um')} rms"
    elif findings.added and findings.lattice is not None:
        steps = quantity(findings.lattice.share_um, "um")
        return f"On held-out readings they differ by {quantity(after, 'um')} rms; rounding explains {steps} of it."
    else:
        return f"On held-out readings a gap of {quantity(alone, 'um')} rms remains; {floor}."
    closed = measured.closes if findings.is_corrected or findings.explains_more else None
    told = "" if closed is None else f". {percent(closed)} of the gap is closed"
    beside = OF_THE_RECORD if findings.explains_more else ""
    return f"On held-out readings {start} to {quantity(after, 'um')}{beside}; {floor}{told}."


def evidence(findings: Findings, effect: ReportedEffect) -> str:
    """Return the evidence for one effect in a sentence."""
    x = effect.contender
    if x is None:
        return _of_the_lattice(findings.lattice) if findings.lattice else ""
    decides = very_strong(findings.search.settings.confidence)
    before, after = quantity(x.before_um, "um"), quantity(x.after_um, "um")
    there = f"on held-out readings{_of_those(findings)}"
    if x.rival_of:
        told = f"in the place of {x.rival_of} it would close {percent(x.share_of_gap)} of the gap; "
        told += f"{there} the residual would be {after} rms with it, {before} with neither"
    else:
        part = f"{percent(x.share_of_gap)} of the gap" if x.share_of_gap > 0.0 else "no part of the gap"
        if x.is_all:
            told = f"it closes {part}; {there} the residual goes from {before} to {after} rms"
        else:
            told = f"it closes {part} in the mean over all orders of adding; "
            told += f"added last, it takes the residual from {before} to {after} rms {there}"
    told = f"{told}; {_beside(x, decides)}."
    return _with_titles(told[0].upper() + told[1:])


def _of_those(findings: Findings) -> str:
    return " of the rows that were searched" if findings.search.excerpts else ""


_REACHES = {
    "plainer": "the simpler {} in its place fits as well (to a hundredth of the gap's rms)",
    "other side": "{}, the same lag on the other side of the device, fits as well (to a hundredth of the gap's rms)",
    "predicts as well": "{} in its place predicts unseen readings nearly as well",
    "fits as well": "{} in its place fits all readings as well, but predicts unseen ones less well",
}


_STAYS_OPEN: dict[Reach, str] = {
    "": "a single sine cannot exclude an effect with memory",
    "plainer": "it is simpler and fits as well (to a hundredth of the gap's rms)",
    "other side": "it, the same lag on the other side, fits as well (to a hundredth of the gap's rms)",
    "predicts as well": "it predicts unseen readings nearly as well",
    "fits as well": "it fits all readings as well",
    "as large": "it leaves less than twice as much above the noise in the readings that choose",
}
"""Why a rival is reported although the criterion is clearly against it."""


def _beside(contender: Contender, decides: float) -> str:
    if not contender.rivals:
        return "no other effect that was tried comes close"
    first: Rival = contender.rivals[0]
    if not math.isfinite(first.difference):
        return f"there are too few readings to choose between it and {contender.rival_of or first.id}"
    if contender.rival_of and -first.difference >= decides:
        evidence = f"the evidence for {contender.rival_of} in its place is {figure(-first.difference)}"
        return f"{evidence} ({figure(decides, 2)} decides), but {_STAYS_OPEN[first.reach]}"
    if contender.rival_of and first.difference >= decides:
        return f"it fits all readings better (evidence {figure(first.difference)}), but predicts unseen ones no better"
    if contender.rival_of:
        between = figure(abs(first.difference))
        return f"the evidence between {contender.rival_of} and it is {between}; {figure(decides, 2)} would decide"
    if first.reach in _REACHES:
        return _REACHES[first.reach].format(first.id)
    if first.reach == "as large":
        return (
            f"{first.id} in its place would leave less than twice as much above the noise in the readings that choose"
        )
    return (
        f"the next best in its place, {first.id}, is ruled out (evidence {figure(first.difference)}; "
        f"{figure(decides, 2)} decides)"
    )


def _of_the_lattice(found: Lattice) -> str:
    step = quantity(found.step_um, "um")
    before, after = figure(found.before_um), quantity(found.after_um, "um")
    farther = ": the remaining gap is too large for rounding to matter"
    left_out = "" if found.is_simulated else "; the corrected model is not rounded"
    beside = farther + left_out if found.after_um > found.before_um else left_out
    return (
        f"The readings are multiples of {step}. Rounding alone makes "
        f"{quantity(found.share_um, 'um')} rms, which is part of the noise floor. Rounding the simulation too changes "
        f"the residual from {before} to {after} rms on held-out readings{beside}."
    )


def share_words(findings: Findings, effect: ReportedEffect) -> str:
    """Return what an effect closes of the gap, as the end of a sentence; empty where that is nothing."""
    if effect.contender is None:
        rounding = "" if findings.lattice is None else quantity(findings.lattice.share_um, "um")
        return f"; rounding is {rounding} rms of the noise floor" if rounding else ""
    if effect.contender.rival_of:
        return f"; in place of {effect.contender.rival_of} it would close {percent(effect.share_of_gap)} of the gap"
    return f"; closes {percent(effect.share_of_gap)} of the gap" if effect.share_of_gap > 0.0 else ""


def range_sentence(place: dict[str, Any]) -> str:
    """Return one entry of `where` in a sentence."""
    return f"{percent(place['share'])} of the recalibrated residual lies {range_words(place)}"


def range_words(place: dict[str, Any]) -> str:
    """Return the range of one entry of `where` in words."""
    axis, (low, high) = place["axis"], place["range"]
    words = _DIRECTIONS.get((axis, low))
    if words is None:
        known = _AXES.get(axis, axis)
        words = f"at {known} of {figure(low)} to {quantity(high, place['unit'])}"
        if axis == "time":
            words = f"between {figure(low)} and {quantity(high, place['unit'])}"
    return words.format(input_word())
