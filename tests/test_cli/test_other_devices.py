"""Commands that take a record of another device than a piezo bender beside a model or FMU that was learned from one."""

import json
from pathlib import Path

import numpy as np
import pytest

import piezo_bender as pb
from bender_cli.main import main
from bender_effects.rigs import learned_commands
from bender_plant.model import load_model

COLUMNS = "time [ms],drive (V),speed [{unit}]"
HEATER = ["--columns", "t,power,T", "--units", "s,%,degC"]


def motor(path: Path, seed: int, highest_V: float, unit: str = "rpm", rpm_per_V: float = 150.0) -> list[str]:
    """Write 2.4 s of a motor with a lag of 60 ms, and return the words that read it."""
    rng = np.random.default_rng(seed)
    volts = np.repeat(rng.uniform(-highest_V, highest_V, 12), 50)
    volts[:50], volts[100:150] = 0.0, highest_V
    speeds = np.zeros(volts.size)
    for k in range(1, volts.size):
        speeds[k] = speeds[k - 1] + (1.0 - np.exp(-4.0 / 60.0)) * (rpm_per_V * volts[k - 1] - speeds[k - 1])
    speeds += rng.normal(0.0, 2.0, volts.size)
    scale, heading = 1e-3 if unit == "krpm" else 1.0, COLUMNS.format(unit=unit)
    rows = [
        f"{4 * k},{u!r},{scale * y!r}" for k, (u, y) in enumerate(zip(volts.tolist(), speeds.tolist(), strict=True))
    ]
    path.write_text("\n".join([heading, *rows]) + "\n", encoding="utf-8")
    return [str(path), "--columns", heading]


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the model of a motor that was learned from a record beyond 1000 rpm, and its FMU."""
    folder = tmp_path_factory.mktemp("motor")
    first = motor(folder / "first.csv", 1, 7.9)
    assert main(["model", "fit", *first, "--template", "gain+lag", "--out", str(folder / "mine.toml")]) == 0
    return folder


def test_the_model_has_the_unit_that_the_record_states(bench: Path) -> None:
    assert load_model(str(bench / "mine.toml")).units == ("V", "rpm")


@pytest.mark.parametrize("unit", ["rpm", "krpm"])
@pytest.mark.parametrize("plant", ["--model", "--fmu"])
def test_a_record_is_compared_with_the_model_and_its_fmu_in_its_own_unit(
    unit: str, plant: str, bench: Path, tmp_path: Path
) -> None:
    words = motor(tmp_path / "second.csv", 2, 5.9, unit)
    file = bench / {"--model": "mine.toml", "--fmu": "mine.fmu"}[plant]
    assert main(["compare", *words, plant, str(file), "--out", str(tmp_path / "out")]) == 0
    told = json.loads((tmp_path / "out" / "comparison.json").read_text(encoding="utf-8"))
    assert told["unit"] == unit
    assert told["before"]["rms"] == pytest.approx(2e-3 if unit == "krpm" else 2.0, rel=0.1)


@pytest.mark.parametrize("plant", ["model", "fmu"])
def test_records_in_another_prefix_are_diagnosed_with_the_model_of_the_device(
    plant: str, bench: Path, tmp_path: Path
) -> None:
    words = motor(tmp_path / "second.csv", 2, 5.9, "krpm")
    model, fmu = (bench / "mine.toml", None) if plant == "model" else (None, bench / "mine.fmu")
    found = pb.diagnose(words[0], model, fmu=fmu, columns=words[2])
    assert found.verdict in ("no_gap", "recalibrated")
    assert found.quantities.reading == ("rpm" if plant == "model" else "krpm")


def test_records_in_several_prefixes_are_diagnosed_together(bench: Path, tmp_path: Path) -> None:
    loaded = [
        pb.load_record(words[0], words[2])
        for unit in ("rpm", "krpm")
        for words in [motor(tmp_path / f"{unit}.csv", 3 + len(unit), 5.9, unit)]
    ]
    found = pb.diagnose(loaded, bench / "mine.toml", same_zero=True)
    assert found.verdict in ("no_gap", "recalibrated")


def test_a_watch_reads_records_in_the_unit_of_its_model(bench: Path, tmp_path: Path) -> None:
    first, second = (motor(tmp_path / f"{unit}.csv", 5, 7.9, unit) for unit in ("rpm", "krpm"))
    known = pb.load_record(first[0], first[2])
    found = pb.watch(pb.load_record(second[0], second[2]), bench / "mine.toml", training=known, diagnose=False)
    assert not [x for x in found.events if x["event"] == "alarm"]


def test_a_change_of_another_device_is_explained_in_its_unit(bench: Path, tmp_path: Path) -> None:
    first, second = motor(tmp_path / "first.csv", 5, 7.9), motor(tmp_path / "second.csv", 6, 7.9, rpm_per_V=120.0)
    found = pb.watch(second[0], bench / "mine.toml", training=first[0], columns=first[2], explain_rows=200)
    (explained,) = [x for x in found.events if x["event"] == "explained"][:1]
    assert explained["units"] == ["V", "rpm"]


@pytest.mark.parametrize("model", ["paper", "mine.toml"])
def test_columns_of_another_device_are_refused_before_anything_is_built(
    model: str, bench: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    record = tmp_path / "heater.csv"
    record.write_text("t,power,T\n" + "".join(f"{k},{k % 7},{20 + k % 5}\n" for k in range(50)), encoding="utf-8")
    monkeypatch.setattr("bender_native.ready.ready_plant_fmu", lambda _: pytest.fail("an FMU was built"))
    given = str(bench / model) if model.endswith(".toml") else model
    assert main(["compare", str(record), *HEATER, "--model", given, "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "degC" in said
    assert ("bender model fit" if model == "paper" else "--units") in said


def test_a_tuned_device_stays_within_the_commands_that_its_model_was_learned_from(bench: Path) -> None:
    learned = learned_commands(load_model(str(bench / "mine.toml"))) or (0.0, 0.0)
    assert learned == pytest.approx((-7.9, 7.9), rel=0.2)
    for upper_V in (None, 2.0):
        found = pb.tune(bench / "mine.toml", method="simc", setpoint_um=200.0, upper_V=upper_V)
        assert found.fmu.units == ("V", "rpm")
        assert found.session.settings.lower_V == learned[0]
        assert found.session.settings.upper_V == (upper_V or learned[1])
    assert learned_commands(load_model("beam")) is None
