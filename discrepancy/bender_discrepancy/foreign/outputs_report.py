"""What several outputs say of one FMU, told: a sentence, the content of `outputs.json`, and the page."""

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bender_discrepancy.conclusion.findings import SIGNIFICANT, RecalibratedNumber
from bender_discrepancy.conclusion.sentences import title_of
from bender_discrepancy.foreign.joint_explanations import EACH_BY_ITSELF, JointExplanation
from bender_discrepancy.foreign.outputs import Together
from bender_loop.tables.quantities import USUAL
from bender_plant.parameter import meanings
from bender_report.number import Number
from bender_report.wording import (
    HALF_WIDTH,
    IN_WORDS,
    figure,
    listed,
    quantity,
    shown_in,
    uncertain,
    unit_text,
    with_interval,
)

if TYPE_CHECKING:
    from bender_discrepancy.diagnosis import Diagnosis
    from bender_report.page import Page, Section

OUTPUTS, REPORT = "outputs.json", "report.html"
_UNIT = re.compile(r"_(?:um|V|s|Hz|V_s|um_per_V|V_per_s)(?=\[|$)")
_ODD = re.compile(r"[^\w.-]")
ALIKE = 0.005
"""Part of a factor by which two may differ in any case: what a stand-in for the FMU leaves."""
ON_THE_INPUT, NOT_NEEDED = "the input, which all outputs share", "none: not needed with all outputs together"
MOST_WAYS = 8
"""In the page; `outputs.json` has all of them."""


def titles(effects: "frozenset[str] | tuple[str, ...]") -> str:
    """Return the titles of effects as they stand in a sentence."""
    return listed([title_of(x) for x in sorted(effects)]) if effects else "nothing"


def _titles(found: Together, effects: "frozenset[str] | tuple[str, ...]") -> str:
    """Return the titles of effects in the words of the device: one output that no bender has makes it another one."""
    rigs = [x.quantities[:2] for x in found.by_itself.values()]
    with shown_in(*next((x for x in rigs if x != USUAL[:2]), USUAL[:2])):
        return titles(effects)


def sentence(found: Together) -> str:
    """Return the verdict on all outputs in a sentence."""
    rivals = found.ranked.rivals()
    if rivals:
        ways = [_titles(found, x.effects) for x in (found.best, *rivals)]
        return f"What acts on the input stays open, also with all outputs together: {listed(ways, 'or')}."
    if found.best.each:
        parts = [f"{name}: {_titles(found, own)}" for name, own in found.own.items()]
        return f"No correction of the input explains all outputs; each has its own: {'; '.join(parts)}."
    parts = []
    if found.best.effects:
        parts.append(f"{_titles(found, found.best.effects)} on the input, which all outputs share")
    parts += [f"{_titles(found, own)} on {name} alone" for name, own in found.own.items() if own]
    parts += [f"{_titles(found, inside)} inside the FMU, as {name} shows" for name, inside in found.inside.items()]
    moved = [f"{name} is {figure(x, 4)} in place of {figure(was, 4)}" for name, was, x, *_ in found.parameters]
    moved += factors(
        {n: x for n, alone in found.by_itself.items() for x in alone.findings.recalibrated if x.name == "gain"},
        len(found.by_itself),
    )
    if moved and found.verdict in ("named", "recalibrated"):
        missing = f"; missing from the model: {'; '.join(parts)}" if parts else ", and nothing else is missing"
        return f"Off: {'; '.join(moved)}{missing}."
    if parts:
        return f"Missing from the model: {'; '.join(parts)}."
    if found.verdict == "unexplained":
        return "Something is missing that no effect of the catalogue explains."
    return "Nothing is missing on any output."


def factors(gains: Mapping[str, RecalibratedNumber], outputs: int) -> list[str]:
    """Return what the factors of the readings say: one that all outputs share is a gain of the input.

    Args:
        gains: the recalibrated gain of each output that has one, by its name.
        outputs: how many outputs there are.
    """
    told = list(gains.values())
    if len(told) == outputs > 1 and all(_agree(told[0], x) for x in told[1:]):
        least = min(told, key=lambda x: x.std)
        return [f"every output reads {figure(least.after, 4)} times as much, as if the input did"]
    return [f"the sensor of {name} reads {figure(x.after, 4)} times as much" for name, x in gains.items()]


def _agree(one: RecalibratedNumber, other: RecalibratedNumber) -> bool:
    """Return whether two factors differ by no more than they leave open, or by hardly anything."""
    apart, open_ = abs(one.after - other.after), math.hypot(one.std, other.std)
    known = open_ if math.isfinite(open_) else 0.0
    return apart <= max(SIGNIFICANT * known, ALIKE * abs(one.after))


def content(found: Together, folders: Mapping[str, str]) -> dict[str, Any]:
    """Return the content of `outputs.json`.

    Args:
        found: what is told.
        folders: where the diagnosis of each output is, by its name.
    """
    best = found.best
    stages = best.shared.stages
    return {
        "verdict": found.verdict,
        "sentence": sentence(found),
        "complete": found.complete,
        "parameters": {
            name: {"before": was, "after": now, "std": std, "unit": unit}
            for name, was, now, std, unit in found.parameters
        },
        "input": {
            "effects": list(best.shared.effects),
            "parameters": {} if stages is None else _numbers(stages.values(), best.shared.effects),
            "numbers_of": list(best.source),
            "each_by_itself": best.each,
        },
        "outputs": {name: _output(found, name, folders[name]) for name in found.by_itself},
        "ways": [_way(x, best) for x in found.ranked.ways],
        "threshold": found.ranked.threshold,
        "fmu": "model.fmu" if found.files else None,
        "no_fmu": found.why_no_fmu,
        "notes": list(found.notes),
    }


def folders_of(names: Sequence[str]) -> dict[str, str]:
    """Return the folder of each output, by its name."""
    return {name: _ODD.sub("_", name) for name in names}


def write(found: Together, folders: Mapping[str, str], out: Path) -> None:
    """Write what all outputs say together: `outputs.json`, the page, the corrected FMU of all and what is beside it."""
    from bender_loop.shell.files import write_atomically, write_result
    from bender_report.page import render

    write_result(out / OUTPUTS, content(found, folders))
    write_atomically(out / REPORT, render(page(found, folders)))
    for name, data in found.files.items():
        write_atomically(out / name, data)


def _numbers(values: Mapping[str, float], effects: tuple[str, ...]) -> dict[str, float]:
    return {name: value for name, value in values.items() if name.partition(".")[0] in effects}


def _output(found: Together, name: str, folder: str) -> dict[str, Any]:
    alone = found.by_itself[name]
    behind = found.best.behind.get(name)
    stages = None if behind is None else behind.stages
    return {
        "folder": folder,
        "by_itself": {
            "verdict": alone.verdict,
            "complete": alone.is_complete,
            "effects": [x.id for x in alone.added],
            "rivals": [x.id for x in alone.effects if x not in alone.added],
        },
        "on_this_output_alone": list(found.own[name]),
        "parameters": {} if stages is None else _numbers(stages.values(), found.own[name]),
        "unit": alone.quantities.reading,
        "gap": {
            "recalibrated": alone.gap.recalibrated.rms_um,
            "by_itself": alone.gap.after.rms_um,
            "together": found.after.get(name),
            "noise_floor": alone.gap.floor_um,
        },
    }


def _way(way: JointExplanation, best: JointExplanation) -> dict[str, Any]:
    return {
        "input": EACH_BY_ITSELF if way.each else sorted(way.effects),
        "numbers_of": list(way.source),
        "behind": {name: list(x.effects) for name, x in way.behind.items()},
        "criterion": way.cost - best.cost,
    }


def summary(found: Together) -> list[str]:
    """Return the lines for a terminal."""
    verdict = found.verdict if found.complete or found.verdict != "named" else f"{found.verdict}, not complete"
    lines = [f"{verdict}: {sentence(found)}", *_found_lines(found)]
    for name, was, now, std, unit in found.parameters:
        of = "" if unit == "1" else f" {unit_text(unit)}"
        lines.append(f"{name} of the FMU, by all outputs: {figure(was, 4)} to {uncertain(now, HALF_WIDTH * std)}{of}")
    lines += [IN_WORDS] if len(lines) > 1 else []
    for name, alone in found.by_itself.items():
        unit = alone.quantities.reading
        left = [quantity(x, unit) for x in (alone.gap.recalibrated.rms_um, alone.gap.after.rms_um)]
        together = f", together {quantity(found.after[name], unit)}" if name in found.after else ""
        effects = listed([x.id for x in alone.added]) if alone.added else "no effect"
        lines.append(f"{name} by itself: {alone.verdict}, {effects}; held-out gap {left[0]} to {left[1]}{together}")
    left = [
        f"{name} {quantity(x, unit)} (noise {quantity(alone.gap.floor_um, unit)})"
        for name, alone in found.by_itself.items()
        if (x := found.after.get(name)) is not None and (unit := alone.quantities.reading)
    ]
    lines += [f"left with all outputs together: {', '.join(left)}"] if left else []
    if found.why_no_fmu:
        lines.append(f"no corrected FMU of all outputs: {found.why_no_fmu}")
    lines += [f"note: {x}" for x in found.notes]
    return lines


def _found_lines(found: Together) -> list[str]:
    """Return each number of what the verdict has, with its deviation: of what all outputs share, those taken."""
    lines = []
    for name, alone in found.by_itself.items():
        numbers = _number_rows(found, name, alone)
        if found.best.source and name not in found.best.source:
            numbers = [x for x in numbers if x[-1] != ON_THE_INPUT]
        for effect, number, value, by, place in (*_joint_rows(found, name, alone), *numbers):
            if place != NOT_NEEDED:
                lines.append(f"{effect}: {number} {value}, acts on {place} (by the readings of {by})")
    return lines


def page(found: Together, folders: Mapping[str, str]) -> "Page":
    """Return the page: all outputs together, and a link to the report of each."""
    from bender_report.page import Card, Link, Page, Section, Table

    rows = []
    for name, alone in found.by_itself.items():
        unit, gap = alone.quantities.reading, alone.gap
        figures = [gap.recalibrated.rms_um, gap.after.rms_um, found.after.get(name), gap.floor_um]
        told = ["–" if x is None else quantity(x, unit, 3) for x in figures]
        rows.append(
            [
                name,
                alone.verdict,
                _titles(found, tuple(x.id for x in alone.added)),
                _titles(found, found.own[name]),
                *told,
            ]
        )
    columns = ["output", "by itself", "found", "of it alone", "recalibrated", "by itself", "together", "noise"]
    numbers = [
        row
        for name, alone in found.by_itself.items()
        for row in (*_joint_rows(found, name, alone), *_number_rows(found, name, alone))
        if row[-1] != NOT_NEEDED
    ]
    ways = [_way_row(found, x) for x in found.ranked.ways[:MOST_WAYS]]
    stressed = next((k for k, x in enumerate(found.ranked.ways[:MOST_WAYS]) if x is found.best), 0)
    files = [Link(x, x) for x in found.files]
    return Page(
        title="Several outputs of one FMU",
        lead=sentence(found),
        cards=[
            Card(found.verdict, "what all outputs say together"),
            Card(_titles(found, found.best.effects), "acts on the input that they share"),
        ],
        sections=[
            Section(
                "Each output",
                paragraphs=("Gaps are the rms on held-out readings.",),
                table=Table(columns, rows),
                links=[Link(f"report of {name}", f"{folder}/{REPORT}") for name, folder in folders.items()],
            ),
            *([_found_section(numbers)] if numbers else []),
            Section(
                "What was weighed",
                paragraphs=(
                    "An effect on the input must act on every output. Each explanation was put before the FMU, and all "
                    "outputs were simulated with it. The criterion is computed from all readings together; a "
                    f"difference below {figure(found.ranked.threshold, 2)} decides nothing.",
                ),
                table=Table(["on the input", "numbers of", "behind the outputs", "criterion"], ways,
                    stressed=frozenset({stressed})),
                remarks=_remarks(found),
                links=files,
            ),
        ],
    )  # fmt: skip


def _remarks(found: Together) -> tuple[str, ...]:
    none = (f"There is no corrected FMU of all outputs: {found.why_no_fmu}.",) if found.why_no_fmu else ()
    return (*none, *(f"{x[0].upper()}{x[1:]}." for x in found.notes))


def _found_section(rows: Sequence[Sequence[str]]) -> "Section":
    from bender_report.page import Section, Table

    return Section(
        "What was found, by its numbers",
        paragraphs=(f"By the readings of one output, or of all together; {IN_WORDS}.",),
        table=Table(["effect", "number", "value", "by the readings of", "acts on"], rows),
    )


def _number_rows(found: Together, name: str, alone: "Diagnosis") -> list[list[str]]:
    """Return effect, number, value, output and place of all that one output found by itself."""
    with shown_in(*alone.quantities[:2]):
        return [
            [title_of(x.id), _plain(n.name), _value(n), name, _place(found, name, x.id)]
            for x in alone.added
            for n in x.numbers
        ]


def joint_numbers(found: Together, name: str) -> list[tuple[str, Number]]:
    """Return effects and numbers of what acts on one output alone by all outputs together, and not by itself."""
    own, known = found.best.behind.get(name), {x.id for x in found.by_itself[name].added}
    if own is None or own.stages is None or found.best.each:
        return []
    return [
        (block.id, Number(field, value, meaning.unit))
        for block in own.stages.blocks
        if block.id in own.effects and block.id not in known
        for field, meaning in meanings(block.parameters).items()
        if isinstance(value := getattr(block.parameters, field), float) and value != 0.0
    ]


def _joint_rows(found: Together, name: str, alone: "Diagnosis") -> list[list[str]]:
    with shown_in(*alone.quantities[:2]):
        return [
            [title_of(effect), _plain(n.name), _value(n), "all outputs together", f"{name} alone"]
            for effect, n in joint_numbers(found, name)
        ]


def _plain(number: str) -> str:
    """Return the name of a number without its unit, which stands beside the value."""
    return _UNIT.sub("", number).replace("_", " ")


def _value(number: "Number") -> str:
    known = number.interval is not None
    return with_interval(number) if known else quantity(number.value, number.unit, 4)


def _place(found: Together, name: str, effect: str) -> str:
    if effect in found.inside.get(name, ()):
        return "inside the FMU"
    if effect in found.best.effects:
        return ON_THE_INPUT
    return f"{name} alone" if effect in found.own.get(name, ()) else NOT_NEEDED


def _way_row(found: Together, way: JointExplanation) -> list[str]:
    behind = [f"{name}: {_titles(found, x.effects)}" for name, x in way.behind.items() if x.effects]
    first = EACH_BY_ITSELF if way.each else _titles(found, way.effects)
    return [first, listed(list(way.source)) if way.source else "–", "; ".join(behind) or "nothing",
            f"{way.cost - found.best.cost:+.1f}"]  # fmt: skip
