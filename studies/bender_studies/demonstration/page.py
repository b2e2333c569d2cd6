"""One HTML file that needs nothing beside it: pictures inline, no links to elsewhere, light and dark."""

import base64
import html
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from bender_loop.shell.progress import Cell


@dataclass(frozen=True, slots=True)
class Picture:
    """A PNG picture; `alt` says in words what is to be seen."""

    png: bytes
    alt: str


@dataclass(frozen=True, slots=True)
class Table:
    """A table; the first row of the body may be set off as the one that matters."""

    columns: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    stress_first: bool = False


@dataclass(frozen=True, slots=True)
class Section:
    """A heading and what stands below it, in this order; `code` is shown as it is."""

    heading: str
    paragraphs: Sequence[str] = ()
    table: Table | None = None
    picture: Picture | None = None
    remarks: Sequence[str] = ()
    code: str = ""


@dataclass(frozen=True, slots=True)
class Card:
    """A key figure, what it is, and what to compare it with."""

    figure: str
    meaning: str
    beside: str = ""


@dataclass(frozen=True, slots=True)
class Page:
    """The whole page."""

    title: str
    lead: str
    cards: Sequence[Card]
    sections: Sequence[Section]


def render(page: Page) -> str:
    """The page as HTML; all text is escaped."""
    cards = "".join(_card(card) for card in page.cards)
    sections = "".join(_section(section) for section in page.sections)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f"<title>{html.escape(page.title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n<main>\n"
        f'<h1>{html.escape(page.title)}</h1>\n<p class="lead">{html.escape(page.lead)}</p>\n'
        f'<div class="cards">{cards}</div>\n{sections}</main>\n</body>\n</html>\n'
    )


def _card(card: Card) -> str:
    beside = f"<small>{html.escape(card.beside)}</small>" if card.beside else ""
    return f"<div><strong>{html.escape(card.figure)}</strong><span>{html.escape(card.meaning)}</span>{beside}</div>"


def _section(section: Section) -> str:
    parts = [f"<h2>{html.escape(section.heading)}</h2>", _paragraphs(section.paragraphs)]
    if section.table is not None:
        parts.append(_table(section.table))
    if section.picture is not None:
        data = base64.b64encode(section.picture.png).decode("ascii")
        alt = html.escape(section.picture.alt, quote=True)
        parts.append(f'<figure><img alt="{alt}" src="data:image/png;base64,{data}"></figure>')
    parts.append(_paragraphs(section.remarks, "remark"))
    if section.code:
        parts.append(f"<pre>{html.escape(section.code)}</pre>")
    return f"<section>{''.join(parts)}</section>\n"


def _paragraphs(paragraphs: Iterable[str], kind: str = "") -> str:
    attribute = f' class="{kind}"' if kind else ""
    return "".join(f"<p{attribute}>{html.escape(paragraph)}</p>" for paragraph in paragraphs)


def _table(table: Table) -> str:
    head = "".join(f"<th>{html.escape(column)}</th>" for column in table.columns)
    rows = []
    for place, row in enumerate(table.rows):
        kind = ' class="first"' if table.stress_first and place == 0 else ""
        rows.append(f"<tr{kind}>" + "".join(f"<td>{html.escape(_text(cell))}</td>" for cell in row) + "</tr>")
    return f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{"".join(rows)}</tbody></table></div>'


def _text(cell: Cell) -> str:
    if cell is None:
        return "–"
    return f"{cell:.3g}" if isinstance(cell, float) else str(cell)


# The pictures are drawn on white; a dark page turns them over and keeps their hues.
_STYLE = """
:root{--paper:#fff;--ink:#2b2b2b;--soft:#6b6b6b;--line:#e3e3e3;--card:#f5f7f7;--stress:#00798c}
*{box-sizing:border-box}
body{margin:0;background:var(--paper);color:var(--ink);font:16px/1.55 system-ui,"Segoe UI",Roboto,sans-serif}
main{max-width:62rem;margin:0 auto;padding:2.5rem 1.25rem 4rem}
h1{font-size:1.9rem;line-height:1.2;margin:0 0 .6rem;text-wrap:balance}
h2{font-size:1.25rem;line-height:1.3;margin:0 0 .6rem;text-wrap:balance}
.lead{font-size:1.1rem;color:var(--soft);max-width:46rem;margin:0 0 1.6rem}
section{margin-top:3rem;border-top:1px solid var(--line);padding-top:1.6rem}
p{max-width:46rem;margin:.5rem 0}
.remark{color:var(--soft);font-size:.92rem}
.cards{display:grid;grid-template-columns:repeat(auto-fit,minmax(11rem,1fr));gap:.8rem}
.cards div{background:var(--card);border-radius:.6rem;padding:.9rem 1rem;display:flex;flex-direction:column}
.cards strong{font-size:1.7rem;line-height:1.2;color:var(--stress);font-variant-numeric:tabular-nums}
.cards small{color:var(--soft)}
figure{margin:1.2rem 0}
img{width:100%;height:auto;display:block;border-radius:.3rem}
.wide{overflow-x:auto;margin:1rem 0}
table{border-collapse:collapse;width:100%;font-size:.94rem;font-variant-numeric:tabular-nums}
th,td{padding:.4rem .7rem;text-align:right;border-bottom:1px solid var(--line);white-space:nowrap}
th:first-child,td:first-child{text-align:left}
th{color:var(--soft);font-weight:600}
.first td{font-weight:650;color:var(--stress)}
pre{background:var(--card);border-radius:.6rem;padding:.9rem 1rem;white-space:pre-wrap;font-size:.86rem;line-height:1.5}
@media (prefers-color-scheme:dark){
:root{--paper:#1a1a1a;--ink:#e4e4e4;--soft:#a3a3a3;--line:#383838;--card:#252726;--stress:#4fc3d4}
img{filter:invert(.9) hue-rotate(180deg)}
}
@media print{section{break-inside:avoid}}
"""
