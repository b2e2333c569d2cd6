"""The page of the gallery: a section for each rig, with a link to its report."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from bender_report.page import Card, Link, Page, Section, Table
from bender_report.wording import listed, quantity
from bender_studies.gallery.rig_diagnosis import MODEL, RECORD, RigDiagnosis

if TYPE_CHECKING:
    from bender_proving.gallery import PublishedRig

MISSING = "its model lacks"
COLUMNS = ("rig", MISSING, "the workflow says", "recalibrated", "corrected", "noise", "s")


def row(shown: RigDiagnosis, seconds: float) -> list[str]:
    """Return a rig as a row of the table."""
    unit = shown.unit
    figures = (quantity(x, unit, 3) for x in (shown.before, shown.after, shown.noise))
    return [shown.rig, shown.missing, in_short(shown), *figures, f"{seconds:.0f}"]


def in_short(shown: RigDiagnosis) -> str:
    """Return a verdict with the effects that it is about."""
    if shown.verdict == "ambiguous":
        return f"ambiguous: {listed(list(shown.listed), 'or')}"
    rest = "" if shown.complete else ", something stays unexplained"
    return f"{shown.verdict}: {' + '.join(shown.added)}{rest}" if shown.added else shown.verdict


def tell(played: Sequence[tuple["PublishedRig", RigDiagnosis, float]], *, report: str) -> Page:
    """Return the page.

    Args:
        played: rigs that were simulated, what the workflow says of each, and the seconds that took.
        report: the file name of a report in the folder of its rig.
    """
    right = sum(x.is_right for _, x, _ in played)
    cards = [Card(f"{right} of {len(played)}", "simulated rigs on which the workflow says what they have")]
    sections = [_section(rig, shown, report) for rig, shown, _ in played]
    return Page(
        title="Rigs of other fields, and what the workflow says of them",
        lead="Each rig is simulated from its published equations and diagnosed with the linear model that its authors "
        "give. The diagnosis is not told what that model lacks. A rig for whose effect the catalogue has no word "
        "counts as right where the workflow says that something stays unexplained.",
        cards=cards,
        sections=[
            Section("In short", table=Table(*_without_missing([row(x, seconds) for _, x, seconds in played]))),
            *sections,
        ],
    )


def _without_missing(rows: list[list[str]]) -> tuple[list[str], list[list[str]]]:
    """Return columns and rows without what the models lack, which the sections say: on a page it is too wide."""
    kept = [k for k, name in enumerate(COLUMNS) if name != MISSING]
    return [COLUMNS[k] for k in kept], [[one[k] for k in kept] for one in rows]


def _section(rig: "PublishedRig", shown: RigDiagnosis, report: str) -> Section:
    heading = f"{rig.title[0].upper()}{rig.title[1:]}"
    model = [f"gain {rig.gain:.4g} {rig.reading[1]}/{rig.drive[1]}"]
    model += [f"a lag of {x:.4g} s" for x in rig.lags_s]
    model += [f"a mode of {rig.mode[0]:.4g} Hz, damping ratio {rig.mode[1]:.3g}"] if rig.mode else []
    return Section(
        heading,
        paragraphs=(
            f"From {rig.drive[0]} ({rig.drive[1]}) to {rig.reading[0]} ({rig.reading[1]}). "
            f"The model: {listed(model)}. It lacks {rig.missing}.",
            f"The workflow says {in_short(shown)}. {shown.sentence}",
        ),
        remarks=(f"Equations: {rig.source}.",),
        links=_links(rig.name, report, RECORD, MODEL),
    )


def _links(folder: str, *files: str) -> tuple[Link, ...]:
    return tuple(Link(x, f"{folder}/{x}") for x in files)
