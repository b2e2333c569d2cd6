"""The page maker: one HTML file that needs nothing beside it, light and dark, on a desk, on a phone and on paper."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bender_loop.shell.progress import Cell
from bender_loop.shell.run import provenance_line
from bender_report.chart import Chart
from bender_report.palette import variables

TEMPLATES = Path(__file__).parent / "templates"


@dataclass(frozen=True, slots=True)
class Picture:
    """A PNG file, or a chart that fits a desk and a phone; `alt` says in words what is to be seen."""

    image: bytes | Chart
    alt: str

    @property
    def chart(self) -> Chart | None:
        """The chart; None for a PNG file."""
        return self.image if isinstance(self.image, Chart) else None


@dataclass(frozen=True, slots=True)
class Table:
    """A table; `stressed` rows matter most, `marked` cells (row, column) ask for care."""

    columns: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    stressed: frozenset[int] = frozenset()
    marked: frozenset[tuple[int, int]] = frozenset()


@dataclass(frozen=True, slots=True)
class Link:
    """A file that lies beside the page or below it; `file` is relative to the page, with forward slashes."""

    text: str
    file: str


@dataclass(frozen=True, slots=True)
class Section:
    """A heading and what stands below it, in this order; `code` is shown as it is."""

    heading: str
    paragraphs: Sequence[str] = ()
    table: Table | None = None
    picture: Picture | None = None
    remarks: Sequence[str] = ()
    code: str = ""
    formula: str = ""
    bullets: Sequence[str] = ()
    links: Sequence[Link] = ()


@dataclass(frozen=True, slots=True)
class Card:
    """A key figure, what it is, and what to compare it with."""

    figure: str
    meaning: str
    beside: str = ""


@dataclass(frozen=True, slots=True)
class Page:
    """A page of sections."""

    title: str
    lead: str
    cards: Sequence[Card]
    sections: Sequence[Section]


def render(page: Page) -> str:
    """Return a page of sections as HTML; all text is escaped."""
    return render_template("sections.html.j2", title=page.title, page=page)


def render_template(template: str, folder: Path | None = None, own_css: str = "", **values: Any) -> str:
    """Return a page from a template that extends `base.html.j2`; its last line is the provenance of the run.

    Args:
        template: its file name.
        folder: where it stands; None for the templates here.
        own_css: style that this page has beside the common one.
        **values: what the template shows; `title` among them.
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    places = [TEMPLATES] if folder is None else [folder, TEMPLATES]
    environment = Environment(loader=FileSystemLoader(places), autoescape=True, undefined=StrictUndefined)
    environment.trim_blocks = environment.lstrip_blocks = True
    environment.filters["capitalize_first"] = lambda text: text[:1].upper() + text[1:]
    environment.filters["cell"] = cell_text
    environment.filters["base64"] = lambda data: base64.b64encode(data).decode("ascii")
    css = (TEMPLATES / "base.css").read_text(encoding="utf-8") + own_css
    return environment.get_template(template).render(
        light=variables(dark=False), dark=variables(dark=True), css=css, made=provenance_line(), **values
    )


def cell_text(cell: Cell) -> str:
    """Return the text of a cell: three digits of a float, a dash for nothing."""
    if cell is None:
        return "–"
    return f"{cell:.3g}".replace("-", "−") if isinstance(cell, float) else str(cell)
