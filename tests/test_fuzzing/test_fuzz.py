"""Inputs that nobody would send on purpose: a slice of them, and that a fault would be noticed."""

import os
import random
import shutil
import zipfile
from pathlib import Path

import pytest
from fuzzing.apart import complaints_of
from fuzzing.calls import CallFuzzer, call_cases
from fuzzing.commands import command_cases
from fuzzing.hostile_campaign import BAD_INPUT, try_inputs
from fuzzing.hostile_commands import HARDWARE_RUN, SIMULATE, sound_files
from fuzzing.hostile_words import Sound
from fuzzing.strange_tables import EVERY, table_case
from fuzzing.table_reading import read_case, table_cases
from pythonfmu.builder import FmuBuilder

from bender_cli.main import main
from bender_export.build import ensure_controller_fmu, ensure_plant_fmu

FAULTY = Path(__file__).parents[1] / "test_loop" / "slaves" / "bender_loop_test_faulty.py"


def faulty(folder: Path, fault: str) -> Path:
    made = Path(FmuBuilder.build_FMU(FAULTY, dest=folder, canGetAndSetFMUstate=True, needsExecutionTool=False))
    with zipfile.ZipFile(made, "a") as archive:
        archive.writestr("resources/fault.txt", fault)
    return made


@pytest.mark.slow
def test_illegal_values_in_legal_calls_give_no_complaint():
    assert complaints_of(call_cases, [ensure_plant_fmu("paper"), ensure_controller_fmu()], 180, 3) == []


@pytest.mark.slow
def test_a_damaged_fmu_is_checked_or_tuned_or_refused_in_a_sentence(tmp_path: Path):
    assert complaints_of(command_cases, ensure_plant_fmu("paper"), 10, 3, tmp_path) == []


def test_a_crash_is_a_complaint(tmp_path: Path):
    (complaint,) = complaints_of(call_cases, [faulty(tmp_path, "crash")], 10, 1)
    assert "exit code -6" in complaint


def test_a_silent_nan_is_a_complaint(tmp_path: Path):
    fuzzer = CallFuzzer(faulty(tmp_path, "lets nan through"), random.Random(1))
    for _ in range(50):
        fuzzer.run(12)
    fuzzer.close()
    assert any("nan] without an error" in text for text in fuzzer.complaints)


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="forks off a process that has the libraries loaded")
def test_a_slice_of_the_bad_inputs_is_refused_or_right():
    told: list[int] = []
    # every other one of the makers, so that one interpreter of its own is among them
    tally = try_inputs(
        ensure_plant_fmu("paper"), 60, 5, 2, lambda tally, _: told.append(tally.tried), only=range(1, 60, 2)
    )
    assert tally.complaints == []
    assert told[-1] == tally.tried == 30
    assert tally.statuses[str(BAD_INPUT)] >= 15


@pytest.mark.slow
@pytest.mark.parametrize("command", [SIMULATE, ["compare", "record.csv", "--model", "model.toml"], HARDWARE_RUN])
def test_what_is_damaged_was_sound_before(command: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys):
    sound_files(tmp_path, Sound(ensure_plant_fmu("paper").read_bytes()), command)
    monkeypatch.chdir(tmp_path)
    # the bench of hardware is sound, and nobody answers there
    assert main(command) == (1 if command is HARDWARE_RUN else 0)
    assert "Connection refused" in capsys.readouterr().err or command is not HARDWARE_RUN


@pytest.mark.skipif(os.name == "nt", reason="catches the streams of C libraries")
def test_a_slice_of_the_records_in_other_formats_gives_no_complaint(tmp_path: Path):
    pytest.importorskip("h5py")
    pytest.importorskip("pyarrow")
    pytest.importorskip("nptdms")
    assert complaints_of(table_cases, 100, 2, tmp_path) == []


def test_every_format_has_its_share_and_a_wrong_reading_is_a_complaint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip("h5py")
    pytest.importorskip("pyarrow")
    pytest.importorskip("nptdms")
    done = set()
    for k in range(600):
        (place := tmp_path / str(k)).mkdir()
        path, _, what, rows = table_case(place, random.Random(k))
        done.add(what)
        assert (rows > 0) is what.endswith(": sound")
        assert path.exists()
    assert {x.partition(":")[0] for x in done} == set(EVERY)
    for fault, said in (
        (lambda *_: exec("raise ZeroDivisionError"), "ZeroDivisionError"),
        (lambda *_: os.write(2, b"HDF5-DIAG: no\n") and None, "said beside its sentence"),
        (lambda *_: (tmp_path / "work" / "scrap").touch(), "left files behind"),
    ):
        (place := tmp_path / "work").mkdir()
        monkeypatch.setattr("bender_loop.records.arguments.record_of", fault)
        monkeypatch.setattr("fuzzing.table_reading.table_case", lambda *_: (place / "a", (), "x", 0))
        assert said in next(read_case(random.Random(1), place))
        shutil.rmtree(place)
