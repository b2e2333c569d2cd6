"""FMUs that crash, hang, eat memory, give no numbers or never move during a diagnosis: one line, no orphan."""

import functools
import json
import multiprocessing
from pathlib import Path

import numpy as np
import pytest
from few import few_rows
from foreign_fmus import foreign_fmu, needs_compiler

import bender_discrepancy.foreign.corrected_fmu as corrected_fmu
import bender_discrepancy.foreign.diagnose as diagnose_module
from bender_cli.main import main
from bender_loop.fmu.process.watched import WatchedPlant
from bender_loop.records.record import Record, write_record

pytestmark = needs_compiler
STEP_S, ROWS, PATIENCE_S = 0.02, 360, 2.0


@pytest.fixture(autouse=True)
def impatient(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    quick = functools.partial(WatchedPlant, patience_s=PATIENCE_S)
    for module in (diagnose_module, corrected_fmu):
        monkeypatch.setattr(module, "WatchedPlant", quick)
    monkeypatch.chdir(tmp_path)
    write_record(Path("record.csv"), measured())


def measured(rows_late: int = 0) -> Record:
    """The answer of a lag to random levels, less than that of the FMU, some rows late."""
    volts = np.repeat(np.random.default_rng(5).uniform(0.0, 40.0, ROWS // 15), 15)
    volts[:15] = 0.0
    reading, keep = np.zeros(ROWS), np.exp(-STEP_S / 0.1)
    for k in range(1, ROWS):
        reading[k] = keep * reading[k - 1] + (1.0 - keep) * 0.8 * volts[k - 1]
    noise = 0.02 * np.random.default_rng(6).standard_normal(ROWS)
    reading = np.concatenate([np.zeros(rows_late), reading])[:ROWS]
    return Record(STEP_S * np.arange(ROWS, dtype=np.float64), volts, reading + noise)


def refused(status: int, capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert main(["diagnose", "record.csv", *words, "--out", "o"]) == status
    said = [x for x in capsys.readouterr().err.splitlines() if x.startswith("bender")]
    assert len(said) == 1
    assert not multiprocessing.active_children()
    return said[0]


@pytest.mark.parametrize(
    ("kind", "words"),
    few_rows(
        [
            ("crash", "SIGSEGV"),
            ("trap", "SIGFPE"),
            ("leave", "exit status 0"),
            ("eat", "crash.fmu"),
            ("nan", "the output sensor.y is nan"),
            ("hang", "no end within 2 s"),
        ],
        0,
        1,
    ),
)
def test_one_line_and_no_orphan(kind: str, words: str, capsys: pytest.CaptureFixture[str]) -> None:
    foreign_fmu(Path("crash.fmu"), hostile=kind, after=500)
    assert words in refused(1, capsys, "--fmu", "crash.fmu")
    assert not Path("o").exists()


@pytest.mark.slow
def test_what_was_ranked_before_a_crash_is_kept(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("fmu_manipulation_toolbox", reason="the container library is not installed")
    # behind a delay the container takes short steps: more of them than all that is driven before the search
    write_record(Path("record.csv"), measured(rows_late=3))
    foreign_fmu(Path("late.fmu"), hostile="crash", after=30 * ROWS)
    said = refused(1, capsys, "--fmu", "late.fmu")
    assert "what was ranked until then is in" in said
    kept = json.loads(Path("o/diagnosis.json").read_text(encoding="utf-8"))
    assert kept["partial"]
    assert [x["id"] for x in kept["effects"]] == ["transport_delay"]
    assert kept["fmu"] is None
