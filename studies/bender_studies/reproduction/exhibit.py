"""What an exhibit is: rows of three columns, the paper's, its way taken literally, and ours."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal

from bender_report.page import Picture

Shown = float | str | None
"""What stands in a cell: a number, words, or nothing."""


@dataclass(frozen=True, slots=True)
class Printed:
    """What the paper prints.

    Attributes:
        text: the figure with its printed digits, or the words where it gives no figure.
        place: where in the paper it stands.
    """

    text: str
    place: str

    @property
    def value(self) -> float | None:
        """The number; None for words."""
        try:
            return float(self.text)
        except ValueError:
            return None

    def is_met_by(self, found: Shown) -> bool | None:
        """Whether `found` rounds to the printed digits; None where there is no number to hold it against."""
        if self.value is None or not isinstance(found, float):
            return None
        exponent = Decimal(self.text).as_tuple().exponent
        half_a_digit = 0.5 * 10.0 ** float(exponent)
        return math.isfinite(found) and abs(found - self.value) <= half_a_digit * (1.0 + 1e-9)


@dataclass(frozen=True, slots=True)
class Row:
    """One quantity.

    Attributes:
        quantity: what it is, a few words.
        unit: of all three columns, empty for words and pure numbers.
        paper: as printed, None where the paper gives nothing.
        paper_mode: by the paper's own way.
        ours: by ours.
        remark: why the paper's figure cannot be had, or what the difference comes from; empty for nothing to say.
        given: the paper's number is where the computation starts, no result of it.
    """

    quantity: str
    unit: str
    paper: Printed | None
    paper_mode: Shown
    ours: Shown
    remark: str = ""
    given: bool = False

    @property
    def paper_mode_meets_paper(self) -> bool | None:
        """Whether the paper's own way results in the printed digits; None where that cannot be said."""
        return None if self.paper is None or self.given else self.paper.is_met_by(self.paper_mode)


@dataclass(frozen=True, slots=True)
class Exhibit:
    """A table, figure or equation of the paper.

    Attributes:
        name: as the paper calls it.
        finding: one sentence, the heading.
        paper_mode_is: what the column "paper mode" was computed by.
        ours_is: what the column "ours" was computed by.
        rows: the quantities.
        picture: None where the paper has none and ours needs none.
        remarks: further sentences.
    """

    name: str
    finding: str
    paper_mode_is: str
    ours_is: str
    rows: Sequence[Row]
    picture: Picture | None = None
    remarks: Sequence[str] = ()


def finite(value: float, otherwise: str) -> Shown:
    """A number, or words where it is none or beyond all bounds."""
    return value if math.isfinite(value) else otherwise
