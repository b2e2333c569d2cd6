"""An FMU is driven by a process that was begun before there was one as by a new one, and no process is left behind."""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from bender_compiled.parallel_map import THREADS
from bender_discrepancy.conclusion.measurement.corrected_model import driven
from bender_discrepancy.conclusion.measurement.driver import Driver
from bender_export.build import build_plant_fmu
from bender_loop.errors import RunError
from bender_loop.records.record import Record
from bender_plant.model import load_model

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
