"""Anybody's FMU as the model: a lag in C that knows nothing of this project."""

import json
from pathlib import Path

import numpy as np
import pytest
from foreign_fmus import TAU_S, foreign_fmu, needs_compiler, oscillator_fmu

from bender_cli.main import main
from bender_discrepancy.foreign.container_stages import Stages
from bender_discrepancy.foreign.diagnose import diagnose_fmu
from bender_discrepancy.foreign.surrogate import fit_surrogate
from bender_loop.errors import RunError
from bender_loop.fmu.plant import FmuPlant
from bender_loop.records.drive import drive, drive_record
from bender_loop.records.record import Record, write_record
from bender_loop.tables.quantities import Quantities
from bender_plant.blocks import BLOCKS
from bender_plant.model import BlockSettings, Model

pytestmark = needs_compiler
NOISE_um, STEP_S, ROWS = 0.02, 0.02, 1200


@pytest.fixture(scope="module")
def lag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("foreign") / "lag.fmu"
    foreign_fmu(path)
    return path


def levels_V() -> np.ndarray:
    levels = np.repeat(np.random.default_rng(5).uniform(0.0, 40.0, ROWS // 15), 15)
    levels[:15] = 0.0
    return levels


def answer_um(voltage_V: np.ndarray) -> np.ndarray:
    """The lag of 1 µm/V in closed form, read before the voltage of a row acts."""
    found, keep = np.zeros(ROWS), np.exp(-STEP_S / TAU_S)
    for k in range(1, ROWS):
        found[k] = keep * found[k - 1] + (1.0 - keep) * voltage_V[k - 1]
    return found


def record(rows_late: int = 0, gain: float = 1.0) -> Record:
    volts = levels_V()
    late = np.concatenate([np.zeros(rows_late), volts[: ROWS - rows_late]])
    noise = NOISE_um * np.random.default_rng(6).standard_normal(ROWS)
    return Record(STEP_S * np.arange(ROWS, dtype=np.float64), volts, gain * answer_um(late) + noise)


@pytest.mark.slow
def test_what_stands_in_for_a_linear_fmu(lag: Path):
    with FmuPlant(lag) as plant:
        base, (seen,), known = fit_surrogate(plant, ("lag", "u", "y"), [record()])
    assert known.is_linear
    assert known.structure == "gain+lag"
    assert known.difference_um < 0.02 * known.spread_um
    assert base.values()["plant_lag.time_constant"] == pytest.approx(TAU_S, rel=0.02)
    # what both differ by is taken from the readings: the gap as given is that of the FMU
    assert np.std(seen.displacement_um - record().displacement_um) == pytest.approx(known.difference_um, abs=0.01)


@pytest.mark.slow
def test_a_mode_that_rings_faster_than_the_rows_is_no_alias(tmp_path: Path):
    """6.4 Hz, damped by 0.1, behind uneven rows of 1.4 Hz at most: their alias would follow the rows as well."""
    path = oscillator_fmu(tmp_path / "oscillator.fmu")
    rng = np.random.default_rng(8)
    volts = np.repeat(rng.uniform(0.0, 10.0, 100), 4)
    times = np.cumsum(rng.uniform(0.33, 0.37, volts.size))
    units = Quantities("V", "mm", ("V", "mm"))
    record = Record(times, volts, np.zeros(volts.size), quantities=units)
    with FmuPlant(path, quantities=units) as plant:
        base, _, known = fit_surrogate(plant, ("oscillator", "u", "y"), [record])
    assert known.structure == "gain+mode"
    assert known.difference_um < 0.01 * known.spread_um
    found = {x["id"]: x for x in base.to_table()["block"]}["bending_modes"]
    assert found["first_frequency_Hz"] == pytest.approx(40.0 / (2.0 * np.pi), rel=0.01)


@pytest.mark.slow
def test_an_fmu_that_refuses_short_steps_is_taken_at_its_own(tmp_path: Path):
    path = oscillator_fmu(tmp_path / "oscillator.fmu")
    rng = np.random.default_rng(8)
    volts = np.repeat(rng.uniform(0.0, 10.0, 100), 4)
    units = Quantities("V", "mm", ("V", "mm"))
    record = Record(0.02 * np.arange(volts.size, dtype=np.float64), volts, np.zeros(volts.size), quantities=units)

    class Coarse(FmuPlant):
        def step(self, voltage_V: float, step_s: float) -> float:
            if step_s < 0.019:
                raise RunError(f"a step of {step_s:g} s is refused")
            return super().step(voltage_V, step_s)

    with Coarse(path, quantities=units) as plant:
        _, _, known = fit_surrogate(plant, ("oscillator", "u", "y"), [record])
    assert known.structure == "gain+mode"
    assert known.difference_um < 0.01 * known.spread_um


@pytest.mark.slow
def test_a_camera_that_integrates_shows_a_delay_of_an_fmu(lag: Path, tmp_path: Path):
    """A frame of 15 ms is the mean of what the tip does in it: read as a snapshot it would be another delay."""
    exposure_s, delay_s, fine = 0.015, 0.047, 600
    parts_s = exposure_s * ((np.arange(fine) + 0.5) / fine - 0.5)
    time_s, volts = STEP_S * np.arange(ROWS, dtype=np.float64), levels_V()
    acting_s = time_s + 0.008
    # the lag in closed form from command to command, and each frame's mean of it
    begun_um = np.zeros(ROWS)
    for k in range(1, ROWS):
        begun_um[k] = volts[k - 1] + (begun_um[k - 1] - volts[k - 1]) * np.exp(-STEP_S / TAU_S)
    at_s = time_s[:, None] + parts_s - delay_s
    k = np.searchsorted(acting_s, at_s, side="right") - 1
    since_s = at_s - acting_s[np.maximum(k, 0)]
    tip_um = volts[k] + (begun_um[k] - volts[k]) * np.exp(-since_s / TAU_S)
    seen_um = np.where(k < 0, 0.0, tip_um).mean(axis=1)
    noise_um = NOISE_um * np.random.default_rng(6).standard_normal(ROWS)
    exposed = np.full(ROWS, exposure_s)
    seen = Record(time_s, volts, seen_um + noise_um, command_time_s=acting_s, exposure_s=exposed)
    found = diagnose_fmu(lag, None, None, [seen])
    assert (found.verdict, [x.id for x in found.added]) == ("named", ["transport_delay"])
    (delay,) = found.added[0].numbers
    assert delay.value == pytest.approx(delay_s, abs=4.0 * delay.std)
    assert delay.value == pytest.approx(delay_s, abs=2e-4)
    assert found.gap.after.rms_um < 1.1 * NOISE_um
    assert found.to_dict()["exposure_s"] == exposure_s


@pytest.mark.slow
def test_a_missing_delay_is_named_and_its_size_is_right(lag: Path, tmp_path: Path):
    found = diagnose_fmu(lag, None, None, [record(rows_late=9)])
    assert (found.verdict, [x.id for x in found.added]) == ("named", ["transport_delay"])
    (delay,) = found.added[0].numbers
    assert delay.value == pytest.approx(9 * STEP_S, abs=1e-3)
    left_um = record(rows_late=9).displacement_um - answer_um(levels_V())
    assert found.gap.before.all_rms_um == pytest.approx(float(np.sqrt(np.mean(left_um**2))), rel=0.02)
    assert found.gap.after.rms_um < 1.3 * NOISE_um
    # the gap is that of the container, which anybody can drive
    assert set(found.beside) == {"model.ssp", "model.ssv"}
    (tmp_path / "corrected.fmu").write_bytes(found.fmu)
    with FmuPlant(tmp_path / "corrected.fmu") as plant:
        readings = drive_record(plant, record(rows_late=9))
    held = found.findings.search.whole[0].reporting
    left_um = (record(rows_late=9).displacement_um - readings)[held]
    assert float(np.sqrt(np.mean(left_um**2))) == pytest.approx(found.gap.after.rms_um, rel=1e-6)


@pytest.mark.slow
def test_what_cannot_be_diagnosed(
    lag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.chdir(tmp_path)
    write_record(tmp_path / "record.csv", record())
    foreign_fmu(tmp_path / "dead.fmu", gain=0.0)
    foreign_fmu(tmp_path / "crash.fmu", hostile="crash", after=500)
    for words, status, said in (
        (["--fmu", str(lag), "--model", "beam"], 2, "give only one"),
        (["--input", "u"], 2, "found without --fmu"),
        (["--fmu", "nosuch.fmu"], 2, "no such file"),
        (["--fmu", str(lag), "--input", "u"], 2, "there is drive.u"),
        (["--fmu", "dead.fmu"], 2, "stays at 0 µm under the command of the records"),
        (["--fmu", "crash.fmu"], 1, "crash.fmu"),
    ):
        assert main(["diagnose", "record.csv", *words, "--out", "o"]) == status, words
        error = [x for x in capsys.readouterr().err.splitlines() if x.startswith("bender")]
        assert len(error) == 1
        assert said in error[0]
        assert not Path("o").exists()


def oscillator_record(fmu: Path, dead_V: float = 0.0, levels: int = 60, **off: float) -> Record:
    """Levels of chance through a dead zone into the oscillator, with one µm of answer per unit."""
    rng = np.random.default_rng(3)
    volts = np.repeat(rng.uniform(-3.0, 3.0, levels), 20)
    volts[:20] = 0.0
    time_s = 0.01 * np.arange(volts.size, dtype=np.float64)
    acting = np.sign(volts) * np.maximum(np.abs(volts) - dead_V, 0.0)
    with FmuPlant(fmu, parameters={"force": 8e-4, **off}) as plant:
        readings = drive(plant, time_s, acting)
    return Record(time_s, volts, readings + NOISE_um * rng.standard_normal(volts.size))


@pytest.mark.slow
@pytest.mark.parametrize(("dead_V", "stiffness"), [(0.0, 704.0), (0.3, 800.0), (0.3, 704.0)])
def test_a_parameter_competes_with_effects(dead_V: float, stiffness: float, tmp_path: Path):
    fmu = oscillator_fmu(tmp_path / "oscillator.fmu")
    seen = oscillator_record(fmu, dead_V, stiffness=stiffness)
    suspects = ["stiffness", "damping"]
    found = diagnose_fmu(fmu, None, None, [seen], parameters={"force": 8e-4}, suspects=suspects)
    off = {x.name: x.after for x in found.recalibrated if x.name not in ("gain", "offset")}
    assert [x.id for x in found.added] == (["dead_zone"] if dead_V else [])
    assert found.verdict == ("named" if dead_V else "recalibrated")
    assert set(off) == ({"stiffness"} if stiffness != 800.0 else set())
    if off:
        assert off["stiffness"] == pytest.approx(stiffness, rel=0.003)
    assert found.gap.after.rms_um < 1.2 * found.gap.floor_um


REFERENCE = Path(__file__).parents[3] / "shared" / "data" / "reference-fmus"


@pytest.mark.slow
@pytest.mark.skipif(not REFERENCE.is_dir(), reason="the Reference-FMUs are not here")
@pytest.mark.parametrize("fmi", ["fmi2", "fmi3"])
def test_a_reference_fmu_with_a_dead_zone_before_or_behind_it(fmi: str):
    rng = np.random.default_rng(4)
    volts = np.repeat(rng.uniform(-30.0, 30.0, 80), 10)
    volts[:10] = 0.0
    acting = np.sign(volts) * np.maximum(np.abs(volts) - 3.0, 0.0)
    reading = np.concatenate([[0.0], acting[:-1]]) + 0.05 * rng.standard_normal(volts.size)
    time_s = 0.02 * np.arange(volts.size, dtype=np.float64)
    seen = Record(time_s, volts, reading, quantities=Quantities("bar", "N"))
    ports = "Float64_continuous_input", "Float64_continuous_output"
    found = diagnose_fmu(REFERENCE / fmi / "Feedthrough.fmu", *ports, [seen])
    # what comes in comes out at once: nothing tells a gap before it from one behind it
    (gap,) = found.added
    assert found.verdict == "ambiguous"
    assert {x.id for x in found.effects} >= {"dead_zone", "output_dead_zone"}
    threshold = gap.numbers[0].value / (2.0 if gap.id == "output_dead_zone" else 1.0)
    assert threshold == pytest.approx(3.0, abs=0.02)
    assert found.gap.after.rms_um < 1.2 * found.gap.floor_um


@pytest.mark.slow
def test_a_rig_in_other_units(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.chdir(tmp_path)
    foreign_fmu(Path("lag.fmu"), input_unit="bar", output_unit="mm/s", gain=1.0)
    seen, numbers = record(rows_late=9), []
    for units, times in (("s,bar,mm/s", (1.0, 1.0)), ("s,Mbar,nm/s", (1e-6, 1e6))):
        columns = seen.time_s, times[0] * seen.voltage_V, times[1] * seen.displacement_um
        rows = zip(*(x.tolist() for x in columns), strict=True)
        Path("rig.csv").write_text("\n".join(["t,u,y", *(",".join(map(repr, x)) for x in rows)]) + "\n")
        words = ["diagnose", "rig.csv", "--columns", "t,u,y", "--units", units, "--fmu", "lag.fmu", "--out", "o"]
        assert main([*words, "--json"]) == 0
        told = json.loads(capsys.readouterr().out)
        assert (told["verdict"], told["unit"], told["input_unit"]) == ("named", "mm/s", "bar")
        assert told["gap"]["after"]["rms_um"] is None
        numbers.append([told["effects"][0]["parameters"]["delay_s"]["value"], told["gap"]["after"]["rms"]])
    assert np.allclose(*numbers, rtol=1e-6)
    page = Path("o/report.html").read_text(encoding="utf-8")
    assert "mm/s" in page
    assert "µm" not in page.partition("</head>")[2]


@pytest.mark.parametrize(
    ("blocks", "static"), [(["dead_zone"], True), (["dead_zone", "transport_delay"], False), (["saturation"], True)]
)
def test_stages_that_only_bend_the_voltage_need_no_short_steps(blocks: list[str], static: bool):
    gain = BlockSettings("linear_transduction", BLOCKS["linear_transduction"].parameters(sensitivity_um_per_V=1.0))
    before = [gain, *(BlockSettings(x, BLOCKS[x].parameters()) for x in (*blocks, "calibration"))]
    assert Stages(Model("before", None, tuple(before), ""), None).is_static is static


@pytest.mark.slow
def test_an_fmu_that_is_not_linear_is_followed_to_what_was_found(tmp_path: Path):
    """A spring a third stiffer at the ends of its range: to first order its dead zone leaves a tenth of the gap."""
    fmu = oscillator_fmu(tmp_path / "duffing.fmu", cubic=4e13)
    seen = oscillator_record(fmu, 0.3, levels=24)
    found = diagnose_fmu(fmu, None, None, [seen], parameters={"force": 8e-4})
    assert found.stand_in is not None
    assert not found.stand_in.is_linear
    assert (found.verdict, found.is_complete, [x.id for x in found.added]) == ("named", True, ["dead_zone"])
    (threshold,) = found.added[0].numbers
    assert threshold.value == pytest.approx(0.3, rel=0.05)
    assert threshold.interval is not None
    assert threshold.interval[0] < 0.3 < threshold.interval[1]
    assert found.gap.after.rms_um < 1.2 * found.gap.floor_um
    assert found.gap.before.rms_um > 5.0 * found.gap.floor_um


@pytest.mark.slow
def test_what_acts_inside_a_linear_fmu_stands_beside_it(tmp_path: Path):
    fmu = oscillator_fmu(tmp_path / "oscillator.fmu")
    seen = oscillator_record(fmu, stiffness=704.0)
    found = diagnose_fmu(fmu, None, None, [seen], parameters={"force": 8e-4})
    assert found.stand_in is not None
    assert found.stand_in.beside
    assert found.gap.after.rms_um < 1.2 * found.gap.floor_um
    assert found.gap.before.rms_um > 5.0 * found.gap.floor_um
    assert any("acts inside the FMU" in x for x in found.stand_in.sentences())
