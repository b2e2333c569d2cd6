"""Files, folders and streams that grow, their rows from bytes as they come, and events in words."""

import io
import json
import os
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_hil.log.read_run import GUARD, RUN
from bender_loop.errors import InputError
from bender_loop.tables.quantities import Quantities
from bender_watch.follow.heading import Naming
from bender_watch.follow.lines import LONGEST_LINE, Lines
from bender_watch.follow.sources import Arrival, Source
from bender_watch.words import forecast

HEAD = "time_s,voltage_V,displacement_um\n"


def text(first: int, last: int, reading: float = 1.0) -> str:
    return "".join(f"{k},1,{reading}\n" for k in range(first, last))


class _EndError(Exception):
    pass


def followed(path: Path, *acts: Callable[[], object], position: dict[str, object] | None = None) -> list[Arrival]:
    """Follow a path; at every pause the next act is done, and behind the last one the watch ends."""
    waiting = iter(acts)

    def wait(seconds: float) -> None:
        del seconds
        act = next(waiting, None)
        if act is None:
            raise _EndError
        act()

    source, found = Source([path], Naming(), follow=True, position=position or {}, wait=wait), []
    with pytest.raises(_EndError):
        found.extend(x for x in source.arrivals() if x.rows is not None or x.refused)
    return found


def told(arrivals: list[Arrival]) -> list[tuple[bool, list[float]]]:
    return [(x.begins, x.rows.time_s.tolist()) for x in arrivals if x.rows is not None]


def test_a_file_that_grows(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(HEAD + text(0, 2) + "2,1,")

    def more() -> None:
        with path.open("a") as file:
            file.write("1.0\n3,1,1\n")

    assert told(followed(path, more)) == [(True, [0.0, 1.0]), (False, [2.0, 3.0])]


@pytest.mark.skipif(os.name == "nt", reason="an open file keeps its name there")
def test_a_log_that_is_rotated_loses_no_row(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(HEAD + text(0, 3))

    def rotate() -> None:
        with path.open("a") as file:
            file.write(text(3, 5))
        path.rename(tmp_path / "a.csv.1")

    def begin() -> None:
        path.write_text(HEAD + text(5, 7))

    assert told(followed(path, rotate, begin)) == [(True, [0.0, 1.0, 2.0]), (False, [3.0, 4.0]), (True, [5.0, 6.0])]


@pytest.mark.parametrize("rows", [2, 40])
def test_a_file_that_is_written_over_is_another_record(rows: int, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(HEAD + text(0, 10))
    found = told(followed(path, lambda: path.write_text(HEAD + text(0, rows, 2.0))))
    assert found[1] == (True, [float(k) for k in range(rows)])


def test_a_watch_goes_on_in_the_same_file_and_not_in_another_one_of_its_name(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(HEAD + text(0, 10))
    position = json.loads(json.dumps(followed(path)[-1].position))
    with path.open("a") as file:
        file.write(text(10, 12))
    assert told(followed(path, position=position)) == [(False, [10.0, 11.0])]
    path.write_text(HEAD + text(3, 30, 2.0))
    assert told(followed(path, position=position))[0][0]


def test_a_note_in_a_folder_is_passed_over(tmp_path: Path) -> None:
    (tmp_path / "a_note.txt").write_text("look at the clamp\n" * 500)
    (tmp_path / "b.csv").write_text(HEAD + text(0, 3))
    found = followed(tmp_path)
    assert "a_note.txt" in found[0].refused
    assert told(found) == [(True, [0.0, 1.0, 2.0])]
    replayed = list(Source([tmp_path], Naming(), follow=False).arrivals())
    assert [x.refused for x in replayed] == [x.refused for x in found[:2]]
    with pytest.raises(InputError, match=r"a_note\.txt"):
        list(Source([tmp_path / "a_note.txt"], Naming(), follow=False).arrivals())


def test_a_folder_without_a_record_and_a_damaged_record_in_one_are_errors_of_a_replay(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="found no file"):
        list(Source([tmp_path], Naming(), follow=False).arrivals())
    (tmp_path / "a_note.txt").write_text("look at the clamp\n" * 500)
    with pytest.raises(InputError, match="1 files that are none, expected records"):
        list(Source([tmp_path], Naming(), follow=False).arrivals())
    (tmp_path / "b.csv").write_text(HEAD + text(0, 3) + "4.0,x,1.0\n")
    with pytest.raises(InputError, match=r"b\.csv, line 5"):
        list(Source([tmp_path], Naming(), follow=False).arrivals())


@pytest.mark.parametrize(
    ("again", "expected"),
    [
        (text(0, 8), [(False, [5.0, 6.0, 7.0])]),
        (text(7, 9), [(False, [7.0, 8.0])]),
        (text(0, 8, 2.0), [(True, [float(k) for k in range(8)])]),
    ],
    ids=["the same once more", "what comes behind it", "another one"],
)
def test_a_stream_that_is_given_again(
    again: str, expected: list[tuple[bool, list[float]]], monkeypatch: pytest.MonkeyPatch
) -> None:
    def streamed(content: str, position: dict[str, object]) -> list[Arrival]:
        buffer = io.BytesIO((HEAD + content).encode())
        monkeypatch.setattr("sys.stdin", SimpleNamespace(buffer=buffer))
        return list(Source([], Naming(), follow=True, position=position).arrivals())

    position = json.loads(json.dumps(streamed(text(0, 5), {})[-1].position))
    assert told(streamed(again, position)) == expected


def test_a_folder_becomes_a_run_when_its_journals_come(tmp_path: Path) -> None:
    def begun() -> None:
        ticks = [{"kind": "tick", "sequence": k, "measured_um": 1.0} for k in range(3)]
        times = [{"grabbed_s": 5.0 + k, "sent_s": 5.0 + k, "setpoint_um": None} for k in range(3)]
        run = [{"kind": "start", "delay_s": 0.0}, *(x | y for x, y in zip(ticks, times, strict=True)), {"kind": "stop"}]
        guard = [{"kind": "applied", "sequence": k, "voltage_V": 2.0, "command_time_s": 5.0 + k} for k in range(3)]
        for name, entries in ((GUARD, guard), (RUN, run)):
            (tmp_path / name).write_text("".join(json.dumps({"n": 0, "t": 0.0, **x}) + "\n" for x in entries))

    source = Source([tmp_path], Naming(), follow=True, wait=lambda _: begun())
    assert told([x for x in source.arrivals() if x.rows is not None]) == [(True, [0.0, 1.0, 2.0])]


PLAIN = Naming()
TEXT = "time_s,note,voltage_V,displacement_um\n" + "".join(
    f"{0.1 * k:.1f},x,{k},{'' if k % 4 == 0 else k / 7}\n" for k in range(20)
)


def rows_of(lines: Lines, text: str, *, is_all: bool = False) -> np.ndarray:
    parts = [x.rows for x in lines.take(text.encode(), is_all=is_all)]
    found = [np.column_stack([x.time_s, x.voltage_V, x.displacement_um]) for x in parts]
    return np.concatenate([np.zeros((0, 3)), *found])


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
        ("0.3,x", "line 4: found 2 cells, expected 4"),
        ("0.3,x,1,20.4,x,1,2", "line 4: found 7 cells, expected 4"),
    ],
)
def test_a_bad_row_is_named_or_left_out(row: str, place: str) -> None:
    text = f"time_s,note,voltage_V,displacement_um\n0.0,x,1,1\n0.1,x,1,1\n{row}\n0.4,x,2,2\n"
    with pytest.raises(InputError, match=place):
        Lines("x.csv", PLAIN, strict=True).take(text.encode())
    lenient = Lines("x.csv", PLAIN, strict=False)
    assert rows_of(lenient, text)[-1].tolist() == [0.4, 2.0, 2.0]
    assert lenient.bad >= 1


@pytest.mark.parametrize("columns", ["time=t,voltage=u,displacement=y", "t,u,y"])
def test_other_names_and_units(columns: str) -> None:
    naming = Naming(columns, "ms,V,mm")
    found = rows_of(Lines("x.csv", naming, strict=True), "t,u,y\n0,1,0.5\n10,2,nan\n")
    assert found[0].tolist() == pytest.approx([0.0, 1.0, 500.0])
    assert found[1, 0] == pytest.approx(0.01)


@pytest.mark.parametrize(("columns", "units"), [("speed=v", None), ("time=", None), (None, "furlong,V,um")])
def test_what_is_no_column_or_unit_is_refused(columns: str | None, units: str | None) -> None:
    with pytest.raises(InputError, match="expected"):
        Naming(columns, units).checked()


def test_a_missing_column_is_named() -> None:
    with pytest.raises(InputError, match="column voltage_V: no such column"):
        Lines("x.csv", PLAIN, strict=True).take(b"time_s,displacement_um\n0,1\n")


ROWS = range(20)
COMMAS = "t / ms;U (V);d [nm]\n" + "".join(f"{10 * k},0;{k},5;{1000 * k}\n" for k in ROWS)
TABS = "# bench 7\nTime\tVoltage\tDisplacement\nms\tV\tnm\n" + "".join(f"{10 * k}\t{k}.5\t{1000 * k}\n" for k in ROWS)
ORDER = "position,x,clock,level\n" + "".join(f"{k},a,{0.01 * k},{k}.5\n" for k in ROWS)
NAMES = Naming("time=clock,voltage=level,displacement=position")


@pytest.mark.parametrize(("text", "naming"), [(COMMAS, Naming()), (TABS, Naming()), (ORDER, NAMES)])
@pytest.mark.parametrize("at_once", [7, 10_000])
def test_a_table_is_read_in_the_layout_in_which_a_record_is(text: str, naming: Naming, at_once: int) -> None:
    lines = Lines("x.csv", naming, strict=True)
    data = text.encode()
    parts = [rows for k in range(0, len(data), at_once) for _, rows in lines.take(data[k : k + at_once])]
    found = np.concatenate([np.column_stack([x.time_s, x.voltage_V, x.displacement_um]) for x in parts])
    assert found[:, 0].tolist() == pytest.approx([0.01 * k for k in range(20)])
    assert found[:, 1].tolist() == pytest.approx([k + 0.5 for k in range(20)])
    assert found[:, 2].tolist() == pytest.approx([float(k) for k in range(20)])
    assert lines.offset == len(data)


def test_a_reading_of_another_quantity_comes_in_the_unit_of_the_training_record() -> None:
    kept = Quantities("V", "mbar")
    text = "time_s,voltage_V,pressure [bar]\n0,1,0.5\n1,1,0.25\n"
    naming = Naming("time=time_s,voltage=voltage_V,displacement=pressure [bar]", None, kept)
    assert rows_of(Lines("x.csv", naming, strict=True), text)[:, 2].tolist() == pytest.approx([500.0, 250.0])
    with pytest.raises(InputError, match="'bar' where 'um' is needed"):
        Lines("x.csv", Naming(naming.columns, None, Quantities("V", "um")), strict=True).take(text.encode())


def test_a_clock_that_is_set_back_begins_another_record_and_one_late_row_does_not() -> None:
    head = "time_s,voltage_V,displacement_um\n"
    rows = [f"{k},1,1\n" for k in range(100, 120)]
    lines = Lines("x.csv", Naming(), strict=False)
    late = "".join([head, *rows[:10], "3,1,1\n", *rows[10:]])
    assert [x.begins for x in lines.take(late.encode())] == [False]
    assert lines.bad == 1
    back = "".join(f"{k},2,2\n" for k in range(30))
    kept = lines.state()
    parts = lines.take(back.encode())
    assert [(x.begins, len(x.rows)) for x in parts if len(x.rows)] == [(True, 30)]
    assert lines.bad == 1
    other = Lines("x.csv", Naming(), strict=False)
    other.restore(kept)
    assert [(x.begins, len(x.rows)) for x in other.take(back.encode())] == [(True, 30)]


def test_a_line_without_an_end_is_one_bad_row() -> None:
    lines = Lines("x.csv", Naming(), strict=False)
    assert len(rows_of(lines, "time_s,voltage_V,displacement_um\n0,1,1\n")) == 1
    for _ in range(3):
        lines.take(b"1" * LONGEST_LINE)
        assert lines.waiting <= LONGEST_LINE
    assert rows_of(lines, "1\n1,1,1\n").tolist() == [[1.0, 1.0, 1.0]]
    assert lines.bad > 0


def test_text_that_is_no_utf_8_is_read_or_refused() -> None:
    text = "t [ms];U [V];d [µm]\n" + "".join(f"{k};1;{k}\n" for k in range(1, 15))
    assert len(Lines("x.csv", Naming(), strict=True).take(text.encode("cp1252"))[0].rows) == 14
    with pytest.raises(InputError, match="expected text in UTF-8"):
        Lines("x.csv", Naming(), strict=True).take(text.encode("utf-16"))


DAY = 86400.0


@pytest.mark.parametrize(
    ("times", "said"),
    [
        ((9 * DAY, 7 * DAY, 12 * DAY), "leaves what is allowed in 9 days (7 days to 12 days)"),
        ((9 * DAY, 7 * DAY, None), "leaves what is allowed in 9 days (7 days to never)"),
        ((None, 7 * DAY, None), "likely stays within what is allowed; leaves it in 7 days at the earliest"),
        ((None, None, None), "stays within what is allowed"),
    ],
)
def test_a_forecast_says_when_or_that_it_stays(times: tuple[float | None, ...], said: str) -> None:
    names = ("leaves_in_s", "leaves_low_s", "leaves_high_s")
    assert forecast(dict(zip(names, times, strict=True))) == said
