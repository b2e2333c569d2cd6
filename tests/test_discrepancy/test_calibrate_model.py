"""Parameters of anybody's FMU from records: values, intervals, what a record cannot see, what acts only together."""

import json
from pathlib import Path

import numpy as np
import pytest
from foreign_fmus import OSCILLATOR_STARTS, needs_compiler, oscillator_fmu

from bender_cli.main import main
from bender_discrepancy.foreign.suspects import suspects_of
from bender_loop.errors import InputError
from bender_loop.fmu.plant import FmuPlant
from bender_loop.records.drive import drive
from bender_loop.records.record import Record, write_record

pytestmark = needs_compiler
STEP_S, ROWS, NOISE_um = 0.01, 600, 0.02
AS_METRES = 1e-6
"""An output without a unit is driven here as metres, and taken in the unit of the record by the command."""


@pytest.fixture(scope="module")
def oscillator(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return oscillator_fmu(tmp_path_factory.mktemp("oscillator") / "oscillator.fmu")


def record_of(fmu: Path, seed: int = 3, **off: float) -> Record:
    rng = np.random.default_rng(seed)
    volts = np.repeat(rng.uniform(-3.0, 3.0, ROWS // 20), 20)
    volts[:20] = 0.0
    time_s = STEP_S * np.arange(ROWS, dtype=np.float64)
    with FmuPlant(fmu, parameters=off) as plant:
        readings = AS_METRES * drive(plant, time_s, volts)
    return Record(time_s, volts, readings + NOISE_um * rng.standard_normal(ROWS))


def calibrated(record: Record, fmu: Path, capsys: pytest.CaptureFixture[str], *words: str) -> dict:
    write_record(Path("record.csv"), record)
    assert main(["calibrate-model", "record.csv", "--fmu", str(fmu), *words, "--out", "o", "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_parameters_that_are_off_are_found(
    oscillator: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    seen = record_of(oscillator, stiffness=704.0, damping=5.0)
    told = calibrated(
        seen, oscillator, capsys, "--suspect", "stiffness", "--suspect", "damping=1:20", "--suspect", "idle"
    )
    found = told["parameters"]
    for name, true in (("stiffness", 704.0), ("damping", 5.0)):
        assert abs(found[name]["after"] - true) < 5.0 * found[name]["std"]
        assert found[name]["std"] < 0.02 * true
        assert found[name]["is_off"]
    assert "does not determine it" in told["unseen"]["idle"]
    assert told["gap"]["after"]["rms_um"] < 1.1 * NOISE_um < 0.2 * told["gap"]["before"]["rms_um"]
    assert "stiffness" in Path("o/parameters.ssv").read_text(encoding="utf-8")


@pytest.mark.slow
def test_what_acts_only_together_is_said(
    oscillator: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    seen = record_of(oscillator, stiffness=704.0)
    words = [x for name in ("stiffness", "damping", "mass", "force") for x in ("--suspect", name)]
    told = calibrated(seen, oscillator, capsys, *words)
    # three ratios of four numbers are all that the equation of motion has
    assert len(told["parameters"]) == 3
    assert told["act_only_together"] == [["stiffness", "damping", "mass", "force"]]
    ratios = {name: x["after"] for name, x in told["parameters"].items()}
    whole = OSCILLATOR_STARTS | ratios
    assert whole["stiffness"] / whole["mass"] == pytest.approx(704.0 / 0.5, rel=0.01)
    assert whole["force"] / whole["mass"] == pytest.approx(800.0 / 0.5, rel=0.01)


@pytest.mark.slow
def test_a_free_reading_takes_the_gain_of_the_model(
    oscillator: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    seen = record_of(oscillator, force=960.0)
    told = calibrated(seen, oscillator, capsys, "--suspect", "force", "--free-reading")
    assert "gain and offset of the reading" in told["unseen"]["force"]
    assert told["reading"]["gain"] == pytest.approx(1.2, rel=0.01)
    told = calibrated(seen, oscillator, capsys, "--suspect", "force")
    assert told["parameters"]["force"]["after"] == pytest.approx(960.0, rel=0.01)


def test_which_parameters_are_meant(oscillator: Path) -> None:
    everything = suspects_of(oscillator, ["tunable"], {})
    # nothing is known of how far a parameter may go that is 0
    assert {x.name for x in suspects_of(oscillator, ["mass", "cubic=-1:1"], {})} == {"mass", "cubic"}
    assert {x.name for x in everything} == set(OSCILLATOR_STARTS) - {"cubic"}
    assert [(x.low, x.high) for x in suspects_of(oscillator, ["mass"], {"mass": 2.0})] == [(1.0, 4.0)]
    for words, said in (
        (["weight"], "weight"),
        (["u"], "real parameter"),
        (["mass", "mass"], "twice"),
        (["mass=1"], "LOW:HIGH"),
        (["mass=2:1"], "LOW below HIGH"),
        (["mass=1:2"], "holds 0.5"),
        (["cubic"], "LOW:HIGH"),
    ):
        with pytest.raises(InputError, match=said):
            suspects_of(oscillator, words, {})


@pytest.mark.slow
def test_other_units_give_the_same_numbers(
    oscillator: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """An FMU without units: the record's own stand for it, whatever they are called."""
    monkeypatch.chdir(tmp_path)
    seen = record_of(oscillator, stiffness=704.0)
    found = []
    for units, reading in (("s,V,m", 1e-6), ("s,bar,l/min", 1e-6), ("s,rpm,N m", 1e-6)):
        rows = zip(
            seen.time_s.tolist(), seen.voltage_V.tolist(), (reading * seen.displacement_um).tolist(), strict=True
        )
        text = "\n".join(["t,u,y", *(",".join(map(repr, x)) for x in rows)]) + "\n"
        Path("rig.csv").write_text(text, encoding="utf-8")
        words = ["calibrate-model", "rig.csv", "--columns", "t,u,y", "--units", units, "--fmu", str(oscillator)]
        assert main([*words, "--suspect", "stiffness", "--suspect", "damping", "--out", "o", "--json"]) == 0
        told = json.loads(capsys.readouterr().out)
        found.append([told["parameters"][x]["after"] for x in ("stiffness", "damping")])
        # in the prefix in which the readings are of ordinary size, where the unit takes one
        assert told["unit"] == {"m": "um", "l/min": "ul/min", "N m": "uN m"}[units.split(",")[-1]]
        assert (told["gap"]["after"]["rms_um"] is None) == (told["unit"] != "um")
    assert np.allclose(found[1:], found[0], rtol=1e-6)
