"""`bender benchmark devices`: a device of a kind of its own through the whole of it, and words that it refuses."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bender_cli.main import main
from bender_studies.benchmarks import devices
from bender_studies.benchmarks.devices import Device, Outcome


def write_lag(path: Path, seed: int, rows: int, low: float = -10.0, high: float = 10.0) -> None:
    """A quick lag; where its input is clipped, it is what no linear structure has."""
    rng = np.random.default_rng(seed)
    state, lines = 0.0, ["time_s,u,y"]
    for k, u in enumerate(np.repeat(rng.uniform(-10.0, 10.0, rows // 10), 10)):
        lines.append(f"{k / 50.0:.6f},{u:.6f},{state + rng.normal(0.0, 0.02):.6f}")
        state += 0.4 * (2.0 * min(max(u, low), high) - state)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def benchmarked(device: Device, folder: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Return what the command finds of a device whose records are in a folder."""
    monkeypatch.setattr(devices, "DEVICES", (device,))
    assert main(["benchmark", "devices", "--data", str(folder), "--out", str(folder / "out")]) == 0
    assert (folder / "out" / device.name / "diagnosis.json").is_file()
    (found,) = json.loads((folder / "out" / "devices.json").read_text(encoding="utf-8"))
    return found


@pytest.mark.slow
def test_a_device_goes_from_its_record_to_the_second_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    write_lag(tmp_path / "one.csv", 1, 800, -4.0, 6.0)
    write_lag(tmp_path / "other.csv", 2, 800, -4.0, 6.0)
    device = Device("clipped", "one.csv", "bar", frozenset({"saturation"}), frozenset({"creep"}), "other.csv")
    found = benchmarked(device, tmp_path, monkeypatch)
    assert found["is_right"]
    assert not found["is_wrong"]
    assert found["second_after"] < 0.5 * found["second_before"]


def test_nothing_is_said_of_a_linear_device_and_its_second_record_is_met(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    write_lag(tmp_path / "one.csv", 1, 300)
    write_lag(tmp_path / "other.csv", 2, 300)
    device = Device("lag", "one.csv", "bar", frozenset(), frozenset({"creep"}), "other.csv")
    found = benchmarked(device, tmp_path, monkeypatch)
    assert found["verdict"] == "no_gap"
    assert not found["certain"]
    assert found["second_after"] < 1.3 * 0.02


@pytest.mark.slow
def test_a_drawn_machine_is_diagnosed_and_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["benchmark", "devices", "--drawn", "1", "--first-seed", "15", "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "one of the first two names is right: 1 of 1" in said
    (machine,) = json.loads((tmp_path / "devices.json").read_text(encoding="utf-8"))
    assert machine["name"] == "proportional valve 15"
    assert set(machine["certain"]) <= set(machine["right"])
    assert machine["second_after"] < 0.2 * machine["second_before"]


def test_drawn_machines_are_written_and_what_is_said_of_them_is_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    """What a diagnosis would say is made up: one right, one mistaken and worse on the second record."""

    def outcome_of(device: Device, data: Path, out: Path) -> Outcome:
        first, second = (devices._record(file, device, data) for file in (device.file, device.other))
        assert first.time_s.size > 100
        assert not np.array_equal(first.displacement_um, second.displacement_um)
        is_right = device.name.endswith("15")
        name = sorted(device.right if is_right else device.wrong)[0]
        after = 0.1 if is_right else 1.5
        return Outcome(
            device.name, "named", ((name, 0.9),), is_right, not is_right, 1.0, 0.2, 1.0, after, 3.0, device.unit,
            (name,), tuple(sorted(device.right)),
        )  # fmt: skip

    monkeypatch.setattr(devices, "outcome_of", outcome_of)
    assert main(["benchmark", "devices", "--drawn", "2", "--first-seed", "15", "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    right, mistaken = json.loads((tmp_path / "devices.json").read_text(encoding="utf-8"))
    assert right["name"] == "proportional valve 15"
    assert "one of the first two names is right: 1 of 2; the first would be a mistake: 1" in said
    assert f"certain names: 2, not accepted: {mistaken['certain'][0]} of {mistaken['name']}" in said
    assert f"worse there: {mistaken['name']}\n" in said
    assert "longest: 3 s" in said


@pytest.mark.parametrize(("unit", "held"), [("m", "µm"), ("mm", "µm"), ("kip", "kip"), ("ticks/s", "ticks/s")])
def test_lengths_are_shown_in_the_unit_in_which_they_are_held(unit: str, held: str):
    assert devices._inside(unit) == held
