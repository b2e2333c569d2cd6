import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from bender_cli.main import main
from bender_hil.log.read_run import read_run
from bender_investigate.journal import JOURNAL, read_decisions
from bender_loop.records.record import read_record

PATIENT = "[emulator]\n[guard]\nheartbeat_s = 4.0\nframe_age_s = 4.0\n"
"""Nothing real is at stake, and the machine may be busy."""


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--resume"], "--resume: name the investigation with --out"),
        (["--resume", "--out", "{tmp}"], "found no journal.jsonl, expected the directory of an investigation"),
        (["--budget-s", "1", "--out", "{tmp}/x"], "--budget-s must be 10 to 86400, found 1.0"),
        (["--pairs", "1", "--out", "{tmp}/x"], "--pairs must be 2 to 100, found 1"),
        (["--bench", "{tmp}/none.toml", "--out", "{tmp}/x"], "none.toml"),
        (["--record", "{tmp}/none.csv", "--out", "{tmp}/x"], "none.csv"),
    ],
)
def test_bad_words_end_in_one_line_and_write_nothing(tmp_path, capsys, words, said):
    status = main(["investigate", *(x.format(tmp=tmp_path) for x in words)])
    complaint = capsys.readouterr().err
    assert status == 2
    assert said in complaint
    assert complaint.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("supply", "sensor", "unit", "said"),
    [
        ("TCPIP::127.0.0.1::9::SOCKET", "TCPIP::127.0.0.1::10::SOCKET", "furlong", "gives furlong, which is no length"),
        ("xxxx", "yyyy", "um", "is not a VISA address"),
    ],
)
def test_a_bench_that_cannot_be_is_refused_before_anything_is_written(tmp_path, capsys, supply, sensor, unit, said):
    pytest.importorskip("pyvisa_py")
    bench = f'[supply]\nresource = "{supply}"\nmodel = "9115"\n'
    bench += f'[sensor]\nkind = "text"\nresource = "{sensor}"\nunit = "{unit}"\n'
    (tmp_path / "bench.toml").write_text(bench)
    assert main(["investigate", "--bench", str(tmp_path / "bench.toml"), "--out", str(tmp_path / "out")]) == 2
    assert said in capsys.readouterr().err
    assert [x.name for x in tmp_path.iterdir()] == ["bench.toml"]


def test_an_earlier_investigation_is_not_written_over(tmp_path, capsys):
    (tmp_path / JOURNAL).write_text("")
    assert main(["investigate", "--out", str(tmp_path)]) == 2
    assert "go on with it by --resume" in capsys.readouterr().err


@pytest.mark.parametrize("lost", [b"", b"\0" * 400])
def test_nobody_goes_on_over_a_journal_that_was_lost(tmp_path, capsys, lost):
    (tmp_path / JOURNAL).write_bytes(lost)
    (tmp_path / "01-rest").mkdir()
    assert main(["investigate", "--resume", "--out", str(tmp_path)]) == 2
    assert "begin a new investigation in another directory" in capsys.readouterr().err
    assert sorted(x.name for x in tmp_path.iterdir()) == ["01-rest", JOURNAL]
    assert (tmp_path / JOURNAL).read_bytes() == lost


@pytest.mark.slow
def test_on_the_emulated_bench_within_a_budget_and_taken_up_again(tmp_path: Path):
    (tmp_path / "bench.toml").write_text(PATIENT)
    words = [sys.executable, "-m", "bender_cli", "investigate", "--bench", "bench.toml", "--budget-s", "20"]
    words += ["--out", "found"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=200)
    assert done.returncode == 0, done.stderr
    assert "01-rest" in done.stdout
    assert "no verdict" in done.stdout
    out = tmp_path / "found"
    assert (out / "01-rest" / "summary.html").exists()
    assert (out / "01-rest" / "guard.jsonl").exists()
    told = json.loads((out / "investigation.json").read_text())
    assert told["ended"]["by"] == "budget"
    assert told["bench_s"]["all"] <= 20.0
    before = sorted(x.name for x in out.iterdir())
    again = subprocess.run([*words, "--resume"], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=200)
    assert again.returncode == 0, again.stderr
    assert "01-rest: run before the interruption" in again.stdout
    assert sorted(x.name for x in out.iterdir()) == before
    assert [x["kind"] for x in read_decisions(out / JOURNAL)].count("play") == 1


@pytest.mark.slow
def test_killed_in_a_play_the_output_comes_down_and_only_the_rest_is_played(tmp_path: Path):
    (tmp_path / "bench.toml").write_text(PATIENT)
    words = [sys.executable, "-m", "bender_cli", "investigate", "--bench", "bench.toml", "--budget-s", "20"]
    words += ["--out", "found"]
    first = subprocess.Popen(words, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    run = tmp_path / "found" / "01-rest"
    _wait(lambda: (run / "run.jsonl").exists() and (run / "run.jsonl").read_bytes().count(b"\n") > 180)
    first.kill()
    first.wait()
    _wait(lambda: b'"kind": "end"' in (run / "guard.jsonl").read_bytes())
    end = read_run(run).guard_entry("end")
    assert end is not None
    assert end["confirmed"] is True
    assert end["code"] == "controller_gone"
    again = subprocess.run([*words, "--resume"], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=200)
    assert again.returncode == 0, again.stderr
    assert "only the rest is played" in again.stdout
    parts = [tmp_path / "found" / name / "record.csv" for name in ("01-rest", "02-rest-rest")]
    played_s = [float(read_record(x).time_s[-1]) for x in parts]
    assert played_s[0] > 4.0
    assert sum(played_s) < 16.2 + 1.5


def _wait(is_so, limit_s: float = 90.0) -> None:
    end_s = time.perf_counter() + limit_s
    while not is_so():
        assert time.perf_counter() < end_s
        time.sleep(0.05)
