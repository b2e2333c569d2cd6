"""Where the corrected model comes from: the records, and what was learned from them with its intervals."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from bender_discrepancy.conclusion.findings import Findings, RecalibratedNumber
from bender_discrepancy.conclusion.sentences import title_of
from bender_inference.records.record_names import distinct_names
from bender_plant.origin import Origin
from bender_report.number import Number
from bender_report.wording import HALF_WIDTH, relabelled, shown_in, unit_text

REPORT = "report.html"


def with_origin(findings: Findings, names: Sequence[str]) -> Findings:
    """Return findings whose corrected model says where it comes from; a model that was not changed says nothing new."""
    if findings.model is findings.search.base:
        return findings
    quantities = findings.search.records[0].quantities
    with shown_in(*quantities[:2]):
        numbers = tuple(_sentences(findings))
    origin = Origin(tuple(distinct_names(names)), numbers, quantities.command, quantities.reading, REPORT)
    return replace(findings, model=replace(findings.model, origin=origin))


def _sentences(findings: Findings) -> Iterator[str]:
    for effect in findings.simulated:
        for number in effect.numbers:
            yield f"{title_of(effect.id)}, {number.name}: {_value(number)}"
    for changed in findings.recalibrated:
        yield f"{changed.name}: {_change(changed)}"


def _value(number: Number) -> str:
    unit = _unit(number.unit)
    if number.interval is None:
        return f"{number.value:.5g}{unit}, interval not known"
    low, high = number.interval
    return f"{number.value:.5g}{unit}, with 95 % between {low:.5g} and {high:.5g}{unit}"


def _change(changed: RecalibratedNumber) -> str:
    unit = _unit(changed.unit)
    within = f" ± {HALF_WIDTH * changed.std:.2g} (95 %)" if changed.std < float("inf") else ""
    return f"{changed.after:.5g}{within}{unit}, before {changed.before:.5g}{unit}"


def _unit(unit: str) -> str:
    return "" if unit == "1" else f" {unit_text(relabelled(unit))}"
