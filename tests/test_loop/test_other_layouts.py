"""Records in other people's files: spreadsheets' exports, instruments' text files, binary containers."""

import math
import random
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from hypothesis import given, settings
from hypothesis import strategies as st

from bender_loop.errors import InputError
from bender_loop.records.record import read_record
from bender_loop.tables.column_choice import usual_columns
from bender_loop.tables.text_layout import TextLayout, cells_of, number, unit_in_heading, with_options

TIME_S = np.arange(30) * 0.05
VOLTS = np.round(10.0 * np.sin(TIME_S), 3)
READ_UM = np.round(0.5 * VOLTS + 0.013, 4)


def rows(delimiter: str, decimal: str) -> str:
    lines = zip(TIME_S.tolist(), VOLTS.tolist(), READ_UM.tolist(), strict=True)
    return "".join(delimiter.join(f"{x:.4f}".replace(".", decimal) for x in line) + "\r\n" for line in lines)


def check(record):
    np.testing.assert_allclose(record.time_s, TIME_S, atol=1e-9)
    np.testing.assert_allclose(record.voltage_V, VOLTS, atol=1e-9)
    np.testing.assert_allclose(record.displacement_um, READ_UM, atol=1e-9)


def complaint(path: Path) -> str:
    """Return why a file is refused, "" where it gives a record that keeps the rules of records."""
    try:
        record = read_record(path)
    except InputError as error:
        return str(error)
    return "" if np.all(np.diff(record.time_s) > 0.0) else "\n"


def test_a_german_spreadsheet_goes_in_untouched(tmp_path: Path):
    path = tmp_path / "messung.csv"
    head = "Messung vom 3. Mai;;\r\nPrüfer: Müller;;\r\nZeit [s];Spannung [V];Weg [µm]\r\n"
    path.write_bytes((head + rows(";", ",")).encode("cp1252"))
    told: list[str] = []
    check(read_record(path, tell=told.append))
    assert len(told) == 1
    assert "delimiter semicolon, decimal comma, cp1252, names in line 3, units from the file" in told[0]
    assert "voltage_V from 'Spannung [V]'" in told[0]


@pytest.fixture
def written(tmp_path: Path):
    def write(text: str) -> Path:
        path = tmp_path / "other.csv"
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize("remarks", [{}, {4: "shaken"}], ids=["empty", "one"])
@pytest.mark.parametrize("end", [";", ""], ids=["padded", "short"])
def test_a_column_of_remarks_is_a_column(tmp_path: Path, remarks: dict[int, str], end: str):
    path = tmp_path / "messung.csv"
    body = [f"{row}{';' + remarks[k] if k in remarks else end}" for k, row in enumerate(rows(";", ",").splitlines())]
    if not (remarks or end):
        body[3] += ";"
    path.write_text("Probe 3;;;\nZeit / ms;Uout (V);Sensor kap. [µm];Bemerkung\n" + "\n".join(body), encoding="utf-8")
    record = read_record(path)
    check(replace(record, time_s=1e3 * record.time_s))


@pytest.mark.parametrize("head", ["t / ms;U;d", "t/ms;U;d", "t_ms;U;d", "time ms;U;d", "t (msec);U;d", "t / (ms);U;d"])
def test_a_unit_in_a_heading_counts_however_it_is_written(written, head: str):
    np.testing.assert_allclose(read_record(written(head + "\n0;0;0\n50;1,5;0,25\n")).time_s, [0.0, 0.05])


@pytest.mark.parametrize(
    ("name", "unit"),
    [("speed_rad/s", "rad/s"), ("flow l/min", "l/min"), ("v / mm", "mm"), ("up/down", ""), ("t_x/ms", "ms")],
)
def test_a_quotient_of_units_is_one_unit(name: str, unit: str):
    assert unit_in_heading(name) == unit


@pytest.mark.parametrize(
    ("names", "units", "found"),
    [
        (["a [ms]", "Uout (V)", "Sensor / µm"], None, {"time": 0, "voltage": 1, "displacement": 2}),
        (["a [ms]", "b (V)", "c (V)"], None, {"time": 0}),
        (["a", "b"], ["s", "mV"], {"time": 0, "voltage": 1}),
        (["t", "time", "U", "d"], None, {"voltage": 2, "displacement": 3}),
    ],
)
def test_columns_are_found_by_names_and_units_and_none_is_guessed(names, units, found):
    assert usual_columns(names, *([units] if units else [])) == {kind: names[k] for kind, k in found.items()}


@pytest.mark.parametrize(
    ("head", "columns", "found"),
    [
        ("time [ms],drive (V),speed [rpm]", None, ("drive (V)", "speed [rpm]")),
        ("time [ms],speed [rpm],drive (V)", None, ("drive (V)", "speed [rpm]")),
        ("time [ms],drive (V),speed [rpm]", "displacement=speed [rpm]", ("drive (V)", "speed [rpm]")),
        ("time [ms],drive (V),speed [rpm]", "voltage=drive", ("drive (V)", "speed [rpm]")),
        ("time [ms],foo,bar", "displacement=bar", ("foo", "bar")),
        ("t,PWM_percent,T_degC", None, ("PWM_percent", "T_degC")),
        ("t,T,drive", None, ("drive", "T")),
        ("t,cmd,pos", None, ("cmd", "pos")),
        ("t,foo,pos", None, None),
        ("time_s,u_mV,x_mm", None, ("u_mV", "x_mm")),
        ("time_s,supply_voltage_V,x_mm", None, None),
        ("t,current (A),PWM (%)", None, None),
        ("t,foo,bar", None, None),
        ("t,drive,bar,foo", None, None),
    ],
)
def test_what_is_not_named_is_found_and_told_and_never_guessed(written, head: str, columns: str | None, found):
    told: list[str] = []
    path = written(head + "".join(f"\n{k},{k + 1},{k + 2},7"[: None if head.count(",") > 2 else -2] for k in range(3)))
    if found is None:
        with pytest.raises(InputError, match="no such column"):
            read_record(path, columns, tell=told.append)
        return
    record = read_record(path, columns, units="time=s,voltage=V,displacement=um", tell=told.append)
    places = [head.split(",").index(x) for x in found]
    assert [record.voltage_V[0], record.displacement_um[0]] == places
    assert all(repr(x) in told[0] for x in found)


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("PWM_percent", "percent"), ("T_degC", "degC"), ("speed_rpm", "rpm"), ("F_N", "N"), ("p_kPa", "kPa"),
        ("drive_A", "A"), ("sensor_a", ""), ("sensor_A", ""), ("x_in", ""), ("u_c", ""), ("y_min", ""), ("y_MV", ""),
        ("u_dac", ""), ("y_Act", ""), ("ch1", ""), ("_V", ""),
    ],
)  # fmt: skip
def test_a_unit_stands_behind_the_last_underscore_and_a_word_is_none(name: str, unit: str):
    assert unit_in_heading(name) == unit


@pytest.mark.parametrize(
    ("head", "units", "words"),
    [
        ("t [s],drive (V),tacho", None, "no unit found in 'tacho', taken as µm"),
        ("t [s],drive (V),tacho", "displacement=furlongs per moon", "'furlongs per moon' is no known unit"),
        ("t [s],drive (V),tacho", "displacement=rpm", ""),
        ("time_s,voltage_V,displacement_um", None, ""),
    ],
)
def test_a_unit_that_nobody_says_or_knows_is_told(written, head: str, units: str | None, words: str):
    told: list[str] = []
    read_record(written(head + "\n0,1,2\n1,2,3\n"), units=units, tell=told.append)
    assert [x for x in told if "unit " in x or "known" in x] == [x for x in told if words and words in x]
    assert bool(words) == any(words in x for x in told if words)


def test_an_unknown_unit_of_time_is_refused_where_the_header_stands(written):
    path = written("a remark\nt [ticks];U;d\n0;0;0\n50;1,5;0,25\n")
    with pytest.raises(InputError, match=r"line 2, column t \[ticks\]: found the unit 'ticks', expected one of s, ms"):
        read_record(path)
    np.testing.assert_allclose(read_record(path, units="time=ms").time_s, [0.0, 0.05])


@pytest.mark.parametrize(
    ("text", "encoding"),
    [
        *(
            (f"{remark}\n\nZeit [s];Spannung [V];Weg [µm]\n" + rows(";", ","), "utf-8")
            for remark in ("Messung; Prüfer: Müller", "Gerät (Nr. 3); Raum (2)", "a;b;c")
        ),
        ("time_s\tvoltage_V\tdisplacement_um\n" + rows("\t", "."), "utf-8"),
        ("t U d\n" + rows(" ", "."), "utf-8"),
        ("# an instrument\n# second line\nt,u,y\n" + rows(",", "."), "utf-8"),
        ("t;U;d\ns;V;µm\n" + rows(";", "."), "utf-8"),
        ("t;U;d\n[s];[V];[um]\n" + rows(";", ","), "utf-16"),
        ("t|u|y\n" + rows("|", "."), "utf-16-le"),
        ("time (s)\tvoltage (V)\tdisplacement (µm)\n" + rows("\t", ","), "latin-1"),
        ("Time_s;Voltage_V;Displacement_um\n" + rows(";", "."), "utf-8-sig"),
    ],
)
def test_other_layouts_are_found(tmp_path: Path, text: str, encoding: str):
    path = tmp_path / "other.txt"
    path.write_bytes(text.encode(encoding))
    check(read_record(path))


def test_units_of_the_file_are_used_unless_others_are_given(written):
    path = written("t [ms];U [mV];d [mm]\n0;0;0\n50;1500;\n100;1600;0,5\n")
    record = read_record(path)
    np.testing.assert_array_equal(record.time_s, [0.0, 0.05, 0.1])
    np.testing.assert_array_equal(record.voltage_V, [0.0, 1.5, 1.6])
    # a lost reading is an empty cell
    np.testing.assert_array_equal(record.displacement_um, [0.0, math.nan, 500.0])
    other = read_record(path, columns="t [ms],U [mV],d [mm]", units="s,V,um")
    np.testing.assert_array_equal(other.time_s, [0.0, 50.0, 100.0])


def test_no_header_and_columns_by_number(tmp_path: Path):
    path = tmp_path / "bare.dat"
    path.write_text(rows(" ", "."), encoding="utf-8")
    check(read_record(path, columns="1,2,3"))
    swapped = read_record(path, columns="time=1,voltage=3,displacement=2")
    np.testing.assert_allclose(swapped.voltage_V, READ_UM, atol=1e-9)
    with pytest.raises(InputError, match="no such columns; there are 1, 2, 3"):
        read_record(path)


def test_thousands_and_signs():
    assert number("-1.234,5", ",") == -1234.5
    assert number(" 2,5e-3", ",") == 0.0025
    with pytest.raises(ValueError, match=r"1\.5"):
        number("1.5", ",")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"delimiter": "xy"}, "delimiter: found 'xy'"),
        ({"decimal": ";"}, "decimal: found ';'"),
        ({"encoding": "klingon"}, "encoding: found 'klingon'"),
        ({"skip_rows": -1}, "skip_rows: found -1"),
        ({"delimiter": ",", "decimal": ","}, "which is the delimiter too"),
    ],
)
def test_bad_layouts(given, message):
    with pytest.raises(ValueError, match=message):
        with_options(TextLayout(), **given)


def test_what_is_given_is_not_found(tmp_path: Path):
    path = tmp_path / "given.txt"
    path.write_bytes(("bad line 1\n" + rows(";", ",")).encode("utf-16-le"))
    layout = with_options(
        TextLayout(), delimiter="semicolon", decimal=",", encoding="utf-16-le", skip_rows=1, header=False
    )
    check(read_record(path, columns="1,2,3", layout=layout))


@given(
    st.sampled_from(["\t", ";", "|"]),
    st.sampled_from([".", ","]),
    st.lists(st.tuples(*[st.floats(-1e6, 1e6)] * 3), min_size=3, max_size=20),
)
@settings(max_examples=30)
def test_numbers_survive_any_layout(delimiter: str, decimal: str, lines):
    text = "".join(delimiter.join(repr(x).replace(".", decimal) for x in line) + "\n" for line in lines)
    cells = cells_of(Path("any"), text, "utf-8", TextLayout(delimiter=delimiter, decimal=decimal))
    assert [[number(x, cells.decimal) for x in row] for row in cells.rows] == [list(x) for x in lines]


NAMED = {"t": TIME_S, "U": VOLTS, "d": READ_UM}


def _hdf5(path: Path) -> None:
    with pytest.importorskip("h5py").File(path, "w") as file:
        for name, values in NAMED.items():
            file[name] = values


def _tdms(path: Path) -> None:
    nptdms = pytest.importorskip("nptdms", reason="npTDMS is LGPL and not brought along")
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([nptdms.ChannelObject("bench", name, values) for name, values in NAMED.items()])


CONTAINERS = {
    "npz": lambda path: np.savez(path, **NAMED),
    "mat": lambda path: scipy.io.savemat(path, {**NAMED, "note": "text", "matrix": np.ones((3, 3))}),
    "h5": _hdf5,
    "parquet": lambda path: pytest.importorskip("pyarrow.parquet").write_table(
        pytest.importorskip("pyarrow").table(NAMED), path
    ),
    "tdms": _tdms,
}


@pytest.mark.parametrize("kind", CONTAINERS)
def test_binary_containers_are_read(tmp_path: Path, kind: str):
    path = tmp_path / f"r.{kind}"
    CONTAINERS[kind](path)
    check(read_record(path))
    check(read_record(path, columns="t,U,d"))


def test_a_missing_library_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "nptdms", None)
    (tmp_path / "r.tdms").write_bytes(b"TDSm")
    with pytest.raises(InputError, match="need nptdms; pip install nptdms"):
        read_record(tmp_path / "r.tdms")


@pytest.mark.slow
@pytest.mark.parametrize("kind", CONTAINERS)
def test_damaged_containers_are_refused_in_one_line(tmp_path: Path, kind: str):
    rng, path = random.Random(4), tmp_path / f"r.{kind}"
    CONTAINERS[kind](path)
    whole = path.read_bytes()
    for _ in range(25):
        data = bytearray(whole)
        for _ in range(rng.randint(1, 30)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        path.write_bytes(bytes(data[: rng.randint(0, len(data))]) if rng.random() < 0.4 else bytes(data))
        assert "\n" not in complaint(path)


def test_mutated_text_ends_in_a_record_or_in_one_line(tmp_path: Path):
    rng = random.Random(7)
    whole = ("Zeit [s];Spannung [V];Weg [µm]\r\n" + rows(";", ",")).encode("cp1252")
    for k in range(400):
        data = bytearray(whole)
        for _ in range(rng.randint(1, 12)):
            data[rng.randrange(len(data))] = rng.choice([0, 10, 44, 46, 59, 9, 34, rng.randrange(256)])
        path = tmp_path / f"m{k}.csv"
        path.write_bytes(bytes(data))
        assert "\n" not in complaint(path)


def test_columns_in_a_group_of_hdf5_go_by_their_own_names(tmp_path: Path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, values in (("time_s", TIME_S), ("voltage_V", VOLTS), ("displacement_um", READ_UM)):
            file[f"run 3/{name}"] = values
    check(read_record(tmp_path / "a.h5"))
    with h5py.File(tmp_path / "a.h5", "a") as file:
        file["run 4/time_s"] = TIME_S
    with pytest.raises(InputError, match=r"there are .*run 3/time_s"):
        read_record(tmp_path / "a.h5")
    check(read_record(tmp_path / "a.h5", columns={"time": "run 3/time_s"}))


@pytest.mark.skipif(sys.platform == "win32", reason="stands in for the interpreter with a shell script")
def test_a_file_that_crashes_its_library_is_refused_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    CONTAINERS["mat"](tmp_path / "a.mat")
    check(read_record(tmp_path / "a.mat"))
    crashing = tmp_path / "python"
    crashing.write_text("#!/bin/sh\nkill -SEGV $$\n", encoding="utf-8")
    crashing.chmod(0o755)
    monkeypatch.setattr("bender_loop.tables.containers.sys.executable", str(crashing))
    with pytest.raises(InputError, match=r"a\.mat: is damaged .*crashes the library"):
        read_record(tmp_path / "a.mat")
