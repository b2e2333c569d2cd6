"""What a watch holds in hand: rows beside what is expected of them, and an alarm that waits."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bender_watch.follow.rows import Rows
from bender_watch.sequential.detector import Exceedance

Array = NDArray[np.float64]
Event = dict[str, Any]


@dataclass(slots=True)
class Pending:
    """An alarm that waits for its explanation by so many rows since the change, or until the reading moves again."""

    event: Event
    exceedance: Exceedance
    first_row: int
    rows: int
    stands: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Rows beside what is expected of them.

    `columns_um` has what is not known of a record, the drift, and last a doubt; `steps` the time before each row in
    lengths of the drift; `gaps` has `GAP` for a row behind one.
    """

    rows: Rows
    expected_um: Array
    signatures_um: Array
    residual_um: Array
    columns_um: Array
    steps: Array
    spread: Array
    beyond: NDArray[np.bool_]
    gaps: NDArray[np.int64]

    def part(self, where: slice) -> "Block":
        """Return some of the rows."""
        return Block(
            self.rows.part(where), self.expected_um[where], self.signatures_um[where], self.residual_um[where],
            self.columns_um[where], self.steps[where], self.spread[where], self.beyond[where], self.gaps[where],
        )  # fmt: skip
