"""Linear models of FMUs that this project did not make: their matrices are those of the equations in their sources."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from foreign_fmus import ARM_FORCE_N, TAU_S, ARM_TIP_mm, arm_fmu, foreign_fmu, needs_compiler, oscillator_fmu

from bender_cli.main import main
from bender_loop.errors import InputError
from bender_tuner.model.linearised_fmu import LinearisationRequest, linearised_fmu

pytestmark = needs_compiler


def test_a_lag_is_one_state_of_its_own_decay(tmp_path: Path):
    found = linearised_fmu(foreign_fmu(tmp_path / "lag.fmu"), LinearisationRequest(2.0, step_s=0.01, settle_s=1.5))
    assert found.states.A.tolist() == [[pytest.approx(math.exp(-0.01 / TAU_S), rel=1e-6)]]
    assert found.model.dc_gain_um_per_V == pytest.approx(1.0, rel=1e-6)
    assert (found.names, found.units) == (("drive.u", "sensor.y"), ("V", "um"))
    assert found.point.displacement_um == pytest.approx(2.0, rel=1e-5)
    assert found.notes == ()


def test_the_default_experiment_says_how_it_is_stepped_and_for_how_long(tmp_path: Path):
    found = linearised_fmu(arm_fmu(tmp_path / "arm.fmu"), LinearisationRequest(5.0, "command", "force"))
    assert found.states.period_s == 0.02
    assert found.point.frames == 50
    assert found.units == ("V", "N")
    assert found.model.dc_gain_um_per_V == pytest.approx(ARM_FORCE_N[1], rel=1e-6)


def test_further_inputs_can_be_the_input(tmp_path: Path):
    found = linearised_fmu(arm_fmu(tmp_path / "arm.fmu"), LinearisationRequest(0.0, "load", "tip", settle_s=2.0))
    assert found.units == ("N", "um")
    assert found.model.dc_gain_um_per_V == pytest.approx(1e3 * ARM_TIP_mm[2], rel=1e-6)


def test_a_mode_is_a_pair_of_poles_and_a_curve_is_told(tmp_path: Path):
    straight = linearised_fmu(oscillator_fmu(tmp_path / "a.fmu"), LinearisationRequest(0.0, step_s=0.005, settle_s=5.0))
    assert straight.states.A.shape == (2, 2)
    poles = np.log(np.linalg.eigvals(straight.states.A)) / 0.005
    assert abs(poles[0]) / (2.0 * math.pi) == pytest.approx(6.37, rel=0.01)
    bent = linearised_fmu(
        oscillator_fmu(tmp_path / "b.fmu", cubic=800.0),
        LinearisationRequest(1.0, step_s=0.005, settle_s=5.0, change=0.5),
    )
    (note,) = bent.notes
    assert "the answers to more and to less differ" in note


def test_what_was_not_waited_for_is_told(tmp_path: Path):
    found = linearised_fmu(foreign_fmu(tmp_path / "lag.fmu"), LinearisationRequest(5.0, step_s=0.01, settle_s=0.1))
    assert "still moves after 0.1 s" in found.notes[0]


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (LinearisationRequest(step_s=0.0), r"--step: found 0.0, expected a finite number > 0"),
        (LinearisationRequest(input_value=math.nan), r"--voltage: found nan"),
        (LinearisationRequest(step_s=1e-6, settle_s=10.0), r"found 10000000 steps of 1e-06 s, expected at most 200000"),
    ],
)
def test_what_cannot_be_asked_is_refused(tmp_path: Path, asked: LinearisationRequest, said: str):
    with pytest.raises(InputError, match=said):
        linearised_fmu(foreign_fmu(tmp_path / "lag.fmu"), asked)


def test_an_output_that_does_not_answer_is_refused(tmp_path: Path):
    fmu = foreign_fmu(tmp_path / "dead.fmu", gain=0.0)
    with pytest.raises(InputError, match=r"sensor\.y does not answer a change of drive\.u by 0\.01 V within 1 s"):
        linearised_fmu(fmu, LinearisationRequest())


def test_the_command_writes_matrices_and_a_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    fmu, out = arm_fmu(tmp_path / "arm.fmu"), tmp_path / "arm.json"
    words = ["fmu", "linearise", "--fmu", str(fmu), "--input", "command", "--output", "force", "--out", str(out)]
    assert main(words) == 0
    told = json.loads(out.read_text(encoding="utf-8"))
    assert (told["input_unit"], told["output_unit"], told["inputs"]) == ("V", "N", ["command"])
    assert out.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
    assert capsys.readouterr().out.splitlines() == [str(out), str(out.with_suffix(".png"))]
    assert main(["fmu", "linearise", "--output", "tip", "--out", str(out)]) == 2
    assert "found without --fmu" in capsys.readouterr().err
