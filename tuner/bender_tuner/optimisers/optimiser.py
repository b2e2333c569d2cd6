"""What the outside sees of every search: ask for a point, tell its value."""

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


class Optimiser(Protocol):
    """A search for the smallest value of an objective that the caller evaluates.

    Attributes:
        best_x: the best point told so far, shape (d,); NaN before the first one.
        best_f: its value; inf before the first one.
        evaluations: how many values were told.
    """

    @property
    def best_x(self) -> "NDArray[np.float64]": ...  # noqa: D102

    @property
    def best_f(self) -> float: ...  # noqa: D102

    @property
    def evaluations(self) -> int: ...  # noqa: D102

    def ask(self) -> "NDArray[np.float64]":
        """The next point to evaluate, shape (d,); the same one until its value is told. Never runs out."""
        ...

    def tell(self, x: "NDArray[np.float64]", f: float) -> None:
        """Answer the last `ask` with the value at `x`; inf and NaN both mean "as bad as can be"."""
        ...

    def close(self) -> None:
        """Release what the search holds (a helper thread at most). The best point stays readable."""
        ...
