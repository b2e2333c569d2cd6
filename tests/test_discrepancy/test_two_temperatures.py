"""An oven with two temperatures (PythonFMU): driven once for all outputs, followed, its resistance found by both."""

import json
from pathlib import Path

import numpy as np
import pytest
from foreign_fmus import needs_compiler
from pythonfmu.builder import FmuBuilder

from bender_cli.main import main
from bender_discrepancy.foreign.answers import Answers, opened
from bender_discrepancy.foreign.container_stages import Original, Stages, scaled
from bender_discrepancy.foreign.shared_parameters import Bench, fitted_to_all
from bender_discrepancy.foreign.surrogate import fit_surrogate
from bender_discrepancy.foreign.suspects import suspects_of
from bender_inference.records.observations import observe
from bender_inference.settings import Settings
from bender_loop.fmu.plant import FmuPlant
from bender_loop.fmu.process.watched import WatchedPlant
from bender_loop.records.record import Record, read_record
from bender_loop.tables.quantities import Quantities

SLAVE = Path(__file__).parent / "slaves" / "bender_discrepancy_test_oven.py"
TWO, ROWS, NOISE_K, RESISTANCE, LAG_s, GAIN = ("air", "load"), 1500, 0.05, 0.62, 9.0, 0.96
IN_W_AND_K = Quantities("W", "K", ("W", "K"))


@pytest.fixture(scope="module")
def oven(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return Path(FmuBuilder.build_FMU(SLAVE, dest=tmp_path_factory.mktemp("oven"), needsExecutionTool=False))


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A device whose R is 0.62, whose thermometer of the load lags by 9 s and that of the air reads 4 % short."""
    rng = np.random.default_rng(3)
    power, k = np.zeros(ROWS), 20
    while k < ROWS:
        rows = int(np.exp(rng.uniform(np.log(5.0), np.log(120.0))))
        power[k : k + rows], k = round(rng.uniform(0.0, 200.0), 1), k + rows
    air = load = read = 0.0
    shown = np.zeros((ROWS, 2))
    for k in range(ROWS):
        shown[k] = GAIN * air, read
        for _ in range(50):
            flow = (air - load) / 0.25
            air, load, read = (
                air + 0.02 * (power[k] - flow - air / RESISTANCE) / 120.0,
                load + 0.02 * flow / 260.0,
                read + 0.02 * (load - read) / LAG_s,
            )
    shown += 293.15 + NOISE_K * rng.standard_normal(shown.shape)
    rows = np.column_stack([np.arange(ROWS, dtype=np.float64), power, np.full(ROWS, 293.15), shown])
    path = tmp_path_factory.mktemp("record") / "record.csv"
    head = "time [s],power [W],ambient [K],air [K],load [K]"
    np.savetxt(path, rows, fmt="%.6g", delimiter=",", header=head, comments="")
    return path


def read_of(record: Path, output: str) -> Record:
    return read_record(record, reading=output, command="power", further={"ambient": "ambient"})


def original_of(oven: Path, output: str, record: Record) -> Original:
    with FmuPlant(oven, input_name="power", output_name=output, quantities=IN_W_AND_K) as plant:
        plant.follow(record.time_s, record.further)
        plant.reset()
        return Original(oven, plant.input, plant.output, {}, plant.read(), IN_W_AND_K)


@pytest.fixture
def drives(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the functions that were run where the FMU lives, in their order."""
    found: list[str] = []
    run_there = WatchedPlant.run_there

    def counted(self: WatchedPlant, function, args, kwargs):
        found.append(function.__name__)
        return run_there(self, function, args, kwargs)

    monkeypatch.setattr(WatchedPlant, "run_there", counted)
    return found


def test_one_run_of_the_fmu_answers_for_every_output_and_all_that_stands_behind(
    oven: Path, record: Path, drives: list[str]
) -> None:
    records = {x: read_of(record, x) for x in TWO}
    originals = {x: original_of(oven, x, y) for x, y in records.items()}
    with opened(list(originals.values())) as plant:
        answers = Answers(plant, list(originals.values()))
        answers.set_parameters({"R": RESISTANCE})
        for gain in (1.0, GAIN, 1.1):
            stages = Stages(None, scaled(None, gain, 0.0, 0.0))
            for name, own in records.items():
                shown = answers.readings(name, originals[name].rest_um, stages, observe(own), own, 1.0)
                if (name, gain) == ("air", GAIN):
                    assert np.std(own.displacement_um - shown) == pytest.approx(NOISE_K, rel=0.1)
        assert answers.drives == 1
        answers.set_parameters({"R": 0.5})
        answers.answer(None, observe(records["air"]), records["air"], 1.0)
        assert answers.drives == 2
    assert drives == ["drive_outputs", "drive_outputs"]


@pytest.mark.parametrize("output", TWO)
def test_what_stands_in_for_a_plant_of_two_stores_follows_it(oven: Path, record: Path, output: str) -> None:
    """It is slow beside an excerpt of its run, and between its poles the air has a zero that lags have not."""
    with FmuPlant(oven, input_name="power", output_name=output, quantities=IN_W_AND_K) as plant:
        known = fit_surrogate(plant, ("oven", "power", output), [read_of(record, output)])[2]
    assert known.difference_um < 2e-3 * known.spread_um


def test_an_output_that_lacks_something_else_does_not_draw_a_shared_parameter_along(oven: Path, record: Path) -> None:
    records = {x: [read_of(record, x)] for x in TWO}
    originals = {x: original_of(oven, x, y[0]) for x, y in records.items()}
    bench = Bench(originals, records, Settings(), suspects_of(oven, ["R"], {}), lambda _: {}, lambda _: None)
    (found,) = fitted_to_all(bench, {}, {}, bench.suspects).parameters
    assert found.is_off
    assert found.value == pytest.approx(RESISTANCE, abs=0.002)


@pytest.mark.slow
@needs_compiler
def test_both_outputs_are_corrected_and_the_resistance_is_found(
    oven: Path, record: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    words = ["--input", "power", "--output", "air", "--output", "load", "--further-input", "ambient", "--suspect", "R"]
    assert main(["diagnose", str(record), "--fmu", str(oven), *words, "--out", str(out)]) == 0
    said = capsys.readouterr()
    found = json.loads((out / "outputs.json").read_text(encoding="utf-8"))
    assert found["parameters"]["R"]["after"] == pytest.approx(RESISTANCE, abs=0.002)
    assert [found["outputs"][x]["on_this_output_alone"] for x in TWO] == [[], ["sensor_lag"]]
    for name in TWO:
        assert found["outputs"][name]["gap"]["together"] == pytest.approx(NOISE_K, rel=0.15)
    assert (out / "model.fmu").exists()
    assert "µm" not in said.out + said.err
