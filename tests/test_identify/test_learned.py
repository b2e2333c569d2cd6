"""A first model that cannot be made is bad input: one sentence, from the command and from Python alike."""

from pathlib import Path

import numpy as np
import pytest
import scipy.optimize
from scipy.signal import lfilter

import piezo_bender as pb
from bender_cli.main import main
from bender_identify.first_model import learned
from bender_identify.first_model.choice import first_model
from bender_identify.first_model.course import experiments_of
from bender_identify.first_model.structures import Structure
from bender_inference.settings import Settings
from bender_inference.structures import competing_structures
from bender_loop.records.record import Record, write_record
from bender_plant.model import ModelError

SAID = "no first model could be fitted: "
ROWS = 120


def lagging(volts: float = 1.0, microns: float = 1.0) -> Record:
    """Return a record of a lag; so many times the volts and micrometres."""
    rng = np.random.default_rng(3)
    u = np.repeat(rng.uniform(0.0, 50.0, ROWS // 10), 10)
    y = lfilter([0.0, 0.08], [1.0, -0.6], u) + 0.05 * rng.standard_normal(ROWS)
    return Record(np.arange(ROWS) / 30.0, volts * u, microns * y)


def told(record: Record, folder: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """Return the sentence of the command, which is that of Python as well."""
    write_record(folder / "record.csv", record)
    files = [str(folder / "record.csv"), "--out", str(folder / "m.toml")]
    assert main(["model", "fit", *files, "--template", "gain", "--quiet"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    with pytest.raises(pb.InputError) as refused:
        pb.fit_model(folder / "record.csv", template="gain", input_hold="hold")
    assert str(refused.value) in line
    assert not (folder / "m.toml").exists()
    return line


def test_a_gain_that_no_model_file_holds(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    line = told(lagging(1e-9, 3e7), tmp_path, capsys)
    assert f"{SAID}linear_transduction.sensitivity_um_per_V: found " in line
    assert line.endswith("check the units of the columns")


def test_nor_does_one_of_the_structures_that_compete_in_a_diagnosis():
    with pytest.raises(pb.InputError, match="no linear model can be simulated over the records: linear_transduction"):
        competing_structures([lagging(1e-9, 3e7)], Settings())


@pytest.mark.parametrize("error", [ModelError, ArithmeticError, np.linalg.LinAlgError])
def test_whatever_a_fit_cannot_do_is_said(
    error: type[Exception], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    def fails(*_: object) -> None:
        raise error("it cannot be")

    monkeypatch.setattr(learned, "first_model", fails)
    assert f"{SAID}it cannot be; check the units" in told(lagging(), tmp_path, capsys)


def test_a_structure_that_cannot_be_solved_for_leaves_the_others(monkeypatch: pytest.MonkeyPatch):
    def fails(*_: object, **__: object) -> None:
        raise np.linalg.LinAlgError("SVD did not converge")

    monkeypatch.setattr(scipy.optimize, "least_squares", fails)
    found = first_model(experiments_of([lagging()], ["record"], "hold"))
    assert found.chosen.structure == Structure()
    assert found.chosen.gain == pytest.approx(0.2, rel=0.2)
