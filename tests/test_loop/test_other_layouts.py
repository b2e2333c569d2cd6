"""Records in other people's files: spreadsheets' exports, instruments' text files, binary containers."""

import math
import random
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bender_loop.errors import InputError
from bender_loop.records.record import read_record
from bender_loop.tables.column_choice import plain_name, usual_columns
from bender_loop.tables.text_layout import TextLayout, cells_of, number, with_options

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


@pytest.mark.parametrize("remark", ["Messung; Prüfer: Müller", "Gerät (Nr. 3); Raum (2)", "a;b;c"])
def test_a_remark_with_the_delimiter_in_it_is_no_header(tmp_path: Path, remark: str):
    path = tmp_path / "messung.csv"
    path.write_text(f"{remark}\n\nZeit [s];Spannung [V];Weg [µm]\n" + rows(";", ","), encoding="utf-8")
    check(read_record(path))


@pytest.mark.parametrize("remarks", [{}, {4: "shaken"}], ids=["empty", "one"])
@pytest.mark.parametrize("end", [";", ""], ids=["padded", "short"])
def test_a_column_of_remarks_is_a_column(tmp_path: Path, remarks: dict[int, str], end: str):
    path = tmp_path / "messung.csv"
    body = [f"{row}{';' + remarks[k] if k in remarks else end}" for k, row in enumerate(rows(";", ",").splitlines())]
    if not (remarks or end):
        body[3] += ";"
    path.write_text("Probe 3;;;\nZeit / ms;Uout (V);Sensor kap. [µm];Bemerkung\n" + "\n".join(body), encoding="utf-8")
    record = read_record(path)
    np.testing.assert_allclose(1e3 * record.time_s, TIME_S, atol=1e-9)
    np.testing.assert_allclose(record.voltage_V, VOLTS, atol=1e-9)
    np.testing.assert_allclose(record.displacement_um, READ_UM, atol=1e-9)


@pytest.mark.parametrize("head", ["t / ms;U;d", "t/ms;U;d", "t_ms;U;d", "time ms;U;d", "t (msec);U;d", "t / (ms);U;d"])
def test_a_unit_in_a_heading_counts_however_it_is_written(tmp_path: Path, head: str):
    path = tmp_path / "units.csv"
    path.write_text(head + "\n0;0;0\n50;1,5;0,25\n", encoding="utf-8")
    np.testing.assert_allclose(read_record(path).time_s, [0.0, 0.05])


def test_columns_are_found_by_their_units_where_their_names_say_nothing():
    assert usual_columns(["a [ms]", "Uout (V)", "Sensor / µm"]) == {
        "time": "a [ms]",
        "voltage": "Uout (V)",
        "displacement": "Sensor / µm",
    }
    assert usual_columns(["a [ms]", "b (V)", "c (V)"]) == {"time": "a [ms]"}
    assert usual_columns(["a", "b"], ["s", "mV"]) == {"time": "a", "voltage": "b"}


def test_an_unknown_unit_of_time_is_refused_where_the_header_stands(tmp_path: Path):
    path = tmp_path / "units.csv"
    path.write_text("a remark\nt [ticks];U;d\n0;0;0\n50;1,5;0,25\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"line 2, column t \[ticks\]: found the unit 'ticks', expected one of s, ms"):
        read_record(path)
    np.testing.assert_allclose(read_record(path, units="time=ms").time_s, [0.0, 0.05])


@pytest.mark.parametrize(
    ("text", "encoding"),
    [
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


def test_units_of_the_file_are_used_unless_others_are_given(tmp_path: Path):
    path = tmp_path / "units.csv"
    path.write_text("t [ms];U [mV];d [mm]\n0;0;0\n50;1500;0,25\n100;1600;0,5\n", encoding="utf-8")
    record = read_record(path)
    np.testing.assert_array_equal(record.time_s, [0.0, 0.05, 0.1])
    np.testing.assert_array_equal(record.voltage_V, [0.0, 1.5, 1.6])
    np.testing.assert_array_equal(record.displacement_um, [0.0, 250.0, 500.0])
    other = read_record(path, columns="t [ms],U [mV],d [mm]", units="s,V,um")
    np.testing.assert_array_equal(other.time_s, [0.0, 50.0, 100.0])


def test_no_header_and_columns_by_number(tmp_path: Path):
    path = tmp_path / "bare.dat"
    path.write_text(rows(" ", "."), encoding="utf-8")
    check(read_record(path, columns="1,2,3"))
    swapped = read_record(path, columns="time=1,voltage=3,displacement=2")
    np.testing.assert_allclose(swapped.voltage_V, READ_UM, atol=1e-9)
    with pytest.raises(InputError, match="no such column; there are 1, 2, 3"):
        read_record(path)


def test_a_lost_reading_is_an_empty_cell(tmp_path: Path):
    path = tmp_path / "gaps.csv"
    path.write_text("Zeit;Spannung;Weg\n0;0;0,5\n1;1;\n2;2;0,7\n3;1;0,6\n", encoding="utf-8")
    assert math.isnan(read_record(path).displacement_um[1])


def test_thousands_and_signs():
    assert number("-1.234,5", ",") == -1234.5
    assert number(" 2,5e-3", ",") == 0.0025
    with pytest.raises(ValueError, match=r"1\.5"):
        number("1.5", ",")


def test_names_that_could_be_two_columns_are_not_guessed():
    assert usual_columns(["t", "time", "U", "d"]) == {"voltage": "U", "displacement": "d"}
    assert plain_name("Spannung [V]") == "spannung"
    assert plain_name("Voltage_mV") == "voltage"


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


def _containers(folder: Path) -> list[Path]:
    made = [folder / "r.npz"]
    named = {"t": TIME_S, "U": VOLTS, "d": READ_UM}
    np.savez(made[0], **named)
    scipy_io = pytest.importorskip("scipy.io")
    made.append(folder / "r.mat")
    scipy_io.savemat(made[-1], {**named, "note": "text", "matrix": np.ones((3, 3))})
    h5py = pytest.importorskip("h5py")
    made.append(folder / "r.h5")
    with h5py.File(made[-1], "w") as file:
        for name, values in named.items():
            file[name] = values
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    made.append(folder / "r.parquet")
    parquet.write_table(pyarrow.table(named), made[-1])
    return made


def test_tdms_where_its_library_is_installed(tmp_path: Path):
    nptdms = pytest.importorskip("nptdms", reason="npTDMS is LGPL and not brought along")
    path = tmp_path / "r.tdms"
    with nptdms.TdmsWriter(path) as writer:
        columns = {"t": TIME_S, "U": VOLTS, "d": READ_UM}
        writer.write_segment([nptdms.ChannelObject("bench", name, values) for name, values in columns.items()])
    check(read_record(path))


def test_a_missing_library_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "nptdms", None)
    path = tmp_path / "r.tdms"
    path.write_bytes(b"TDSm")
    with pytest.raises(InputError, match="need nptdms; pip install nptdms"):
        read_record(path)


def test_binary_containers(tmp_path: Path):
    for path in _containers(tmp_path):
        check(read_record(path))
        check(read_record(path, columns="t,U,d"))


@pytest.mark.slow
def test_damaged_containers_are_refused_in_one_line(tmp_path: Path):
    rng = random.Random(4)
    for path in _containers(tmp_path):
        whole = path.read_bytes()
        for _ in range(25):
            data = bytearray(whole)
            for _ in range(rng.randint(1, 30)):
                data[rng.randrange(len(data))] = rng.randrange(256)
            broken = path.with_stem("broken")
            broken.write_bytes(bytes(data[: rng.randint(0, len(data))]) if rng.random() < 0.4 else bytes(data))
            assert "\n" not in complaint(broken)


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
    import scipy.io

    scipy.io.savemat(tmp_path / "a.mat", {"time_s": TIME_S, "voltage_V": VOLTS, "displacement_um": READ_UM})
    check(read_record(tmp_path / "a.mat"))
    crashing = tmp_path / "python"
    crashing.write_text("#!/bin/sh\nkill -SEGV $$\n", encoding="utf-8")
    crashing.chmod(0o755)
    monkeypatch.setattr("bender_loop.tables.containers.sys.executable", str(crashing))
    with pytest.raises(InputError, match=r"a\.mat: is damaged .*crashes the library"):
        read_record(tmp_path / "a.mat")
