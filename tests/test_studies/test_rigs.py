"""`bender benchmark rigs`: a rig of a kind of its own through the whole of it, and words that it refuses."""

import json
from pathlib import Path

import numpy as np
import pytest

from bender_cli.main import main
from bender_loop.records.record import Record, write_record
from bender_studies.benchmarks import rigs


def lagging(seed: int, delay_rows: int) -> Record:
    """Random levels through a gain, read some rows late: what no form of a first model with a lag has is a delay."""
    rng = np.random.default_rng(seed)
    volts = np.repeat(rng.uniform(0.0, 10.0, 60), 10)
    late = np.concatenate([np.zeros(delay_rows + 1), volts])[: volts.size]
    return Record(np.arange(volts.size) / 50.0, volts, 2.0 * late + rng.normal(0.0, 0.05, volts.size))


@pytest.mark.slow
def test_a_rig_goes_from_its_record_to_the_judged_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    for name, seed in (("one.csv", 1), ("other.csv", 2)):
        write_record(tmp_path / name, lagging(seed, 4))
    rig = rigs.Rig("late", "one.csv", "µm", frozenset({"transport_delay"}), other="other.csv", part=0.35)
    monkeypatch.setattr(rigs, "RIGS", (rig,))
    assert main(["benchmark", "rigs", "--data", str(tmp_path), "--out", str(tmp_path / "out")]) == 0
    (found,) = json.loads((tmp_path / "out" / "rigs.json").read_text(encoding="utf-8"))
    # the first model may have the delay itself, and then nothing is missing
    assert found["after"] <= 0.1
    assert (tmp_path / "out" / "late" / "diagnosis.json").is_file()
    assert "late" in capsys.readouterr().out


def test_a_rig_that_is_none_and_a_folder_without_records_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    assert main(["benchmark", "rigs", "--rigs", "toaster"]) == 2
    assert "found 'toaster', expected one of 'stack', 'silverbox', 'damper'" in capsys.readouterr().err
    assert main(["benchmark", "rigs", "--data", str(tmp_path), "--out", str(tmp_path / "out")]) == 2
    assert "piezo_stack_ramps.csv" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
