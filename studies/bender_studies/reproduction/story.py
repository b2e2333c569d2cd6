"""The exhibits as sections of one page."""

from collections.abc import Sequence

from bender_report.page import Card, Page, Section, Table
from bender_studies.reproduction.document import cells, counted
from bender_studies.reproduction.exhibit import Exhibit

COLUMNS = ("quantity", "unit", "paper", "paper mode", "ours")


def tell(exhibits: Sequence[Exhibit], bench: str, took_s: float) -> Page:
    """The whole page."""
    met, held = counted(exhibits)
    rows = sum(len(exhibit.rows) for exhibit in exhibits)
    return Page(
        title="The paper's numbers beside ours",
        lead="Every table, figure and number of M. Musa and U. Wejinya, Data-Driven Hysteresis Modeling and Optimized "
        "PID Control for A Piezoelectric Bending Microactuator (2024): as printed, by the paper's own way taken "
        "literally (paper mode), and by ours. All but the printed column was computed in one run.",
        cards=[
            Card(f"{met} of {held}", "printed results come out to their last digit", "in paper mode"),
            Card(f"{rows}", "quantities computed", f"in {len(exhibits)} tables, figures and equations"),
            Card(f"{took_s:.0f} s", "for all of them", "command: bender reproduce"),
        ],
        sections=[*(_section(exhibit) for exhibit in exhibits), _how(bench)],
    )


def _section(exhibit: Exhibit) -> Section:
    told = [row.remark for row in exhibit.rows if row.remark]
    return Section(
        heading=f"{exhibit.name}: {exhibit.finding}",
        paragraphs=[f"Paper mode: {exhibit.paper_mode_is}.", f"Ours: {exhibit.ours_is}."],
        table=Table(COLUMNS, [cells(row) for row in exhibit.rows]),
        picture=exhibit.picture,
        remarks=[*map(_sentence, told), *exhibit.remarks],
    )


def _how(bench: str) -> Section:
    return Section(
        "How to read this, and how to do it again",
        [
            "✓ marks a number that rounds to the printed digits. A dash: there is nothing to set there. never: the "
            "response did not get there in the time that was run.",
            f"Experiments: {bench}.",
            "The same numbers with the place of each in the paper are in reproduction.json, the recordings in the "
            "folder records.",
        ],
        code="bender reproduce",
    )


def _sentence(remark: str) -> str:
    return f"{remark[:1].upper()}{remark[1:]}."
