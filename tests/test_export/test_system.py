"""The closed loop as an SSP archive: valid, complete, and the same in every tool and in bender's own loop."""

import io
import re
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest
from few import few
from fmpy import read_model_description
from fmu_hosts import (
    IMPORTERS,
    WITHIN_M,
    assert_follows_its_schemas,
    hosted,
    largest_difference,
    looped_in_fmpy,
)
from numpy.typing import ArrayLike, NDArray

from bender_export.build import build_all, closed_loop, controller_fmu, plant_fmu
from bender_export.readme import refreshed
from bender_export.system import PARAMETER_SETS, Loop, loop_of
from bender_loop.control.closed_loop import Sampling, simulate
from bender_loop.control.pid import Gains, Limits, PidState, step
from bender_loop.fmu.plant import FmuPlant
from bender_plant.model import load_model

STEP_S, STEPS = 0.01, 100
SSD = "{http://ssp-standard.org/SSP1/SystemStructureDescription}"

TUNED = loop_of(Gains(0.25, 7.0, 0.125, 0.0625, True), Limits(-5.0, 45.0, 0.5), 1 / 30)
STARTS = {
    "gains.proportional": "0.25", "gains.integral": "7.0", "gains.derivative": "0.125",
    "gains.filter_time": "0.0625", "gains.derivative_on_error": "true",
    "limits.lower": "-5.0", "limits.upper": "45.0", "limits.tracking_time": "0.5",
}  # fmt: skip


@pytest.fixture(scope="module", params=few(PARAMETER_SETS, 0))
def parameter_set(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture(scope="module")
def archive(parameter_set: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("ssp") / "ClosedLoop.ssp"
    path.write_bytes(closed_loop(plant_fmu(load_model("paper")), controller_fmu(), Loop(parameter_set)))
    return path


@pytest.fixture(scope="module")
def unpacked(archive: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("unpacked")
    with zipfile.ZipFile(archive) as opened:
        opened.extractall(folder)
    return folder


@dataclass(frozen=True)
class AsTheMasterShowsIt:
    """A staircase of the reference FMU as the controller uses it at tick k: what stood there a step before."""

    initial_um: float
    final_um: float
    rise_um: float
    dwell_steps: int

    def sample(self, times: ArrayLike) -> NDArray[np.float64]:
        shown = np.rint(np.asarray(times) / STEP_S) - 1.0
        stairs = np.where(shown > 0, 1.0 + np.floor((shown - 1.0) / self.dwell_steps), 0.0)
        rise_um = self.rise_um or self.final_um - self.initial_um
        return np.minimum(self.initial_um + rise_um * stairs, self.final_um)

    def value(self, time_s: float) -> float:
        return float(self.sample(time_s))


@pytest.fixture(scope="module")
def own_loop(parameter_set: str, unpacked: Path) -> list[float]:
    """The displacements of bender's own loop under the master of the tools: all components step at the same time.

    What the controller and the plant then take is one step old. For the controller that is a frame of latency.
    """
    reference = PARAMETER_SETS[parameter_set]["reference"]
    setpoint = AsTheMasterShowsIt(
        1e6 * reference["staircase.initial"],
        1e6 * reference["staircase.final"],
        1e6 * reference["staircase.rise"],
        round(reference["staircase.dwell"] / STEP_S),
    )
    values = PARAMETER_SETS[parameter_set]["controller"]
    gains = Gains(values["gains.proportional"], values["gains.integral"], values["gains.derivative"])
    limits = Limits(values["limits.lower"], values["limits.upper"], values["limits.tracking_time"])
    with FmuPlant(unpacked / "resources" / "PiezoBender.fmu") as plant:
        trace = simulate(plant, gains, limits, setpoint, Sampling(1.0 / STEP_S, latency_frames=1), STEPS * STEP_S)
    return (1e-6 * trace.displacement_um[1:]).tolist()


def test_files_follow_their_schemas(archive: Path) -> None:
    assert_follows_its_schemas(archive)


def test_no_input_is_unconnected_and_every_name_is_one_of_the_fmu(unpacked: Path) -> None:
    root = ElementTree.parse(unpacked / "SystemStructure.ssd").getroot()
    ends = {(c.get("endElement"), c.get("endConnector")) for c in root.iter(f"{SSD}Connection")}
    assert len(ends) == 3
    for component in root.iter(f"{SSD}Component"):
        description = fmpy.read_model_description(str(unpacked / component.attrib["source"]))
        variables = {variable.name: variable for variable in description.modelVariables}
        inputs = {(component.get("name"), v.name) for v in variables.values() if v.causality == "input"}
        assert inputs <= ends
        for connector in component.iter(f"{SSD}Connector"):
            variable = variables[connector.attrib["name"]]
            assert connector.attrib["kind"] == variable.causality
            assert connector[0].attrib["unit"] == variable.unit
        for bound in component.iter("{http://ssp-standard.org/SSP1/SystemStructureParameterValues}Parameter"):
            assert variables[bound.attrib["name"]].causality == "parameter"


def test_fmpy_runs_the_loop_of_bender(archive: Path, unpacked: Path, parameter_set: str, own_loop: list[float]) -> None:
    values = unpacked / "resources" / f"{parameter_set}.ssv"
    assert largest_difference(looped_in_fmpy(archive, STEPS, STEP_S, values=values), own_loop) <= WITHIN_M
    assert max(own_loop) > 5e-6


@pytest.mark.parametrize("script", IMPORTERS)
def test_every_tool_runs_the_loop_of_bender(
    script: str, archive: Path, unpacked: Path, parameter_set: str, own_loop: list[float], tmp_path: Path
) -> None:
    values = PARAMETER_SETS[parameter_set]
    starts: dict[str, Any] = {"PidController.fmu": values["controller"], "StaircaseReference.fmu": values["reference"]}
    places = {"in_ecos.py": {"ssp": str(archive), "parameter_set": parameter_set}}
    job = {"folder": str(unpacked), "start": starts, "steps": STEPS, "step_s": STEP_S} | places.get(script, {})
    assert largest_difference(hosted(script, job, tmp_path), own_loop) <= WITHIN_M


def test_the_same_model_gives_the_same_bytes_and_another_one_others(archive: Path, parameter_set: str) -> None:
    model = load_model("paper")
    assert closed_loop(plant_fmu(model), controller_fmu(), Loop(parameter_set)) == archive.read_bytes()
    changed = model.with_values({"calibration.gain": 1.01})
    assert closed_loop(plant_fmu(changed), controller_fmu(), Loop(parameter_set)) != archive.read_bytes()


def test_tuned_gains_and_their_sampling_time_go_into_every_place_of_the_archive() -> None:
    data = closed_loop(plant_fmu(load_model("beam")), controller_fmu(TUNED), TUNED)
    with zipfile.ZipFile(io.BytesIO(data)) as opened:
        texts = [opened.read(name).decode() for name in opened.namelist() if name.endswith((".ssd", ".ssv"))]
        (master,) = {
            line for line in opened.read("SystemStructure.ssd").decode().splitlines() if "FixedStepMaster" in line
        }
    assert f'stepSize="{1 / 30!r}"' in master
    assert len(texts) == 4
    for text in texts:
        for name, value in STARTS.items():
            assert re.search(rf'name="(controller\.)?{re.escape(name)}">\s*<ssv:\w+ value="{value}"', text)


def test_the_controller_fmu_of_a_tuning_starts_with_it_and_gives_the_commands_of_the_block(
    running_fmu: Any, tmp_path: Path
) -> None:
    gains, limits, period_s = Gains(0.25, 7.0, 0.125, 0.0625, True), Limits(-5.0, 45.0, 0.5), 1 / 30
    _, path, _ = build_all("paper", tmp_path / "PiezoBender.fmu", tmp_path, TUNED)
    description = read_model_description(str(path))
    starts = {x.name: x.start for x in description.modelVariables if x.causality == "parameter"}
    assert starts == STARTS
    assert float(description.defaultExperiment.stepSize) == period_s
    memory = PidState()
    with running_fmu(path) as controller:
        controller.slave.reset()
        controller.begin({})
        for reading_m in (0.0, 1e-6, 3e-6, 5e-6):
            memory, command_V = step(gains, limits, memory, 8.0, 1e6 * reading_m, period_s)
            assert controller.step(period_s, setpoint=8e-6, measurement=reading_m) == [command_V]


README = Path(__file__).parents[2] / "fmu" / "README.md"


def test_the_tables_are_current() -> None:
    text = README.read_text(encoding="utf-8")
    assert refreshed(text) == text, "run python -m bender_export.readme"


def test_the_example_runs(
    plant_fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "fmu").mkdir()
    (tmp_path / "fmu" / "PiezoBender.fmu").write_bytes(plant_fmu.read_bytes())
    monkeypatch.chdir(tmp_path)
    (example,) = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    exec(example, {})
    assert re.fullmatch(r"\d+\.\d{3} µm after 0\.5 s at 10 V\n", capsys.readouterr().out)


def test_the_loop_of_the_how_to_page_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = README.parents[1] / "docs" / "how-to" / "fmu-in-other-tools.md"
    (example,) = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    (tmp_path / "fmu").mkdir()
    (tmp_path / "fmu" / "ClosedLoop.ssp").write_bytes(closed_loop(plant_fmu(load_model("paper")), controller_fmu()))
    monkeypatch.chdir(tmp_path)
    exec(example, {})
    assert re.fullmatch(r"1[3-6]\.\d{3} µm\n", capsys.readouterr().out)
