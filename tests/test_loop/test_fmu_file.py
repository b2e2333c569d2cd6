"""FMUs that cannot be used, and what is said of them; ports and their units."""

import math
import tempfile
import zipfile
from pathlib import Path

import fmpy
import pytest

from bender_loop.errors import InputError
from bender_loop.fmu.check.check import check
from bender_loop.fmu.file import read_description
from bender_loop.fmu.plant import FmuPlant
from bender_loop.fmu.ports import find_input, find_output, parameter_settings
from bender_loop.tables.quantities import USUAL

VERSION = 'fmiVersion="2.0"'


def test_missing_file(tmp_path):
    with pytest.raises(InputError, match=r"nowhere.fmu: no such file"):
        FmuPlant(tmp_path / "nowhere.fmu")


def test_a_folder_is_no_fmu(tmp_path):
    with pytest.raises(InputError, match="a folder, expected an FMU; FMUs in it: none"):
        FmuPlant(tmp_path)


def test_a_folder_of_fmus_is_said_to_be_one(tmp_path):
    (tmp_path / "Plant.fmu").write_bytes(b"")
    with pytest.raises(InputError, match=r"a folder, expected an FMU; FMUs in it: Plant\.fmu"):
        read_description(tmp_path)


@pytest.mark.parametrize("data", [b"", b"not a zip archive", b"PK\x03\x04 and then nothing"])
def test_not_an_archive(tmp_path, data):
    path = tmp_path / "text.fmu"
    path.write_bytes(data)
    with pytest.raises(InputError, match="not a zip archive or damaged"):
        FmuPlant(path)


def test_truncated_archive(lag_fmu, tmp_path):
    path = tmp_path / "half.fmu"
    path.write_bytes(lag_fmu.read_bytes()[:100_000])
    with pytest.raises(InputError, match="damaged"):
        FmuPlant(path)


@pytest.mark.parametrize("entry", [b"modelDescription.xml", b".py", b".so"])
def test_archive_with_flipped_bytes(lag_fmu, tmp_path, entry):
    data = bytearray(lag_fmu.read_bytes())
    start = data.index(entry) + len(entry) + 200
    data[start : start + 50] = bytes(byte ^ 0xFF for byte in data[start : start + 50])
    path = tmp_path / "flipped.fmu"
    path.write_bytes(data)
    with pytest.raises(InputError, match="damaged"):
        FmuPlant(path, input_name="u", output_name="y")


def test_no_model_description(edited):
    path = edited(rename=lambda name: None if name == "modelDescription.xml" else name)
    with pytest.raises(InputError, match=r"no modelDescription.xml"):
        FmuPlant(path)


def test_model_description_that_is_no_xml(edited):
    with pytest.raises(InputError, match="not well-formed"):
        FmuPlant(edited(("<ModelVariables>", "<ModelVariables")))


def test_model_description_that_makes_no_sense(edited):
    with pytest.raises(InputError, match=r"modelDescription.xml cannot be used"):
        FmuPlant(edited(('valueReference="0"', 'valueReference="first"')))


@pytest.mark.parametrize("version", ["1.0", "4.0", "2.1"])
def test_other_fmi_version(edited, version):
    with pytest.raises(InputError, match=rf"found FMI version {version}, expected 2.0 or 3.0"):
        FmuPlant(edited((VERSION, f'fmiVersion="{version}"')))


def test_model_exchange_only(edited):
    with pytest.raises(InputError, match="found a model-exchange FMU, expected co-simulation"):
        FmuPlant(edited(("<CoSimulation", "<ModelExchange")))


def test_no_binary_for_this_platform(edited):
    with pytest.raises(InputError, match=r"no binary binaries/.* found binaries for amiga500, win"):
        FmuPlant(edited(rename=lambda name: name.replace(f"binaries/{fmpy.platform}", "binaries/amiga500")))


def test_a_binary_that_is_none(edited, tmp_path, monkeypatch):
    path = edited(binary=b"not a library")
    folder = tmp_path / "unpacked"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    before = Path.cwd()
    with pytest.raises(InputError, match="found no machine code"):
        FmuPlant(path, input_name="u", output_name="y")
    assert not list(folder.iterdir())
    assert Path.cwd() == before


def test_ports_are_found_by_themselves_where_there_is_no_choice(edited, lag_fmu):
    with pytest.raises(InputError, match=r"found 4 Real outputs, none called displacement.*held, y, doubled"):
        FmuPlant(lag_fmu)
    with FmuPlant(edited(('name="y"', 'name="displacement"'))) as plant:
        assert (plant.input.name, plant.output.name) == ("u", "displacement")


def test_no_input_at_all(edited):
    path = edited(('causality="input"', 'causality="local"'))
    with pytest.raises(InputError, match="found no input that is one real number"):
        FmuPlant(path, output_name="y")


@pytest.mark.parametrize(
    ("ports", "message"),
    [
        ({"input_name": "uu", "output_name": "y"}, "no variable 'uu', expected a Real input; there is u"),
        (
            {"input_name": "u", "output_name": "Y"},
            "no variable 'Y', expected a Real output; there are held, y, doubled",
        ),
        ({"input_name": "gain", "output_name": "y"}, "'gain' is a Real parameter, expected a Real input"),
        ({"input_name": "u", "output_name": "steps"}, "'steps' is a Integer output, expected a Real output"),
        ({"input_name": "y", "output_name": "u"}, "'y' is a Real output, expected a Real input"),
    ],
)
def test_wrong_ports(lag_fmu, ports, message):
    with pytest.raises(InputError, match=message):
        FmuPlant(lag_fmu, **ports)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"gian": 1.0}, "no parameter 'gian'; there are gain, time_constant"),
        ({"y": 1.0}, "'y' is a output variable, expected a parameter"),
        ({"gain": math.nan}, "parameter 'gain': found nan, expected a finite number"),
        ({"forgetful": 0.5}, "parameter 'forgetful': found 0.5, expected a value of type Boolean"),
        ({"gain": -1.0}, "parameter 'gain': found -1.0, expected at least 0 m/V"),
        ({"gain": 2.0}, "parameter 'gain': found 2.0, expected at most 1 m/V"),
    ],
)
def test_wrong_parameters(edited, values, message):
    path = edited(('<Real start="1e-06"/>', '<Real start="1e-06" min="0" max="1" unit="m/V" />'))
    with pytest.raises(InputError, match=message):
        parameter_settings(path, read_description(path), values)


def test_near_names_are_listed_where_there_are_many(edited):
    kind = 'causality="parameter" variability="fixed"'
    many = "".join(
        f'<ScalarVariable name="bending_{k}" valueReference="{k}" {kind}><Real start="0"/></ScalarVariable>'
        for k in range(100, 130)
    )
    path = edited(("</ModelVariables>", many + "</ModelVariables>"))
    with pytest.raises(InputError, match=r"35 others, nearest .*bending_105"):
        parameter_settings(path, read_description(path), {"Bending_105x": 1.0})


def ports_with_units(edited, input_unit, output_unit, definitions=""):
    path = edited(
        ("<ModelVariables>", f"<UnitDefinitions>{definitions}</UnitDefinitions><ModelVariables>"),
        ('<Real start="5"/>', f'<Real start="5" unit="{input_unit}" />'),
        ("<Real/>", f'<Real unit="{output_unit}" />'),
    )
    description = read_description(path)
    return find_input(path, description, "u"), find_output(path, description, "y")


@pytest.mark.parametrize(("unit", "volts"), [("V", 1.0), ("mV", 1e-3), ("kV", 1e3), ("", 1.0), ("N", 1.0)])
def test_input_unit(edited, unit, volts):
    assert ports_with_units(edited, unit, "m")[0].internal == volts


@pytest.mark.parametrize(
    ("unit", "micrometres"),
    [
        ("m", 1e6), ("mm", 1e3), ("um", 1.0), ("\N{MICRO SIGN}m", 1.0), ("\N{GREEK SMALL LETTER MU}m", 1.0),
        ("nm", 1e-3), ("", 1e6), ("rad", 1.0), ("inch", 25400.0),
    ],
)  # fmt: skip
def test_output_unit(edited, unit, micrometres):
    inch = '<Unit name="inch"><BaseUnit m="1" factor="0.0254"/></Unit><Unit name="rad"><BaseUnit rad="1"/></Unit>'
    assert ports_with_units(edited, "V", unit, inch)[1].internal == pytest.approx(micrometres, rel=1e-15)


def test_a_port_without_unit_is_in_what_was_stated(edited):
    path = edited()
    description = read_description(path)
    own = USUAL._replace(stated=("mV", "nm"))
    assert find_input(path, description, "u", own).internal == 1e-3
    assert find_output(path, description, "y", own).internal == 1e-3


@pytest.mark.parametrize(("stated", "internal"), [(("kV", "m"), (1e-3, 1e3)), (("", ""), (1e-3, 1e3))])
def test_a_declared_unit_counts_whatever_was_stated(edited, stated, internal):
    path = edited(('<Real start="5"/>', '<Real start="5" unit="mV" />'), ("<Real/>", '<Real unit="mm" />'))
    description = read_description(path)
    own = USUAL._replace(stated=stated)
    assert find_input(path, description, "u", own).internal == internal[0]
    assert find_output(path, description, "y", own).internal == internal[1]


def test_units_reach_the_plant(edited):
    path = edited(('<Real start="5"/>', '<Real start="5" unit="mV" />'), ("<Real/>", '<Real unit="mm" />'))
    with FmuPlant(path, input_name="u", output_name="y") as plant:
        plant.reset()
        # 1 mm per mV of input (gain 1e-6 of the number set), settled.
        assert plant.step(2.0, 10.0) == pytest.approx(2000.0 * 1e-6 * 1e3, rel=1e-12)


def test_a_description_that_unpacks_to_more_than_any_model_needs_is_refused(lag_fmu, monkeypatch):
    monkeypatch.setattr("bender_loop.fmu.file.LARGEST_DESCRIPTION", 100)
    with pytest.raises(InputError, match=r"modelDescription.xml unpacks to .* bytes, expected at most 100"):
        read_description(lag_fmu)
    with pytest.raises(InputError, match=r"modelDescription.xml unpacks to .* bytes, expected at most 100"):
        check(lag_fmu, trial=False)


def test_the_archive_is_checked_where_the_description_cannot_be_read(edited):
    path = edited(("<?xml", "<no>"))
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("../outside.txt", "")
    report = check(path, trial=False)
    assert report.ran == ("archive",)
    assert any("'../outside.txt'" in finding.what for finding in report.faults)
