"""The corrected FMU is driven: by a process begun before, without PythonFMU, at the beginning of a long record."""

import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bender_compiled.parallel_map import THREADS
from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.conclusion.measurement import gap
from bender_discrepancy.conclusion.measurement.corrected_model import driven
from bender_discrepancy.conclusion.measurement.driver import Driver
from bender_discrepancy.conclusion.measurement.gap import _build
from bender_discrepancy.workflow import diagnose
from bender_export.build import build_plant_fmu
from bender_inference.settings import Settings
from bender_loop.errors import RunError
from bender_loop.fmu.plant import FmuPlant
from bender_loop.records.record import Record
from bender_native.compilers import own_compiler
from bender_plant.model import Model, load_model


@pytest.mark.slow
@pytest.mark.skipif(own_compiler() is None, reason="no C compiler on this machine")
def test_where_pythonfmu_cannot_run_the_corrected_fmu_has_no_python(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    model = load_model("paper").with_block("transport_delay", delay_s=0.0123)
    usual = build_plant_fmu(model, tmp_path / "usual.fmu")
    monkeypatch.setattr(gap, "unsupported", lambda: "no binary here")
    native = _build(model, tmp_path / "native.fmu")
    readings = []
    for fmu in (usual, native):
        with FmuPlant(fmu) as plant:
            plant.reset()
            readings.append([plant.step(10.0 * (k % 4), 0.01) for k in range(80)])
    assert readings[0] == readings[1]
    assert native.read_bytes() != usual.read_bytes()


def test_a_long_record_is_judged_to_its_end_though_the_fmu_is_driven_at_its_beginning(
    monkeypatch: pytest.MonkeyPatch,
):
    model = load_model("beam")
    times = np.linspace(0.0, 11.98, 600)
    volts = np.repeat(np.random.default_rng(3).uniform(0.0, 30.0, 60), 10)
    read = Simulator(Drive.of_rows(times, volts)).run(model.with_block("calibration", gain=1.3)).reading_um
    read = read + np.random.default_rng(4).normal(0.0, 0.02, times.size)
    record = Record(times, volts, read)
    monkeypatch.setattr(gap, "MOST_STEPS", 200)
    driven: list[int] = []
    play = gap._played

    def counted(models: Sequence[Model], drives: Sequence[Drive], *others: Any) -> list[np.ndarray]:
        driven.extend(x.row_time_s.size for x in drives)
        return play(models, drives, *others)

    monkeypatch.setattr(gap, "_played", counted)
    found = diagnose(model, [record], Settings(), None, ["record"])
    assert max(driven) < times.size
    assert found.gap.after_um[0].size == times.size
    assert found.gap.after.all_rms_um < 0.03


@pytest.mark.parametrize(("most_substeps", "is_driven"), [(gap.MOST_SUBSTEPS, False), (1.0, True)])
def test_coarse_sub_steps_that_disagree_are_made_fine_where_memory_allows(
    monkeypatch: pytest.MonkeyPatch, most_substeps: float, is_driven: bool
) -> None:
    model = load_model("beam")
    times = np.arange(400) / 100.0
    drive = Drive(times, times, 20.0 * np.sin(40.0 * times), linear=True, smooth=True)
    exact = Simulator(drive).run(model).reading_um
    noise_um = 1e-4 * np.random.default_rng(2).standard_normal(exact.size)
    monkeypatch.setattr(gap, "MOST_SUBSTEPS", most_substeps)
    beyond = gap._simulated_beyond(model, drive, exact[:100], exact + noise_um)
    assert (beyond is None) == is_driven
    if beyond is not None:
        np.testing.assert_allclose(beyond, exact[100:], atol=1e-9)


VOLTS = np.array([0.0, 10.0, 30.0, 5.0, 5.0, 0.0])
RECORD = Record(np.linspace(0.0, 0.25, VOLTS.size), VOLTS, np.zeros(VOLTS.size))


@pytest.fixture
def begun(monkeypatch: pytest.MonkeyPatch) -> "list[subprocess.Popen[bytes]]":
    """Every process that is begun, on a machine with two cores."""
    monkeypatch.setenv(THREADS, "2")
    found: list[subprocess.Popen[bytes]] = []
    popen = subprocess.Popen

    def kept(*words: object, **how: object) -> "subprocess.Popen[bytes]":
        found.append(popen(*words, **how))  # pyright: ignore[reportArgumentType, reportCallIssue]
        return found[-1]

    monkeypatch.setattr(subprocess, "Popen", kept)
    return found


@pytest.mark.slow
def test_a_process_begun_before_drives_as_a_new_one_does(
    tmp_path: Path, begun: "list[subprocess.Popen[bytes]]"
) -> None:
    fmu = build_plant_fmu(load_model("beam"), tmp_path / "plant.fmu")
    (alone,) = driven(fmu, [RECORD])
    with Driver() as driver:
        driver.begin()
        driver.begin()
        assert len(begun) == 2
        (first,) = driven(fmu, [RECORD], driver=driver)
        assert len(begun) == 2
        (second,) = driven(fmu, [RECORD], driver=driver)
    assert len(begun) == 3
    assert np.ptp(alone) > 1.0
    np.testing.assert_array_equal(first, alone)
    np.testing.assert_array_equal(second, alone)
    assert [x.poll() for x in begun] == [0, 0, 0]


def test_what_was_begun_and_never_needed_ends_with_the_block(begun: "list[subprocess.Popen[bytes]]") -> None:
    with Driver() as driver:
        driver.begin()
        assert begun[0].poll() is None
    assert begun[0].returncode is not None


def test_a_process_that_was_killed_or_has_nothing_to_drive_is_a_failed_run(
    tmp_path: Path, begun: "list[subprocess.Popen[bytes]]"
) -> None:
    with Driver() as driver:
        driver.begin()
        begun[0].kill()
        with pytest.raises(RunError, match="could not be driven"):
            driven(tmp_path / "none.fmu", [RECORD], driver=driver)
    with pytest.raises(RunError, match=r"none\.fmu"):
        driven(tmp_path / "none.fmu", [RECORD])


def test_one_core_begins_nothing_beforehand(
    begun: "list[subprocess.Popen[bytes]]", monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(THREADS, "1")
    with Driver() as driver:
        driver.begin()
    assert begun == []
