"""Records of other rigs: any unit that people write, the same numbers from any of them."""

from pathlib import Path

import numpy as np
import pytest
from foreign_fmus import foreign_fmu, needs_compiler

from bender_loop.errors import InputError
from bender_loop.fmu.plant import FmuPlant
from bender_loop.records.common_units import in_units_of, with_stated_unit
from bender_loop.records.record import Record, read_record
from bender_loop.tables.quantities import MICROMETRE, VOLT, Quantities, compact, factor, is_known
from bender_report.wording import axis_text, input_word, quantity, relabelled, shown_in

TEXT = "time [ms],valve [bar],speed [mm/s]\n" + "\n".join(f"{100 * k},{k % 5},{0.5 * (k % 5)}" for k in range(60))


@pytest.mark.parametrize(
    ("given", "wanted", "times"),
    [
        ("mm/s", "m/s", 1e-3), ("rpm", "rad/s", 2 * np.pi / 60), ("bar", "Pa", 1e5), ("l/min", "m3/s", 1e-3 / 60),
        ("N.m", "mN m", 1e3), ("N·m", "kg.m2/s2", 1.0), ("kN", "N", 1e3), ("µA", "uA", 1.0), ("rpm", "rpm", 1.0),
    ],
)  # fmt: skip
def test_units_as_people_and_fmus_write_them(given: str, wanted: str, times: float) -> None:
    assert factor(given, wanted) == pytest.approx(times, rel=1e-12)


@pytest.mark.parametrize(
    ("given", "wanted", "said"),
    [("bar", "mm/s", "another quantity"), ("furlong per beer", "m", "expected one as"), ("degC", "K", "zeros differ")],
)
def test_what_cannot_be_converted(given: str, wanted: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        factor(given, wanted)


@pytest.mark.parametrize(
    ("unit", "span", "shown"),
    [
        ("N m", 3e-5, (1e6, "uN m")), ("N·m", 2e5, (1e-3, "kN·m")), ("m/s^2", 1e-5, (1e6, "um/s^2")),
        ("mm", 2e-3, (1e3, "um")), ("ml/min", 3e-3, (1e3, "ul/min")), ("m2", 1e-6, (1e6, "mm**2")),
        ("bar", 2.0, (1.0, "bar")), ("degC", 1e-3, (1.0, "degC")), ("beer", 1e-3, (1.0, "beer")),
        ("rpm", 1080.0, (1.0, "rpm")), ("m/s", 0.02, (1.0, "m/s")), ("Pa", 1e5, (1.0, "Pa")),
    ],
)  # fmt: skip
def test_a_prefix_stands_before_the_unit_as_it_is_written(unit: str, span: float, shown: tuple[float, str]) -> None:
    assert compact(unit, span) == shown


def test_a_column_says_its_unit_and_one_that_nobody_can_convert_is_kept(tmp_path: Path) -> None:
    (tmp_path / "rig.csv").write_text(TEXT, encoding="utf-8")
    record = read_record(tmp_path / "rig.csv", "time=time [ms],voltage=valve [bar],displacement=speed [mm/s]")
    assert record.quantities[:2] == ("bar", "mm/s")
    assert record.time_s[1] == 0.1
    assert record.displacement_um[4] == 2.0
    kept = read_record(tmp_path / "rig.csv", "time [ms],valve [bar],speed [mm/s]", "ms,beer,ticks/frame")
    assert kept.quantities[:2] == ("beer", "ticks/frame")
    assert kept.displacement_um[4] == 2.0
    told = read_record(tmp_path / "rig.csv", "time [ms],valve [bar],speed [mm/s]", "ms,mbar,inch")
    assert told.displacement_um[4] == pytest.approx(2.0 * 25400.0)
    assert told.quantities[:2] == ("mbar", "um")
    with pytest.raises(InputError, match="or of another quantity"):
        read_record(tmp_path / "rig.csv", "time [ms],valve [bar],speed [mm/s]", "ms,,um")
    assert not is_known("")


def test_what_is_no_voltage_is_told_as_a_command(tmp_path: Path) -> None:
    (tmp_path / "oven.csv").write_text("t [s];q1 [W];T1 [K]\n0;0;293,1\n5;20;293,2\n", encoding="utf-8")
    told: list[str] = []
    read_record(tmp_path / "oven.csv", "t [s],q1 [W],T1 [K]", tell=told.append)
    assert told[0].endswith("time_s from 't [s]', input from 'q1 [W]', reading from 'T1 [K]'")


def test_words_show_the_units_of_the_rig() -> None:
    with shown_in("bar", "mm/s"):
        assert quantity(2.0, "um") == "2 mm/s"
        assert quantity(2.0, "um/V2") == "2 (mm/s)/bar²"
        assert quantity(2.0, "um/V") == "2 (mm/s)/bar"
        assert relabelled("0.3 um rms from 2 V on, velocity (µm), 5 Volt") == (
            "0.3 mm/s rms from 2 bar on, velocity (mm/s), 5 Volt"
        )
        assert relabelled("Kp 2 V/µm, Ki 3 V/(µm s), Kd 4 V s/µm, 5 V/s, gain (V/(µm s))") == (
            "Kp 2 bar/(mm/s), Ki 3 bar/((mm/s) s), Kd 4 bar s/(mm/s), 5 bar/s, gain (bar/((mm/s) s))"
        )
        assert axis_text("displacement (µm)") == "output (mm/s)"
        assert axis_text("density (µm/√Hz)") == "density (mm/s/√Hz)"
        assert axis_text("voltage (V)") == "input (bar)"
        assert input_word() == "input"
    with shown_in("V", "mV"):
        assert quantity(2.0, "um/V") == "2 mV/V"
        assert input_word() == "voltage"
    assert axis_text("voltage (V)") == "voltage (V)"
    assert quantity(2.0, "um") == "2 µm"
    assert relabelled("0.3 um") == "0.3 um"


@needs_compiler
@pytest.mark.parametrize(("unit", "gain"), [("mm", 2e-3), ("m", 2e-6)])
def test_an_fmu_is_brought_to_the_unit_of_the_record(unit: str, gain: float, tmp_path: Path) -> None:
    fmu = foreign_fmu(tmp_path / "lag.fmu", output_unit=unit, gain=gain)
    with FmuPlant(fmu, quantities=Quantities("V", "inch")) as plant:
        assert plant.step(1.0, 10.0) == pytest.approx(2e-6 / 0.0254, rel=1e-9)
    with pytest.raises(InputError, match="another quantity"):
        FmuPlant(fmu, quantities=Quantities("V", "bar"))


@pytest.mark.parametrize("power", [-9, -6, 0, 6, 9])
def test_a_prefix_changes_no_number(power: int, tmp_path: Path) -> None:
    """Scaling input and output far beyond ordinary sizes gives the same numbers under another prefix."""
    rows = [(0.1 * k, 10.0**power * (k % 5), 10.0**-power * 37.0 * (k % 5)) for k in range(60)]
    record = read_record(record_file(tmp_path / "rig.csv", rows), "t,u,y", "s,bar,m/s")
    assert np.allclose(record.voltage_V, np.arange(60) % 5, rtol=1e-12)
    assert np.allclose(record.displacement_um, 37.0 * (np.arange(60) % 5), rtol=1e-12)
    prefix = {-9: "n", -6: "u", 0: "", 6: "M", 9: "G"}
    assert record.quantities[:2] == (f"{prefix[power]}bar", f"{prefix[-power]}m/s")


def record_file(path: Path, rows: list[tuple[float, float, float]]) -> Path:
    path.write_text("\n".join(["t,u,y", *(",".join(map(repr, x)) for x in rows)]) + "\n", encoding="utf-8")
    return path


def kept(quantities: Quantities, largest: float = 3.0) -> Record:
    rows = np.arange(3.0)
    return Record(rows, rows, np.array([0.0, largest, 1.0]), quantities=quantities)


def test_records_of_one_rig_come_to_the_unit_of_the_largest(tmp_path: Path) -> None:
    sizes = {"small": 0.009, "large": 1.1}
    both = [
        read_record(record_file(tmp_path / name, [(k, x * (k % 2), k % 3) for k in range(50)]), "t,u,y", "s,bar,rpm")
        for name, x in sizes.items()
    ]
    assert [x.quantities[0] for x in both] == ["mbar", "bar"]
    for order in (both, both[::-1]):
        alike = in_units_of(order)
        assert {x.quantities[:2] for x in alike} == {("bar", "rpm")}
        assert sorted(x.voltage_V.max() for x in alike) == pytest.approx([0.009, 1.1])


@pytest.mark.parametrize(
    ("own", "model", "units", "largest"),
    [
        (("V", "rpm", ("V", "rpm")), ("V", "krpm"), ("V", "krpm"), 0.003),
        (("V", "um", ("", "")), ("%", "K"), ("%", "K"), 3.0),
        (("V", "um", ("V", "um")), ("V", "K"), ("V", "K"), 3.0),
        (("V", "K", ("V", "K")), ("V", "um"), ("V", "K"), 3.0),
        (("V", "K", ("V", "K")), ("", ""), ("V", "K"), 3.0),
        (("V", "K", ("V", "K")), None, ("V", "K"), 3.0),
    ],
)
def test_records_come_to_the_units_of_a_model(
    own: tuple[str, str, tuple[str, str]], model: tuple[str, str] | None, units: tuple[str, str], largest: float
) -> None:
    (found,) = in_units_of([kept(Quantities(*own))], model)
    assert found.quantities == Quantities(*units, own[2])
    assert found.displacement_um.max() == pytest.approx(largest)


@pytest.mark.parametrize("own", [("V", "degC", ("V", "degC")), ("V", "um", ("V", "mm"))])
def test_another_quantity_than_that_of_the_model_is_refused_in_the_unit_of_the_file(
    own: tuple[str, str, tuple[str, str]],
) -> None:
    with pytest.raises(InputError, match=rf"mine\.csv: found readings in {own[2][1]}, expected rpm .* --units"):
        in_units_of([kept(Quantities(*own))], ("V", "rpm"), ["mine.csv"])


@pytest.mark.parametrize(
    ("own", "told"),
    [
        (("V", "krpm", ("mV", "rpm")), ("2000 mV", "1500 rpm")),
        (("V", "um", ("V", "um")), ("2 V", "1.5 µm")),
        (("V", "beer", ("", "beer")), ("2 V", "1.5 beer")),
    ],
)
def test_numbers_are_told_in_the_unit_of_the_file(own: tuple[str, str, tuple[str, str]], told: tuple[str, str]) -> None:
    record = kept(Quantities(*own))
    assert (with_stated_unit(record, 2.0, VOLT), with_stated_unit(record, 1.5, MICROMETRE)) == told


@needs_compiler
def test_an_fmu_without_units_is_in_what_people_stated(tmp_path: Path) -> None:
    fmu = foreign_fmu(tmp_path / "lag.fmu", input_unit="1", output_unit="1", gain=0.5)
    with FmuPlant(fmu, quantities=Quantities("mbar", "um/s", ("bar", "mm/s"))) as plant:
        # one bar gives half a millimetre per second
        assert plant.step(1000.0, 10.0) == pytest.approx(500.0, rel=1e-9)
