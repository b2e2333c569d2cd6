"""The bench in bluesky: runs as documents, and an aborted plan that leaves the output off."""

import json
import re
import threading
import time
from pathlib import Path
from typing import Any

import pytest
import tomli_w

pytest.importorskip("bluesky", reason="needs the extra bluesky")
pytest.importorskip("ophyd_async", reason="needs the extra bluesky")
pytest.importorskip("pyvisa_py", reason="needs the extra bench")

from bluesky import RunEngine  # pyright: ignore[reportMissingImports]
from bluesky.utils import RunEngineInterrupted  # pyright: ignore[reportMissingImports]

from bender_loop.records.record import read_record
from bender_studies.bench_trials.end_to_end import HIDDEN, hidden_model
from piezo_bender.bluesky import Bench, investigate, play

pytestmark = pytest.mark.filterwarnings("default")
PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "use-the-bench-from-bluesky.md"
BENCH = """
[emulator]
supply = "GCS"
sensor = "text"
[metadata]
specimen = "bender 3"
operator = "me"
[guard]
frame_age_s = 0.8
heartbeat_s = 1.0
travel_um = [-20, 90]
"""


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    (tmp_path / "bench.toml").write_text(BENCH)
    (tmp_path / "steps.csv").write_text("time_s,voltage_V\n0,0\n0.5,8\n1,0\n")
    return Bench(tmp_path / "bench.toml", folder=tmp_path / "runs")


def _engine() -> tuple[RunEngine, list[tuple[str, dict[str, Any]]]]:
    engine, documents = RunEngine({}, context_managers=[]), []
    engine.subscribe(lambda name, document: documents.append((name, document)))
    return engine, documents


def _ended(bench: Bench) -> dict[str, Any]:
    assert bench.directory is not None
    lines = (bench.directory / "guard.jsonl").read_text().splitlines()
    return next(entry for entry in map(json.loads, lines) if entry["kind"] == "end")


def test_a_profile_is_a_run_of_documents_with_the_rows_of_its_record(bench: Bench, tmp_path: Path):
    engine, documents = _engine()
    engine(play(bench, profile=tmp_path / "steps.csv"))
    start, stop = documents[0][1], documents[-1][1]
    assert (start["specimen"], start["operator"], start["plan_name"]) == ("bender 3", "me", "play")
    assert stop["exit_status"] == "success"
    assert bench.directory is not None
    record = read_record(bench.directory / "record.csv")
    pages = [document["data"] for name, document in documents if name == "event_page"]
    told = [value for page in pages for value in page["bench-displacement_um"]]
    assert told == pytest.approx(record.displacement_um.tolist(), nan_ok=True)
    keys = next(document for name, document in documents if name == "descriptor")["data_keys"]
    assert keys["bench-displacement_um"]["units"] == "um"
    assert _ended(bench)["confirmed"]


def test_an_aborted_plan_says_stop_and_the_output_is_off_before_it_ends(bench: Bench):
    engine, documents = _engine()

    def abort() -> None:
        while bench.directory is None or not (bench.directory / "run.jsonl").exists():
            time.sleep(0.05)
        while '"tick"' not in (bench.directory / "run.jsonl").read_text():
            time.sleep(0.05)
        engine.abort("enough")

    thread = threading.Thread(target=abort, daemon=True)
    thread.start()
    with pytest.raises(RunEngineInterrupted):
        engine(play(bench, profile="staircase"))
    end = _ended(bench)
    assert (end["code"], end["confirmed"]) == ("stop", True)
    thread.join(10.0)
    assert documents[-1][1]["exit_status"] == "abort"


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_the_lines_of_the_page_come_to_a_verdict(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """As they stand, on a bench that hides a delay and a hysteresis."""
    (tmp_path / "hidden.toml").write_text(tomli_w.dumps(hidden_model().to_table()))
    hidden = f"model = {json.dumps(str(tmp_path / 'hidden.toml'))}\n"
    (tmp_path / "bench.toml").write_text(BENCH.replace("[emulator]\n", f"[emulator]\n{hidden}"))
    monkeypatch.chdir(tmp_path)
    (lines,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert len(lines.splitlines()) <= 10
    ran: dict[str, Any] = {}
    exec(compile(lines, str(PAGE), "exec"), ran)
    told = ran["events"][-1]
    assert told["bench-verdict"] == ["named"]
    assert set(told["bench-effects"][0].split(", ")) == set(HIDDEN)
    assert told["bench-bench_s"][0] <= 240.0


@pytest.mark.slow
def test_an_investigation_is_one_event(bench: Bench):
    engine, documents = _engine()
    engine(investigate(bench, budget_s=20.0))
    (page,) = [document["data"] for name, document in documents if name == "event_page"]
    assert 0.0 < page["bench-bench_s"][0] <= 20.0
    assert bench.directory is not None
    assert (bench.directory / "investigation.json").exists()
