"""The summary of a diagnosis on the terminal: about a dozen lines."""

import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from bender_discrepancy.conclusion.diagnosis_json import SPARSE_EQUATION
from bender_discrepancy.conclusion.findings import Findings, ReportedEffect
from bender_discrepancy.conclusion.measurement.gap import Measured
from bender_discrepancy.conclusion.sentences import OF_THE_RECORD, number_title, range_sentence, share_words
from bender_discrepancy.conclusion.shares import OWN_NUMBERS
from bender_discrepancy.report.effect_sections import driven_V
from bender_discrepancy.report.loop_and_creep import creep_sentence, hysteresis_sentence
from bender_inference.fitting.criterion import very_strong
from bender_report.wording import (
    HALF_WIDTH,
    IN_WORDS,
    chance,
    fields,
    figure,
    listed,
    percent,
    quantity,
    shown_in,
    uncertain,
    unit_text,
    with_interval,
)

WIDTH, INDENT = 100, 15
MOST_VALUES = 4
MOST_WARNINGS = 3


def summary(findings: Findings, measured: Measured, result: dict[str, Any], out: Path) -> Iterator[str]:
    """Yield the lines."""
    yield from _line(findings.verdict, result["sentence"])
    if findings.verdict in ("likely", "ambiguous", "unexplained"):
        yield from _line("because", result["reason"])
    yield from _line("gap", _gap(findings, measured))
    if (findings.is_corrected or findings.explains_more) and measured.closes is not None:
        yield from _line("closed", _closed(measured))
    volts, confidence = driven_V(findings), findings.search.settings.confidence
    # behind the effects stands an equation without a name, where there is one: the lead says it
    for effect, entry in zip(findings.effects, result["effects"], strict=False):
        yield from _line(_heading(entry, findings.verdict), _effect(findings, effect, entry, volts, confidence))
    yield from _recalibrated(findings)
    if result["where"]:
        yield from _line("where", _where(result))
    if result["lead"] or result["no_lead"]:
        yield from _line("lead", _lead(result))
    for text in result["warnings"][:MOST_WARNINGS]:
        yield from _line("note", text)
    if len(result["warnings"]) > MOST_WARNINGS:
        yield from _line("note", f"and {len(result['warnings']) - MOST_WARNINGS} more in report.html")
    yield from _further(result)
    yield from _rivals(result)
    yield from _units(result)
    profile = (result["next_experiment"] or {}).get("profile")
    files = ", ".join(x for x in ("diagnosis.json", result["model"], result["fmu"], profile) if x)
    yield from _line("written", f"{out / 'report.html'}, {files}")


def _recalibrated(findings: Findings) -> Iterator[str]:
    """Yield the model's own numbers before and after, and what ± means."""
    for x in findings.recalibrated:
        end = ", the end of its range" if x.at_end else ""
        yield from _line(
            number_title(x.name),
            f"{quantity(x.before, x.unit)} → {uncertain(x.after, HALF_WIDTH * x.std, x.unit)}{end}",
        )
    own = findings.shares.get(OWN_NUMBERS, 0.0)
    if own > 0.0:
        yield from _line(
            "model", f"its own numbers (lags, frequency, damping), fitted again, close {percent(own)} of the gap"
        )
    if findings.effects or findings.recalibrated:
        yield from _line("", IN_WORDS)


def _further(result: dict[str, Any]) -> Iterator[str]:
    """Yield what would distinguish the leaders of an ambiguous verdict."""
    if result["next_experiment"]:
        yield from _line("next", result["next_experiment"]["why"])
    for x in result["columns_that_would_tell"]:
        yield from _line("record", x["why"])


def _rivals(result: dict[str, Any]) -> Iterator[str]:
    """Yield the models of what the device may be instead, by their files."""
    told = [f"{x['model']} has {listed(x['effects']) or 'no effect'}" for x in result.get("rival_models", ())]
    if told:
        yield from _line("rivals", f"{'; '.join(told)}; the FMU of each lies beside it")


def _units(result: dict[str, Any]) -> Iterator[str]:
    """Yield what volts and metres of the corrected FMU stand for, where the record has neither."""
    pairs = ("takes", "V", result.get("input_unit", "V")), ("gives", "um", result.get("unit", "um"))
    with shown_in("V", "um"):  # here these are what the FMU has
        told = [f"{verb} 1 {unit_text(usual)} for 1 {unit_text(own)}" for verb, usual, own in pairs if own != usual]
    if told and result["fmu"] and "foreign_model" not in result:
        yield from _line("units", f"{result['fmu']} {' and '.join(told)} of the records")


def _heading(entry: dict[str, Any], verdict: str) -> str:
    sure = chance(entry["probability"])
    if entry.get("rival_of"):
        return f"instead {sure}"
    if entry["certain"]:
        return "effect" if verdict == "named" else "certain"
    return f"{entry['grade']} {sure}"


def _gap(findings: Findings, measured: Measured) -> str:
    stages = [
        f"{quantity(measured.before.rms_um, 'um')} as given",
        f"{figure(measured.recalibrated.rms_um)} recalibrated",
    ]
    whole = f"{figure(measured.recalibrated.all_rms_um)} recalibrated"
    if findings.is_corrected or findings.explains_more:
        with_what = OF_THE_RECORD if findings.explains_more else " corrected"
        stages.append(f"{figure(measured.after.rms_um)}{with_what}")
        whole += f", {figure(measured.after.all_rms_um)}{with_what}"
    seen = f"rms on held-out readings; over all readings {whole}"
    return f"{', '.join(stages)}; noise floor {figure(measured.floor_um)} ({seen})"


def _closed(measured: Measured) -> str:
    part = uncertain(100.0 * (measured.closes or 0.0), HALF_WIDTH * 100.0 * measured.closed[1])
    return f"{part} % of the gap: of the mean square that calibration alone leaves above the noise floor"


def _lead(result: dict[str, Any]) -> str:
    found = result["lead"]
    if not found:
        return f"no equation for the rest was found: {result['no_lead']}"
    if found["in_model"]:
        closes = next((x["share_of_gap"] for x in result["effects"] if x["id"] == SPARSE_EQUATION), 0.0)
        told = f"it closes {percent(closes)} of the gap and is in the corrected model"
    else:
        told = f"it explains {percent(found['explains'])} of the residual above the noise and is not in the model"
    return f"{found['equation']}; {told}; it names no effect"


def _where(result: dict[str, Any]) -> str:
    told = "; ".join(range_sentence(x) for x in result["where"][:2])
    record = result["where"][0].get("record")
    return told if record is None else f"of {result['records'][record]['name']}, {told}"


def _effect(
    findings: Findings, effect: ReportedEffect, entry: dict[str, Any], volts: tuple[float, float], confidence: float
) -> str:
    model = findings.model
    in_figures = hysteresis_sentence(effect.id, effect.form, effect.numbers, volts, model) or creep_sentence(
        effect.id, effect.numbers
    )
    told = in_figures or _numbers(effect)
    beside = _beside(findings, effect, entry, very_strong(confidence))
    return f"{effect.id}: {told}{share_words(findings, effect)}{beside}"


def _numbers(effect: ReportedEffect) -> str:
    found = []
    free = [x for x in effect.numbers if x.std > 0.0] or effect.numbers
    for field, numbers in fields(free).items():
        values = [with_interval(x) for x in numbers[:MOST_VALUES]]
        more = ", …" if len(numbers) > MOST_VALUES else ""
        mark = " (unusual)" if any(x.unusual for x in numbers) else ""
        found.append(f"{field} {', '.join(values)}{more}{mark}")
    return "; ".join(found)


def _beside(findings: Findings, effect: ReportedEffect, entry: dict[str, Any], decides: float) -> str:
    if not entry["rivals"]:
        return ""
    rival = entry["rivals"][0]
    if rival["delta_bic"] is None:
        return f"; {entry.get('rival_of') or rival['id']} is possible too: too few readings to choose between them"
    if entry.get("rival_of"):
        place = next((x.probability for x in findings.effects if x.id == entry["rival_of"]), 1.0)
        less = chance(entry["probability"]) != chance(place) and entry["probability"] < place
        return f"; {'less likely, but not ruled out' if less else 'as likely'}"
    known = effect.contender.rivals if effect.contender else ()
    is_open = rival["delta_bic"] < decides or any(x.id == rival["id"] and x.reach for x in known)
    return f"; next best {rival['id']}, {'not ' if is_open else ''}ruled out"


def _line(heading: str, text: str) -> Iterator[str]:
    first = f"{heading:<{INDENT - 1}} "
    yield from textwrap.wrap(
        text,
        WIDTH,
        initial_indent=first,
        subsequent_indent=" " * INDENT,
        break_on_hyphens=False,
        break_long_words=False,
    )
