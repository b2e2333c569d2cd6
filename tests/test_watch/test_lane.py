"""What the picture of a watch is drawn from: extremes by stretches, however the rows arrive."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from bender_watch.lane import MOST, Lane


@given(
    count=st.integers(1, 40_000),
    cuts=st.lists(st.integers(1, 5000), min_size=1, max_size=6),
    seed=st.integers(0, 2**32 - 1),
)
def test_every_row_lies_in_its_stretch_however_the_rows_arrive(count: int, cuts: list[int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    time_s, innovations, tops = np.arange(count, dtype=float), rng.standard_normal(count), rng.random(count)
    innovations[rng.random(count) < 0.1] = np.nan
    lane, begin, k = Lane(), 0, 0
    while begin < count:
        part = slice(begin, begin + cuts[k % len(cuts)])
        lane.add(time_s[part], innovations[part], tops[part])
        begin, k = part.stop, k + 1
    assert len(lane.table) <= MOST
    assert len(lane.table) == -(-count // lane.size)
    assert count == (len(lane.table) - 1) * lane.size + lane.filled
    for i, (first_s, lowest, highest, top) in enumerate(lane.table[:: max(len(lane.table) // 20, 1)]):
        begin = i * max(len(lane.table) // 20, 1) * lane.size
        rows = slice(begin, begin + lane.size)
        assert (first_s, top) == (time_s[begin], tops[rows].max())
        known = innovations[rows][np.isfinite(innovations[rows])]
        assert (lowest, highest) == (known.min(), known.max()) if known.size else np.isnan([lowest, highest]).all()


def test_what_is_kept_does_not_grow_with_the_rows() -> None:
    lane, rows = Lane(), np.zeros(50_000)
    for _ in range(100):
        lane.add(rows, rows, rows)
    assert lane.table.nbytes <= MOST * 4 * 8
    assert set(Lane.__slots__) == {"table", "size", "filled"}
