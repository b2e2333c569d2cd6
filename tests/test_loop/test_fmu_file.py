"""FMUs that cannot be used: refused before anything is unpacked or loaded, and what is said; ports and units."""

import math
import shutil
import stat
import struct
import tempfile
import zipfile
from pathlib import Path

import pytest
from few import few
from fmpy import platform

from bender_loop.errors import InputError
from bender_loop.fmu.archive import bounds as fmu_bounds
from bender_loop.fmu.archive.binary import binary_fault, platform_of, read_header
from bender_loop.fmu.check.check import check
from bender_loop.fmu.file import read_description
from bender_loop.fmu.plant import FmuPlant
from bender_loop.fmu.ports import find_input, find_output, parameter_settings
from bender_loop.tables.quantities import USUAL

VERSION = 'fmiVersion="2.0"'


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("nowhere.fmu", "no such file"),
        ("none", "a folder, expected an FMU; FMUs in it: none"),
        ("some", r"a folder, expected an FMU; FMUs in it: Plant\.fmu"),
        *((x, "not a zip archive or damaged") for x in ("empty.fmu", "text.fmu", "begun.fmu")),
        ("half.fmu", "damaged"),
    ],
)
def test_what_is_no_archive_is_refused(lag_fmu, tmp_path, name, message):
    (tmp_path / "none").mkdir()
    (tmp_path / "some").mkdir()
    (tmp_path / "some" / "Plant.fmu").touch()
    texts = {"empty": b"", "text": b"not a zip archive", "begun": b"PK\x03\x04 and then nothing"}
    for other, data in (texts | {"half": lag_fmu.read_bytes()[:100_000]}).items():
        (tmp_path / f"{other}.fmu").write_bytes(data)
    with pytest.raises(InputError, match=message):
        FmuPlant(tmp_path / name)


@pytest.mark.parametrize("method", [zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2, zipfile.ZIP_DEFLATED])
def test_a_damaged_entry_in_any_way_of_packing_is_bad_input(lag_fmu, tmp_path, method):
    path = tmp_path / "packed.fmu"
    with zipfile.ZipFile(lag_fmu) as old, zipfile.ZipFile(path, "w", method) as new:
        for name in old.namelist():
            new.writestr(name, old.read(name))
        entry = new.getinfo("modelDescription.xml")
    data = bytearray(path.read_bytes())
    begin = entry.header_offset + 30 + len(entry.filename)
    data[begin + 12 : begin + 60] = bytes(48)
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"damaged|cannot be"):
        FmuPlant(path, input_name="u", output_name="y")


@pytest.mark.parametrize("entry", [b"modelDescription.xml", b".py", b".so"])
def test_archive_with_flipped_bytes(lag_fmu, tmp_path, entry):
    data = bytearray(lag_fmu.read_bytes())
    start = data.index(entry) + len(entry) + 200
    data[start : start + 50] = bytes(byte ^ 0xFF for byte in data[start : start + 50])
    path = tmp_path / "flipped.fmu"
    path.write_bytes(data)
    with pytest.raises(InputError, match="damaged"):
        FmuPlant(path, input_name="u", output_name="y")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("<ModelVariables>", "<ModelVariables", "not well-formed"),
        ('valueReference="0"', 'valueReference="first"', r"modelDescription.xml cannot be used"),
        ("<CoSimulation", "<ModelExchange", "found a model-exchange FMU, expected co-simulation"),
        ('causality="input"', 'causality="local"', "found no input that is one real number"),
        *((f'{x}="', f'{x}="a', rf"DefaultExperiment, {x}: found 'a.*', expected") for x in ("stepSize", "stopTime")),
        *((VERSION, f'fmiVersion="{x}"', rf"version {x}, expected 2.0 or 3.0") for x in ("1.0", "4.0", "2.1")),
    ],
)
def test_what_is_no_fmu_of_ours_to_run_is_refused(edited, old, new, message):
    with pytest.raises(InputError, match=message):
        FmuPlant(edited((old, new)), output_name="y")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("modelDescription.xml", None, r"no modelDescription.xml"),
        (f"binaries/{platform}", "binaries/amiga500", r"no binary binaries/.* found binaries for amiga500, win"),
    ],
)
def test_an_fmu_without_description_or_binary_is_refused(edited, old, new, message):
    with pytest.raises(InputError, match=message):
        FmuPlant(edited(rename=lambda name: name.replace(old, new) if new else None if name == old else name))


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


def test_ports_are_found_by_themselves_where_there_is_no_choice(edited):
    with FmuPlant(edited(('name="y"', 'name="displacement"'))) as plant:
        assert (plant.input.name, plant.output.name) == ("u", "displacement")


@pytest.mark.parametrize(
    ("ports", "message"),
    [
        ((None, None), r"found 4 Real outputs, none called displacement.*held, y, doubled"),
        (("uu", "y"), "no variable 'uu', expected a Real input; there is u"),
        (("gain", "y"), "'gain' is a Real parameter, expected a Real input"),
        (("u", "steps"), "'steps' is a Integer output, expected a Real output"),
    ],
)
def test_wrong_ports(lag_fmu, ports, message):
    with pytest.raises(InputError, match=message):
        FmuPlant(lag_fmu, input_name=ports[0], output_name=ports[1])


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"gian": 1.0}, "no parameter 'gian'; there are gain, time_constant"),
        ({"y": 1.0}, "'y' is a output variable, expected a parameter"),
        ({"gain": math.nan}, "parameter 'gain': found nan, expected a finite number"),
        ({"forgetful": 0.5}, "parameter 'forgetful': found 0.5, expected a value of type Boolean"),
        ({"gain": -1.0}, "parameter 'gain': found -1.0, expected at least 0 m/V"),
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


def ports_with_units(edited, input_unit, output_unit, definitions="", quantities=USUAL):
    path = edited(
        ("<ModelVariables>", f"<UnitDefinitions>{definitions}</UnitDefinitions><ModelVariables>"),
        ('<Real start="5"/>', f'<Real start="5" unit="{input_unit}" />'),
        ("<Real/>", f'<Real unit="{output_unit}" />'),
    )
    description = read_description(path)
    return find_input(path, description, "u", quantities), find_output(path, description, "y", quantities)


INCH = '<Unit name="inch"><BaseUnit m="1" factor="0.0254"/></Unit><Unit name="rad"><BaseUnit rad="1"/></Unit>'


@pytest.mark.parametrize(
    ("declared", "internal"),
    [
        (("V", "m"), (1.0, 1e6)), (("mV", "mm"), (1e-3, 1e3)), (("kV", "um"), (1e3, 1.0)), (("", ""), (1.0, 1e6)),
        (("N", "rad"), (1.0, 1.0)), (("V", "\N{MICRO SIGN}m"), (1.0, 1.0)), (("V", "nm"), (1.0, 1e-3)),
        (("V", "\N{GREEK SMALL LETTER MU}m"), (1.0, 1.0)), (("V", "inch"), (1.0, 25400.0)),
    ],
)  # fmt: skip
def test_units_are_those_that_the_fmu_declares(edited, declared, internal):
    found = ports_with_units(edited, *declared, definitions=INCH)
    assert (found[0].internal, found[1].internal) == pytest.approx(internal, rel=1e-15)


@pytest.mark.parametrize(
    ("declared", "stated", "internal"),
    [
        (("", ""), ("mV", "nm"), (1e-3, 1e-3)),
        (("mV", "mm"), ("kV", "m"), (1e-3, 1e3)),
        (("mV", "mm"), ("", ""), (1e-3, 1e3)),
    ],
)
def test_a_declared_unit_counts_and_without_one_what_was_stated(edited, declared, stated, internal):
    own = USUAL._replace(stated=stated)
    found = ports_with_units(edited, *declared, quantities=own)
    assert (found[0].internal, found[1].internal) == internal


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


GIB = 1 << 30


@pytest.fixture
def own_temporary(tmp_path, monkeypatch):
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def with_entry(fmu: Path, out: Path, name: str, data: bytes = b"x", size: int | None = None, mode: int = 0) -> Path:
    """A copy with one more entry, which claims to unpack to `size` bytes."""
    shutil.copy(fmu, out)
    with zipfile.ZipFile(out, "a", zipfile.ZIP_DEFLATED) as archive:
        entry = zipfile.ZipInfo(name)
        entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, mode << 16
        archive.writestr(entry, data)
        if size is not None:
            archive.filelist[-1].file_size = size
    return out


@pytest.mark.parametrize("run", [True, False])
def test_an_archive_that_unpacks_to_more_than_the_bound_is_a_finding_and_is_never_read_through(
    lag_fmu, tmp_path, own_temporary, run
):
    path = with_entry(lag_fmu, tmp_path / "bomb.fmu", "resources/zeros", size=6 * GIB)
    report = check(path, trial=run)
    assert [finding.what for finding in report.faults] == ["the archive unpacks to 6 GiB, expected at most 4 GiB"]
    assert report.ran == ("archive",)
    assert not list(own_temporary.iterdir())
    with pytest.raises(InputError, match="unpacks to 6 GiB, expected at most 4 GiB"):
        FmuPlant(path, input_name="u", output_name="y")


@pytest.mark.slow
def test_a_ratio_that_no_model_has_is_refused_where_it_would_hurt(lag_fmu, tmp_path, monkeypatch):
    path = with_entry(lag_fmu, tmp_path / "zeros.fmu", "resources/zeros", bytes(30 << 20))
    assert not any("unpacks" in finding.what for finding in check(path, trial=False).faults)
    monkeypatch.setattr(fmu_bounds, "SMALL_BYTES", 1 << 20)
    monkeypatch.setattr(fmu_bounds, "MOST_RATIO", 5)
    with pytest.raises(InputError, match=r"unpacks to 3.* MiB, .* times its own size"):
        FmuPlant(path, input_name="u", output_name="y")


def test_too_many_entries_and_more_than_fits_on_the_disk_are_refused(lag_fmu, monkeypatch):
    usage = shutil.disk_usage("/")._replace(free=1000)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage)
    with pytest.raises(InputError, match="more than half of the 1000 bytes that are free"):
        FmuPlant(lag_fmu, input_name="u", output_name="y")
    monkeypatch.setattr(fmu_bounds, "MOST_ENTRIES", 3)
    with pytest.raises(InputError, match="entries, expected at most 3"):
        FmuPlant(lag_fmu, input_name="u", output_name="y")


@pytest.mark.parametrize("name", ["../outside", "/outside", "a/../../outside", "C:outside"])
def test_a_name_that_leaves_the_folder_unpacks_nothing(lag_fmu, tmp_path, own_temporary, name):
    path = with_entry(lag_fmu, tmp_path / "names.fmu", name)
    with pytest.raises(InputError, match="not a relative path"):
        FmuPlant(path, input_name="u", output_name="y")
    assert not list(own_temporary.iterdir())
    assert not list(tmp_path.rglob("outside"))


def test_a_link_is_refused(lag_fmu, tmp_path):
    path = with_entry(lag_fmu, tmp_path / "link.fmu", "resources/link", b"/etc/passwd", mode=stat.S_IFLNK | 0o777)
    with pytest.raises(InputError, match="a symbolic link"):
        FmuPlant(path, input_name="u", output_name="y")


def elf(machine: int = 62, kind: int = 3, bits: int = 64, order: str = "<") -> bytes:
    """A header with one loadable segment that spans it."""
    ident = b"\x7fELF" + bytes([bits // 32, 1 if order == "<" else 2, 1]) + bytes(9)
    if bits == 64:
        head = struct.pack(f"{order}HHIQQQIHHHHHH", kind, machine, 1, 0, 64, 0, 0, 64, 56, 1, 0, 0, 0)
        return ident + head + struct.pack(f"{order}IIQQQQQQ", 1, 5, 0, 0, 0, 120, 120, 4096)
    head = struct.pack(f"{order}HHIIIIIHHHHHH", kind, machine, 1, 0, 52, 0, 0, 52, 32, 1, 0, 0, 0)
    return ident + head + struct.pack(f"{order}IIIIIIII", 1, 0, 0, 0, 84, 84, 5, 4096)


def pe(machine: int = 0x8664, characteristics: int = 0x2000) -> bytes:
    head = b"MZ" + bytes(58) + struct.pack("<I", 64)
    return head + b"PE\0\0" + struct.pack("<HHIIIHH", machine, 0, 0, 0, 0, 0, characteristics)


def mach(machine: int = 0x01000007, kind: int = 6) -> bytes:
    return struct.pack("<IIIIIII", 0xFEEDFACF, machine, 3, kind, 0, 0, 0)


@pytest.mark.parametrize(
    ("folder", "data"),
    [
        ("linux64", elf()),
        ("x86_64-linux", elf()),
        ("linux32", elf(3, bits=32)),
        ("aarch64-linux", elf(183)),
        ("win64", pe()),
        ("win32", pe(0x14C)),
        ("x86_64-windows", pe()),
        ("darwin64", mach()),
        ("darwin64", mach(0x0100000C)),
        ("aarch64-darwin", mach(0x0100000C, kind=8)),
        ("amiga500", b"whatever"),
    ],
)
def test_libraries_for_their_platform(folder, data):
    assert binary_fault(folder, data, len(data)) is None


@pytest.mark.parametrize(
    ("folder", "data", "said"),
    [
        ("linux64", b"#!/bin/sh\n", "no machine code"),
        ("linux64", b"", "an empty file"),
        ("linux64", elf(3, bits=32), "ELF file for x86,"),
        ("linux64", elf(183), "ELF file for aarch64,"),
        ("linux64", elf(62, bits=32), "with 32 bit addresses"),
        ("linux64", elf(21, order=">"), "ELF file for powerpc64,"),
        ("linux64", elf(kind=2), "no shared library"),
        ("linux64", elf()[:30], "cut off"),
        ("linux64", elf()[:100], "cut off"),
        ("linux64", pe(), "a PE file for x86_64"),
        ("win64", pe(characteristics=2), "no shared library"),
        ("win64", pe(0xAA64), "PE file for aarch64"),
        ("win64", b"MZ", "cut off"),
        ("aarch64-darwin", mach(), "Mach-O file for x86_64,"),
        ("darwin64", mach(kind=2), "no shared library"),
    ],
)
def test_what_no_importer_can_load(folder, data, said):
    fault = binary_fault(folder, data, len(data))
    assert fault is not None
    assert said in fault


def test_a_library_that_lost_its_end():
    assert "cut off" in str(binary_fault("linux64", elf(), 119))


def test_random_bytes_behind_every_magic_are_judged_without_a_fault():
    for magic in (b"\x7fELF\x02\x01", b"\x7fELF\x01\x02", b"MZ", b"\xcf\xfa\xed\xfe", b"\xca\xfe\xba\xbe"):
        for fill in (b"\x00", b"\xff", b"\x01", b"\x7f"):
            for length in (0, 10, 60, 70, 300):
                assert binary_fault("linux64", magic + fill * length, 400) is not None


def test_the_binary_of_this_platform_is_what_it_says(lag_fmu):
    with zipfile.ZipFile(lag_fmu) as archive:
        (name,) = (name for name in archive.namelist() if name.startswith(f"binaries/{platform}/"))
        found = read_header(archive.read(name))
    assert found is not None
    assert (found.machines[0], found.shared) == ((platform_of(platform) or ("", ""))[1], True)


@pytest.mark.parametrize("binary", few([b"text", elf(3, bits=32), elf(40, bits=32)], 0))
def test_the_check_without_a_run_finds_a_binary_that_cannot_be_loaded(edited, binary):
    faults = check(edited(binary=binary), trial=False).faults
    assert any(
        f"binaries/{platform}/" in finding.what and "expected a shared library" in finding.what for finding in faults
    )


FMI_3 = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="Ramp" instantiationToken="{1}">
<{interface} modelIdentifier="Ramp"/>
<ModelVariables><Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
</ModelVariables><ModelStructure/></fmiModelDescription>"""


@pytest.mark.parametrize("interface", ["CoSimulation", "ModelExchange", "ScheduledExecution"])
@pytest.mark.parametrize(("folder", "broken"), [("x86_64-linux", False), ("linux64", True)])
def test_an_fmu_of_fmi_3_has_other_folders(tmp_path, monkeypatch, interface, folder, broken):
    monkeypatch.setattr("fmpy.platform_tuple", "x86_64-linux")
    path = tmp_path / "ramp.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", FMI_3.replace("{interface}", interface))
        archive.writestr(f"binaries/{folder}/Ramp.so", elf())
    faults = [finding.what for finding in check(path, trial=False).faults]
    assert bool(faults) is broken, faults
    assert not any(fault.endswith("there are ") for fault in faults)
