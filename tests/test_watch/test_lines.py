"""Rows from bytes as they come."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_loop.errors import InputError
from bender_watch.follow.lines import Lines, Naming

PLAIN = Naming.of(None, None)
TEXT = "time_s,note,voltage_V,displacement_um\n" + "".join(
    f"{0.1 * k:.1f},x,{k},{'' if k % 4 == 0 else k / 7}\n" for k in range(20)
)


def rows_of(lines: Lines, text: str) -> np.ndarray:
    rows = lines.take(text)
    return np.zeros((0, 3)) if rows is None else np.column_stack([rows.time_s, rows.voltage_V, rows.displacement_um])


@given(st.lists(st.integers(1, 20), max_size=4))
def test_lines_in_parts_are_the_lines(cuts: list[int]) -> None:
    every = TEXT.splitlines(keepends=True)
    whole = rows_of(Lines("x.csv", PLAIN, strict=True), TEXT)
    lines = Lines("x.csv", PLAIN, strict=True)
    edges = [0, *sorted(set(cuts)), len(every)]
    parts = [rows_of(lines, "".join(every[a:b])) for a, b in pairwise(edges) if b > a]
    assert np.array_equal(np.concatenate(parts), whole, equal_nan=True)
    assert len(whole) == 20
    assert np.isnan(whole[::4, 2]).all()


@pytest.mark.parametrize(
    ("row", "place"),
    [
        ("0.05,x,1,1", "line 4, column time_s"),
        ("0.3,x,oops,1", "line 4, column voltage_V"),
        ("0.3,x", "line 4, column"),
    ],
)
def test_a_bad_row_is_named_or_left_out(row: str, place: str) -> None:
    text = f"time_s,note,voltage_V,displacement_um\n0.0,x,1,1\n0.1,x,1,1\n{row}\n0.4,x,2,2\n"
    with pytest.raises(InputError, match=place):
        Lines("x.csv", PLAIN, strict=True).take(text)
    lenient = Lines("x.csv", PLAIN, strict=False)
    assert rows_of(lenient, text)[-1].tolist() == [0.4, 2.0, 2.0]
    assert lenient.bad >= 1


@pytest.mark.parametrize("columns", ["time=t,voltage=u,displacement=y", "t,u,y"])
def test_other_names_and_units(columns: str) -> None:
    naming = Naming.of(columns, "ms,V,mm")
    found = rows_of(Lines("x.csv", naming, strict=True), "t,u,y\n0,1,0.5\n10,2,nan\n")
    assert found[0].tolist() == pytest.approx([0.0, 1.0, 500.0])
    assert found[1, 0] == pytest.approx(0.01)


@pytest.mark.parametrize(("columns", "units"), [("speed=v", None), ("time=", None), (None, "furlong,V,um")])
def test_what_is_no_column_or_unit_is_refused(columns: str | None, units: str | None) -> None:
    with pytest.raises(InputError, match="expected"):
        Naming.of(columns, units)


def test_a_missing_column_is_named() -> None:
    with pytest.raises(InputError, match="column voltage_V: no such column"):
        Lines("x.csv", PLAIN, strict=True).take("time_s,displacement_um\n0,1\n")
