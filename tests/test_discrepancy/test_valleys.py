"""Where a fit sets out: in valleys of the misfit, not twice in the same one."""

from collections.abc import Sequence

import pytest

from bender_discrepancy.fitting import starts
from bender_discrepancy.fitting.starts import Start


def kept(squares: dict[tuple[int, ...], float]) -> list[tuple[int, ...]]:
    found = {places: Start((), square) for places, square in squares.items()}
    return [places for places in found if starts._is_valley(found, places)]  # pyright: ignore[reportPrivateUsage]


@pytest.mark.parametrize(
    ("squares", "valleys"),
    [
        ([5.0, 3.0, 4.0, 6.0, 2.0, 7.0], [1, 4]),
        ([1.0, 2.0, 3.0], [0]),
        ([3.0, 2.0, 1.0], [2]),
        ([4.0], [0]),
        ([2.0, 2.0, 5.0], [0, 1]),
    ],
)
def test_a_start_with_a_better_neighbour_is_in_its_valley(squares: Sequence[float], valleys: Sequence[int]) -> None:
    assert kept({(k,): x for k, x in enumerate(squares)}) == [(k,) for k in valleys]


def test_neighbours_are_sought_along_every_axis() -> None:
    squares = {(0, 0): 1.0, (0, 1): 4.0, (1, 0): 3.0, (1, 1): 2.0}
    assert kept(squares) == [(0, 0), (1, 1)]


def test_a_start_that_could_not_be_simulated_is_no_neighbour() -> None:
    assert kept({(0,): 2.0, (2,): 1.0}) == [(0,), (2,)]
