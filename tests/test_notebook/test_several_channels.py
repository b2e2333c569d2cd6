"""The notebook's door to an FMU of several inputs and outputs."""

import pickle
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from foreign_fmus import ARM_FORCE_N, ARM_TIP_mm, arm_fmu, needs_compiler

import piezo_bender as pb
from piezo_bender.several_outputs import OutputsDiagnosis


@pytest.fixture
def arm_table() -> pd.DataFrame:
    """An arm's record with the columns called as its variables."""
    rng = np.random.default_rng(3)
    command, load = (np.repeat(rng.uniform(-1.0, 1.0, 30), 10) for _ in range(2))
    time_s = 0.05 * np.arange(command.size)

    def reading(lag_s: float, per_V: float, per_N: float) -> np.ndarray:
        keep, found = np.exp(-0.05 / lag_s), np.full(command.size, per_N * load[0])
        for k in range(1, command.size):
            found[k] = keep * found[k - 1] + (1.0 - keep) * (per_V * 20.0 * command[k - 1] + per_N * load[k - 1])
        return found

    return pd.DataFrame(
        {
            "time [s]": time_s,
            "command [V]": 20.0 * command,
            "load [N]": load,
            "tip [mm]": reading(*ARM_TIP_mm),
            "force [N]": reading(*ARM_FORCE_N),
        }
    )


@needs_compiler
@pytest.mark.parametrize(("output", "unit"), [("tip", "um"), ("force", "N")])
def test_each_output_is_compared_under_all_inputs(arm_table: pd.DataFrame, tmp_path: Path, output: str, unit: str):
    arm = arm_fmu(tmp_path / "arm.fmu")
    found = pb.compare(arm_table, fmu=arm, further={"load": "load"}, input_name="command", output_name=output)
    assert found.to_dict()["unit"] == unit
    assert found.comparison.before.rms_um < 1e-6
    assert f" {'µm' if unit == 'um' else unit} rms" in repr(found)
    without = pb.compare(arm_table, fmu=arm, input_name="command", output_name=output)
    assert without.comparison.before.rms_um > 0.1
    assert list(pb.load_record(arm_table, reading="force", further={"load": "load"}).to_frame())[-1] == "load"


@needs_compiler
def test_a_plant_is_simulated_under_further_inputs(arm_table: pd.DataFrame, tmp_path: Path):
    arm = arm_fmu(tmp_path / "arm.fmu")
    time_s, command = arm_table["time [s]"].to_numpy(), arm_table["command [V]"].to_numpy()
    found = pb.simulate(
        fmu=arm, input_name="command", output_name="force", time_s=time_s, voltage_V=command, units="V,N",
        further={"load": arm_table["load [N]"].to_numpy()},
    )  # fmt: skip
    assert np.allclose(found.displacement_um, arm_table["force [N]"], atol=1e-9)


@needs_compiler
def test_what_a_loaded_record_does_not_have_is_refused(arm_table: pd.DataFrame, tmp_path: Path):
    arm, record = arm_fmu(tmp_path / "arm.fmu"), pb.load_record(arm_table, reading="tip")
    with pytest.raises(pb.InputError, match="found a loaded record, expected the path or the table itself: further"):
        pb.compare(record, fmu=arm, input_name="command", output_name="tip", further={"load": "load"})
    with pytest.raises(pb.InputError, match="outputs: found 1, expected at least two"):
        pb.diagnose_outputs(arm_table, arm, ["tip"], input_name="command")
    with pytest.raises(pb.InputError, match="further: found without fmu"):
        pb.compare(record, further={"load": "load"})


def test_a_diagnosis_of_several_outputs_pickles_with_the_functions_of_its_forms():
    add = 2
    found = OutputsDiagnosis(lambda x: x + add)  # pyright: ignore[reportArgumentType]
    assert pickle.loads(pickle.dumps(found)).outcome(1) == 3


@pytest.mark.slow
@needs_compiler
def test_several_outputs_are_diagnosed_together(arm_table: pd.DataFrame, tmp_path: Path):
    arm = arm_fmu(tmp_path / "arm.fmu")
    noise = np.random.default_rng(4).standard_normal((2, len(arm_table)))
    arm_table["tip [mm]"] += 0.004 * noise[0]
    arm_table["force [N]"] += 0.003 * noise[1]
    arm_table["command [V]"] = np.roll(arm_table["command [V]"], -2)
    found = pb.diagnose_outputs(arm_table, arm, ["tip", "force"], input_name="command", further={"load": "load"})
    assert found.to_dict()["input"]["effects"] == ["transport_delay"]
    assert set(found.to_frame()["output"]) == {"tip", "force"}
    assert pickle.loads(pickle.dumps(found)).sentence == found.sentence
    written = {x.name for x in found.save(tmp_path / "door").iterdir()}
    assert written >= {"tip", "force", "outputs.json", "report.html", "model.fmu"}
    assert len(found.plot()) == 2
