"""The exhibits as data for a JSON file, and as the lines of the terminal's table."""

from collections.abc import Sequence

from bender_loop.shell.files import result_text
from bender_loop.shell.progress import Cell
from bender_studies.reproduction.exhibit import Exhibit, Printed, Row, Shown

COLUMNS = ("exhibit", "quantity", "unit", "paper", "paper mode", "ours")
MET = " ✓"


def to_json(exhibits: Sequence[Exhibit], seed: int, bench: str, measured: bool) -> str:
    """Everything but the pictures; `bench` says what the experiments ran on."""
    found = {
        "paper": "M. Musa and U. Wejinya 2024",
        "seed": seed,
        "experiments": bench,
        "published_points_used": measured,
        "exhibits": [
            {
                "name": exhibit.name,
                "finding": exhibit.finding,
                "paper_mode_is": exhibit.paper_mode_is,
                "ours_is": exhibit.ours_is,
                "rows": [_row(row) for row in exhibit.rows],
                "remarks": list(exhibit.remarks),
            }
            for exhibit in exhibits
        ],
    }
    return result_text(found)


def lines(exhibits: Sequence[Exhibit]) -> list[list[Cell]]:
    """One line for each row, in the order of `COLUMNS`."""
    return [[exhibit.name, *cells(row)] for exhibit in exhibits for row in exhibit.rows]


def cells(row: Row) -> list[Cell]:
    """Quantity, unit and the three columns; a tick where a number rounds to the printed digits."""
    printed = None if row.paper is None else row.paper.text
    return [row.quantity, row.unit, printed, _cell(row, row.paper_mode), _cell(row, row.ours)]


def counted(exhibits: Sequence[Exhibit]) -> tuple[int, int]:
    """How many printed results the paper's own way meets in one reading at least, and how many it was held against."""
    met: dict[Printed, bool] = {}
    for exhibit in exhibits:
        for row in exhibit.rows:
            if row.paper is not None and row.paper_mode_meets_paper is not None:
                met[row.paper] = met.get(row.paper, False) or row.paper_mode_meets_paper
    return sum(met.values()), len(met)


def _cell(row: Row, value: Shown) -> str | None:
    if value is None or isinstance(value, str):
        return value
    tick = MET if row.paper is not None and row.paper.is_met_by(value) else ""
    return f"{value:.4g}{tick}"


def _row(row: Row) -> dict[str, object]:
    paper = row.paper
    return {
        "quantity": row.quantity,
        "unit": row.unit,
        "paper": None if paper is None else {"printed": paper.text, "value": paper.value, "place": paper.place},
        "paper_mode": row.paper_mode,
        "ours": row.ours,
        "paper_mode_meets_paper": row.paper_mode_meets_paper,
        "remark": row.remark,
    }
