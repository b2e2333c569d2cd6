"""Records: rules, reading other people's files, exact round trip, sizes that are asked about."""

import contextlib
import json
import math
from pathlib import Path

import numpy as np
import pytest
from few import few_rows
from foreign_fmus import foreign_fmu, needs_compiler
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from bender_cli.main import main
from bender_loop.errors import InputError
from bender_loop.records.columns import COLUMNS
from bender_loop.records.record import Record, read_record, write_record
from bender_loop.records.scale import TENFOLD, scale_question
from bender_loop.records.sizes import LONGEST_S, MOST_UM, MOST_V, check_sizes
from bender_loop.records.variables import Variable

finite = st.floats(allow_nan=False, allow_infinity=False)


@st.composite
def records(draw):
    time_s = sorted(draw(st.sets(finite, min_size=2, max_size=12)))
    count = len(time_s)
    exact = st.lists(finite, min_size=count, max_size=count)
    gappy = st.lists(finite | st.just(math.nan), min_size=count, max_size=count)
    part = draw(st.lists(st.floats(0.0, 1.0), min_size=count, max_size=count))
    following = [*time_s[1:], math.inf]
    command_time_s = [min(t + p * min(1.0, n - t), n) for t, n, p in zip(time_s, following, part, strict=True)]
    return Record(
        np.array(time_s),
        np.array(draw(exact)),
        np.array(draw(gappy)),
        command_time_s=draw(st.none() | st.just(np.array(command_time_s))),
        setpoint_um=draw(st.none() | gappy.map(np.array)),
    )


@given(record=records())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=50)
def test_written_and_read_again_it_has_the_same_bits(tmp_path, record):
    path = tmp_path / "record.csv"
    write_record(path, record)
    again = read_record(path)
    assert list(again.columns()) == list(record.columns())
    for name, values in record.columns().items():
        np.testing.assert_array_equal(again.columns()[name], values)


def simple(**columns):
    usual = {"time_s": [0.0, 1.0, 2.5], "voltage_V": [0.0, 1.0, 2.0], "displacement_um": [0.0, 0.4, 0.9]}
    return Record(**{**usual, **columns})


def test_columns_are_read_only_copies():
    time_s = np.array([0.0, 1.0, 2.5])
    record = simple(time_s=time_s)
    time_s[0] = -9.0
    assert record.time_s[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        record.time_s[0] = 1.0
    assert len(record) == 3


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"time_s": [0.0, 1.0]}, "equal lengths"),
        ({name: [0.0] for name in ("time_s", "voltage_V", "displacement_um")}, "at least 2 rows, found 1"),
        ({"time_s": [[0.0], [1.0], [2.0]]}, "time_s must be one-dimensional"),
        ({"time_s": [0.0, 1.0, 1.0]}, r"row 2, column time_s: found 1.0 s, expected more than 1.0 s"),
        ({"time_s": [0.0, math.nan, 1.0]}, "row 1, column time_s: found nan, expected a finite number"),
        ({"command_time_s": [0.0, 0.9, 2.5]}, r"row 1, column command_time_s: found 0.9 s, expected at least 1.0 s"),
        ({"command_time_s": [0.0, 2.6, 2.6]}, r"row 1, column command_time_s: found 2.6 s, expected at most 2.5 s"),
    ],
)
def test_rules(columns, message):
    with pytest.raises(ValueError, match=message):
        simple(**columns)


@pytest.fixture
def written(tmp_path: Path):
    def write(text: str | bytes) -> Path:
        path = tmp_path / "record.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write


HEADER = "time_s,voltage_V,displacement_um\n"
TIMED_HEADER = "time_s,voltage_V,displacement_um,command_time_s\n"
EXPOSED_HEADER = "time_s,voltage_V,displacement_um,exposure_s\n"


@pytest.mark.parametrize(
    "text",
    [
        HEADER + "0,0,0\n0.5,1,\n1.5,2,0.75\n",
        HEADER + "0,0,0\n0.5,1,nan\n1.5,2,0.75",
        "\ufeff" + HEADER + "0,0,0\n0.5,1,NaN\n1.5,2,0.75\n\n \n,,\n",
        (HEADER + "0,0,0\n0.5,1,\n1.5,2,0.75\n").replace("\n", "\r\n"),
        (HEADER + "0,0,0\n0.5,1,\n1.5,2,0.75\n").replace("\n", "\r"),
        'voltage_V , branch, displacement_um,time_s\n0,up,0,0\n1,up, ,.5\n2,"down, slowly",7.5e-1,1.5,\n',
    ],
)
def test_accepted_forms(written, text):
    record = read_record(written(text))
    np.testing.assert_array_equal(record.time_s, [0.0, 0.5, 1.5])
    np.testing.assert_array_equal(record.voltage_V, [0.0, 1.0, 2.0])
    np.testing.assert_array_equal(record.displacement_um, [0.0, math.nan, 0.75])
    assert list(record.columns()) == ["time_s", "voltage_V", "displacement_um"]


def test_names_and_units_by_option(written):
    path = written("t,U,d,T,tc\n0,0,0,20.5,1\n35,1500,0.25,21,36\n")
    record = read_record(path, columns="time=t, voltage=U,displacement=d,command_time=tc", units="ms,mV,mm,ms")
    np.testing.assert_array_equal(record.time_s, [0.0, 0.035])
    np.testing.assert_array_equal(record.voltage_V, [0.0, 1.5])
    np.testing.assert_array_equal(record.displacement_um, [0.0, 250.0])
    assert record.command_time_s is not None
    np.testing.assert_array_equal(record.command_time_s, [0.001, 0.036])
    mapping = {"displacement": "d", "voltage": "U", "time": "t", "temperature": "T"}
    again = read_record(path, columns=mapping, units="time=ms,displacement=m")
    np.testing.assert_array_equal(again.displacement_um, [0.0, 0.25e6])
    np.testing.assert_array_equal(again.voltage_V, [0.0, 1500.0])
    assert again.temperature_C is not None
    np.testing.assert_array_equal(again.temperature_C, [20.5, 21.0])


def test_optional_columns_are_taken_by_their_names(written):
    optional = [column.field for column in COLUMNS.values() if not column.required and column.field != "exposure_s"]
    rows = "".join(f"{k},1,2,{','.join([str(k)] * len(optional))}\n" for k in range(2))
    record = read_record(written(HEADER.strip() + "," + ",".join(optional) + "\n" + rows))
    for name in optional:
        np.testing.assert_array_equal(record.columns()[name], [0.0, 1.0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty"),
        (HEADER + "0,0,0\n", "found 1 row below the header, .* 40"),
        (HEADER + "0,0,0\n1,1,ERROR\n", "found 'ERROR', expected a number; leave the cell empty"),
        ("t [ms],U [V],d [um]\n0,0,0\n900,1,1\n500,0,1\n", r"line 4.* 500.0 ms, .* 900.0 ms .*sort the rows"),
        ("U,t,d\n0,0,0\n1,1,1\n2,1,1\n", "U rises evenly: .*--columns time=U,voltage=t"),
        ("time_s,voltage_V\n0,0\n1,1\n", "line 1, column displacement_um: no such column; there are time_s, voltage_V"),
        ("a,U,displacement_um\n0,0,0\n1,1,1\n", "no such column; there are a, U, .*: --columns time=NAME"),
        ("a,b,c\n0,0,0\n1,1,1\n", "if time, input, reading .*: --columns time=NAME,voltage=NAME,displacement=NAME"),
        ("time_s,time_s,voltage_V,displacement_um\n", "line 1, column time_s: 2 columns of that name"),
        ("time_s;voltage_V;displacement_um\n0;0;0\n", "found 1 row below the header"),
        (HEADER + "0,0,0\n1,one,0\n", "line 3, column voltage_V: found 'one', expected a number"),
        (HEADER + "0,0,0\n1,inf,0\n", "line 3, column voltage_V: found inf, expected a finite number"),
        (HEADER + "0,0,0\n0,1,1\n", "line 3, column time_s: found 0.0 s, expected more than 0.0 s"),
        (HEADER + "0,0,0\n\n1,1,1\n", "line 3: found 0 cells, expected 3"),
        (HEADER + "0,0,0\n1,5,2,5,3,5\n", "line 3: found 6 cells, expected 3 .*point as the decimal sign"),
        (HEADER + '0,0,0\n1,"1,1\n', "line 3: not a CSV row"),
        (HEADER.encode("utf-16"), "no columns of numbers under any delimiter"),
        (b"time_s,voltage_V,displacement_\xb5m\n", "no columns of numbers under any delimiter"),
        (b"time_s,voltage_V\x00\n", "byte 16 is zero"),
        (TIMED_HEADER + "0,0,0,0\n1,1,1,\n", "line 3, column command_time_s: found ''"),
        (TIMED_HEADER + "0,0,0,1.5\n1,1,1,1\n", "line 2, column command_time_s: found 1.5 s"),
        (EXPOSED_HEADER + "0,0,0,0.01\n1,1,1,0.01\n2,2,2,0.02\n", r"line 4, column exposure_s: found 0\.02 s"),
        (EXPOSED_HEADER + "0,0,0,9\n1,1,1,9\n", "the whole record"),
    ],
)  # fmt: skip
def test_messages_name_the_cell(written, text, message):
    columns = "time=t,voltage=U,displacement=d" if "U,t" in str(text) else None
    with pytest.raises(InputError, match=message) as caught:
        read_record(written(text), columns)
    assert "record.csv" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_error_names_the_column_as_the_file_does(written):
    with pytest.raises(InputError, match="line 4, column U: found nan"):
        read_record(written("t,U,d\n0,0,0\n1,1,1\n2,nan,2\n"), columns="time=t,voltage=U,displacement=d")


@pytest.mark.parametrize(
    ("columns", "units", "message"),
    [
        ("time", None, "--columns: found 'time', expected entries like time=t"),
        ("zeit=t", None, "--columns: found 'zeit', expected one of time, voltage, displacement"),
        ("time=t,time=u", None, "--columns: found a column named twice"),
        ({"zeit": "t"}, None, "--columns: found 'zeit'"),
        ("temperature=T", None, "column T: no such column"),
        (None, "ms,V", r"--units: found 2 in 'ms,V', expected 3 \(time, voltage, displacement\)"),
        (None, "temperature=lightbeers", "--units: found 'lightbeers' for temperature, expected one of degC"),
        (None, "time=V", "--units: found 'V' for time, expected one of s, ms"),
        (None, "zeit=s", "--units: found 'zeit'"),
    ],
)
def test_bad_options(written, columns, units, message):
    with pytest.raises(InputError, match=message):
        read_record(written(HEADER + "0,0,0\n1,1,1\n"), columns=columns, units=units)


def test_an_exposure_is_that_of_every_row(written):
    assert read_record(written(EXPOSED_HEADER + "0,0,0,0.01\n1,1,1,0.01\n")).exposure == 0.01


@pytest.mark.parametrize(
    ("units", "stated"),
    [("ms,V,mm", ("V", "mm")), ("voltage=mV", ("mV", "um")), (None, ("V", "um"))],
)
def test_the_units_of_a_record_are_those_of_an_fmu_that_declares_none(written, units: str | None, stated):
    assert read_record(written(HEADER + "0,0,0\n1,2,3\n2,0,1\n"), units=units).quantities == ("V", "um", stated)


@pytest.mark.parametrize(
    ("header", "columns", "expected"),
    [
        ("t,drive.u,sensor.y", None, 3.0),
        ("time_s,drive.u,sensor.y [mm]", None, 3e3),
        ("t,drive.u,displacement_um", None, 3.0),
        ("t,drive.u,d,sensor.y", "displacement=d", 3.0),
    ],
)
def test_columns_of_the_names_of_an_fmu_need_no_other_word(written, header: str, columns, expected: float):
    beside = ",7" if header.count(",") == 3 else ""
    variables = {"voltage": Variable("drive.u"), "displacement": Variable("sensor.y")}
    record = read_record(written(f"{header}\n0,1,2{beside}\n0.5,2,3{beside}\n"), columns, variables=variables)
    assert record.voltage_V.tolist() == [1.0, 2.0]
    assert record.displacement_um[1] == pytest.approx(expected)


@pytest.mark.parametrize(
    ("header", "unit", "quantities"),
    [
        ("t_s,P,T", "K", ("W", "K")),
        ("t_s,P,T [mK]", "K", ("W", "mK")),
        ("t_s,P,T", "m", ("W", "um")),
        ("t_s,P,T [mm]", "m", ("W", "um")),
    ],
)
def test_a_column_without_a_unit_is_in_that_of_its_variable(written, header: str, unit: str, quantities):
    path = written(f"{header}\n0,1,2\n1,2,3\n")
    variables = {"voltage": Variable("heater", "W"), "displacement": Variable("zone", unit)}
    record = read_record(path, reading="T", variables=variables, command="P")
    assert record.quantities[:2] == quantities
    with pytest.raises(InputError, match=r"column voltage_V or heater: no such column; there are t_s, P, T"):
        read_record(path, reading="T", variables=variables)


@given(st.floats(1.0, 1e12), st.booleans())
@example(1e3, True)
@example(1e6, False)
def test_ten_times_more_or_less_is_asked_about(times: float, more: bool) -> None:
    asked = scale_question(times if more else 1.0 / times)
    assert (asked is None) == (times < TENFOLD)
    if asked is not None:
        assert ("more" if more else "less") in asked
        assert "--units" in asked
    if times in (1e3, 1e6):
        assert ("mm for µm" if more else "m for µm") in str(asked)


def test_nothing_is_asked_about_no_number() -> None:
    assert [scale_question(x) for x in (0.0, math.nan, math.inf, -1.0)] == [None] * 4


@needs_compiler
@pytest.mark.parametrize(
    ("gain", "said"), few_rows([(1e-9, "1e+03 times more"), (1.0, "1e+06 times less"), (1e-6, None)], 0)
)
def test_compare_asks(
    gain: float, said: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    foreign_fmu(Path("lag.fmu"), gain=gain)
    rows = [(0.1 * k, float(k % 7), float((k - 1) % 7) if k else 0.0) for k in range(80)]
    text = "\n".join(["time_s,voltage_V,displacement_um", *(",".join(map(repr, x)) for x in rows)])
    Path("record.csv").write_text(text + "\n", encoding="utf-8")
    assert main(["compare", "record.csv", "--fmu", "lag.fmu", "--set", "tau=0.01", "--out", "o"]) == 0
    printed = capsys.readouterr().out
    found = json.loads(Path("o/comparison.json").read_text(encoding="utf-8"))["question"]
    assert (found is None) == (said is None)
    if said:
        assert said in printed
        assert said in found


STEPS = np.linspace(0.0, 1.0, 5)


@pytest.mark.parametrize(
    ("sizes", "untimed", "says"),
    [
        ((LONGEST_S, -MOST_V, -MOST_UM), False, None),
        ((1.0, 1.0, math.nan), False, None),
        ((1e12, 1.0, 1.0), True, None),
        ((1e9, 1.0, 1.0), False, r"a: time_s spans 1e\+09 s, expected at most 1e\+08 s"),
        ((1.0, -1e6, 1.0), False, r"a: voltage_V reaches 1e\+06 V, expected at most 100000 V"),
        ((1.0, 1.0, -1e300), False, r"a: displacement_um reaches 1e\+300 µm, expected at most 1e\+09 µm"),
    ],
)
def test_the_largest_sizes_are_taken_and_other_units_told(
    sizes: tuple[float, float, float], untimed: bool, says: str | None
) -> None:
    time_s, voltage_V, displacement_um = (size * STEPS for size in sizes)
    record = Record(time_s, voltage_V, displacement_um)
    with pytest.raises(InputError, match=says) if says else contextlib.nullcontext():
        check_sizes("a", record, untimed=untimed)
