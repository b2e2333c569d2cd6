"""`bender tune` and `python -m bender_tuner` as processes: what they write, and how they end."""

import argparse
import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from few import few_rows

from bender_cli.main import main
from bender_tuner.command import add_arguments, settings_from
from bender_tuner.results.gains_file import read_gains

SLAVES = Path(__file__).parent / "slaves"


def tune(*words: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*command(), *map(str, words)], cwd=cwd, capture_output=True, text=True, check=False)


def small(fmu: Path) -> tuple[object, ...]:
    return "--fmu", fmu, "--objective", "itae", "--evaluations", 13


def command() -> list[str]:
    return [sys.executable, "-m", "bender_tuner"]


@pytest.fixture(scope="session")
def paper_fmu() -> Path:
    # In a process of its own, because a loaded FMU brings its copy of PythonFMU into the process that loads it.
    code = "from bender_export.build import ensure_plant_fmu; print(ensure_plant_fmu('paper'))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return Path(done.stdout.strip())


@pytest.fixture(scope="session")
def tuned(tmp_path_factory: pytest.TempPathFactory, paper_fmu: Path) -> Path:
    """Results of one small tuning."""
    folder = tmp_path_factory.mktemp("tuned")
    words = ("--seed", 3, "--compare", "bas,zn", "--monte-carlo", 3, "--out", "out")
    done = tune(*small(paper_fmu), *words, cwd=folder)
    assert done.returncode == 0, done.stderr
    (folder / "stdout.txt").write_text(done.stdout, encoding="utf-8")
    return folder


def document(folder: Path) -> dict:
    return json.loads((folder / "tuning.json").read_text(encoding="utf-8"))


def test_a_tuning_writes_what_it_says(tuned: Path, paper_fmu: Path) -> None:
    out, printed = tuned / "out", (tuned / "stdout.txt").read_text(encoding="utf-8")
    names = {"gains.toml", "tuning.json", "convergence.png", "step.png", "loop.png", "monte_carlo.png"}
    assert {path.name for path in out.iterdir()} == names
    assert all(str(Path("out") / name) in printed for name in names)
    facts = document(out)
    assert facts["status"] == "complete"
    assert facts["settings"]["seed"] == 3
    assert facts["fmu"]["sha256"] == hashlib.sha256(paper_fmu.read_bytes()).hexdigest()
    assert facts["versions"].keys() >= {"python", "numpy", "scipy", "fmpy"}
    best, history = facts["best"], facts["history"]
    assert history.keys() == {"reliable_bas", "bas"}
    assert all(len(column) == 13 for run in history.values() for column in run.values() if isinstance(column, list))
    assert best["objective_value"] == min(history["reliable_bas"]["value"]) == history["reliable_bas"]["best"][-1]
    assert best["step"]["overshoot_percent"] >= 0.0
    assert best["monte_carlo"]["plants"] == 3
    assert best["robustness"]["nominal"]["gain_margin"] > 1.0
    assert [other["method"] for other in facts["others"]] == ["bas", "zn", "simc", "start"]
    assert facts["ziegler_nichols"]["sentence"] in printed
    assert "bounds kept" in printed or "bounds NOT kept" in printed


def test_gains_file_and_report_agree(tuned: Path) -> None:
    gains, limits, period_s = read_gains(tuned / "out" / "gains.toml")
    best = document(tuned / "out")["best"]
    assert best["parallel"]["integral_V_per_um_s"] == gains.integral_V_per_um_s
    assert best["isa"]["gain_V_per_um"] == gains.proportional_V_per_um
    assert best["discrete"]["period_s"] == period_s == 1.0 / 30.0
    assert (limits.lower_V, limits.upper_V) == (0.0, 50.0)


TWICE = """
import sys
from bender_cli.main import main
for seed, out in (("3", "again"), ("4", "other")):
    assert main(["tune", *sys.argv[1:], "--seed", seed, "--out", out]) == 0
"""


@pytest.mark.slow
def test_the_same_seed_gives_the_same_gains(tuned: Path, paper_fmu: Path, tmp_path: Path) -> None:
    """In another process, and beside another seed."""
    words = [sys.executable, "-c", TWICE, *map(str, small(paper_fmu))]
    subprocess.run(words, cwd=tmp_path, check=True, capture_output=True)
    gains = {name: (tmp_path / name / "gains.toml").read_bytes() for name in ("again", "other")}
    assert gains["again"] == (tuned / "out" / "gains.toml").read_bytes()
    assert gains["again"] != gains["other"]


@pytest.mark.slow
def test_a_model_is_followed_or_said_not_to_help(paper_fmu: Path, tmp_path: Path) -> None:
    done = tune(*small(paper_fmu), "--follow-model", "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    gains = (tmp_path / "out" / "gains.toml").read_text(encoding="utf-8")
    assert ("[model_following]" in gains) != ("model following is not recommended" in done.stdout)


def test_a_rule_needs_no_search_and_removes_old_pictures(tmp_path: Path, paper_fmu: Path) -> None:
    (tmp_path / "convergence.png").write_bytes(b"of an earlier run")
    done = tune("--fmu", paper_fmu, "--method", "zn", "--objective", "mse", "--out", ".", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"gains.toml", "tuning.json", "step.png", "loop.png"}
    assert "Ziegler-Nichols, not well posed here: the ultimate period" in done.stdout
    assert document(tmp_path)["history"] == {}


PRINTED_SIGN = """
import sys
from pathlib import Path
from bender_tuner.task.problem import pose_problem
from bender_tuner.task.session import open_guarded
from bender_tuner.task.settings import make_settings
from bender_tuner.task.tuning import run_search
with open_guarded(Path(sys.argv[1])) as (plant, _):
    problem = pose_problem(plant, make_settings(method="bas_printed"))
    for method in ("bas_printed", "bas", "reliable_bas"):
        for seed in range(2):
            run = run_search(problem, method, seed=seed)
            tail = [e.value for e in run.history[-30:]]
            print(method, run.value, sum(value > run.history[0].value for value in tail) / len(tail))
"""


@pytest.mark.slow
def test_the_printed_sign_fails_to_tune(paper_fmu: Path) -> None:
    """Through the FMU, on the paper's own task: equation (25) as printed improves nothing, or makes it worse."""
    done = subprocess.run(
        [sys.executable, "-c", PRINTED_SIGN, str(paper_fmu)], capture_output=True, text=True, check=True
    )
    rows = [line.split() for line in done.stdout.splitlines()]
    best = {method: [float(row[1]) for row in rows if row[0] == method] for method, *_ in rows}
    climbed = [float(row[2]) for row in rows if row[0] == "bas_printed"]
    assert min(best["bas_printed"]) > 5.0 * max(best["bas"])
    assert min(best["bas_printed"]) > 5.0 * max(best["reliable_bas"])
    assert all(share > 0.5 for share in climbed)


def spoilt(fmu: Path, target: Path, change: Callable[[str], str]) -> Path:
    with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(target, "w") as copy:
        for name in source.namelist():
            data = source.read(name)
            copy.writestr(name, change(data.decode()).encode() if name == "modelDescription.xml" else data)
    return target


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--fmu", "missing.fmu"], "missing.fmu: no such file"),
        (["--fmu", "version.fmu"], "found FMI version 4.0, expected 2.0 or 3.0"),
        (["--fmu", "exchange.fmu"], "found a model-exchange FMU"),
        (["--fmu", "good.fmu", "--input", "volts"], "found no variable 'volts', expected a Real input"),
        (["--fmu", "good.fmu", "--output", "volts"], "found no variable 'volts', expected a Real output"),
        (["--fmu", "good.fmu", "--model", "paper"], "give only one"),
        (["--model", "no_such_model"], "no_such_model"),
        (["--method", "luck"], "method 'luck' is unknown"),
        (["--compare", "pso,luck"], "method 'luck' is unknown"),
        (["--objective", "joy"], "objective 'joy' is unknown"),
        (["--setpoint", "nan"], "--setpoint: found 'nan', expected a finite number"),
        (["--evaluations", "-3"], "--evaluations: found '-3'"),
        (["--evaluations", "3", "--iterations", "1"], "not allowed with"),
        (["--voltage-limits", "50", "0"], "lower_V"),
        (["--exposure", "15"], "exposure_s must be at most the period 0.0333"),  # of earlier versions, in ms
        (["--nonsense", "1"], "--nonsense"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(
    words: list[str],
    complaint: str,
    paper_fmu: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """In this process: all of it is found before an FMU is loaded."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "good.fmu").write_bytes(paper_fmu.read_bytes())
    spoilt(paper_fmu, tmp_path / "version.fmu", lambda text: text.replace('fmiVersion="2.0"', 'fmiVersion="4.0"'))
    spoilt(paper_fmu, tmp_path / "exchange.fmu", lambda text: re.sub(r"<(/?)CoSimulation\b", r"<\1ModelExchange", text))
    before = set(tmp_path.rglob("*"))
    assert main(["tune", *words]) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert len(err.splitlines()) == 1
    assert complaint in err
    assert set(tmp_path.rglob("*")) == before


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "complaint"),
    few_rows(
        [
            (["--setpoint", "40"], "between 0 and 50 V the plant comes to rest between 0 and 23.1"),
            (["--out", "file/below"], "file/below: cannot be used as output directory"),
        ],
        0,
    ),
)
def test_what_only_the_plant_can_tell_is_bad_input_too(
    words: list[str], complaint: str, paper_fmu: Path, tmp_path: Path
) -> None:
    (tmp_path / "file").touch()
    done = tune("--fmu", paper_fmu, *words, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert len([line for line in done.stderr.splitlines() if not line.startswith("learning the plant")]) == 1
    assert complaint in done.stderr.replace("\\", "/")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def wait_for_tuning(process: subprocess.Popen[str]) -> None:
    """A slow machine says before that it learns the plant."""
    assert process.stderr is not None
    while not (line := process.stderr.readline()).startswith("tuning with"):
        assert line.startswith("learning the plant"), line


def start_of_a_long_tuning(fmu: Path, folder: Path) -> subprocess.Popen[str]:
    words = [*command(), "--fmu", str(fmu), "--evaluations", "100000", "--objective", "itae", "--out", "out"]
    return subprocess.Popen(words, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def said_when_interrupted(number: signal.Signals, fmu: Path, folder: Path) -> str:
    """The one line that a long tuning ends with, on a signal in its midst."""
    with start_of_a_long_tuning(fmu, folder) as process:
        wait_for_tuning(process)
        process.send_signal(number)
        _, errors = process.communicate(timeout=120)
    assert process.returncode == 130, errors
    (said,) = (line for line in errors.splitlines() if line.startswith("bender:"))
    return said


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="a console interrupt cannot be sent to one child process there")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_keeps_the_best_so_far(number: signal.Signals, paper_fmu: Path, tmp_path: Path) -> None:
    said = said_when_interrupted(number, paper_fmu, tmp_path)
    assert re.search(r"interrupted after \d+ of 100000 evaluations", said)
    assert str(Path("out") / "gains.toml") in said
    facts = document(tmp_path / "out")
    gains, _, _ = read_gains(tmp_path / "out" / "gains.toml")
    history = facts["history"]["reliable_bas"]
    row = history["value"].index(min(history["value"]))
    assert facts["status"] == "interrupted"
    assert history["integral_V_per_um_s"][row] == gains.integral_V_per_um_s
    assert (tmp_path / "out" / "convergence.png").is_file()


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="a console interrupt cannot be sent to one child process there")
def test_a_second_interrupt_leaves_at_once(paper_fmu: Path, tmp_path: Path) -> None:
    with start_of_a_long_tuning(paper_fmu, tmp_path) as process:
        wait_for_tuning(process)
        process.send_signal(signal.SIGINT)
        while not (tmp_path / "out" / "gains.toml").is_file():
            time.sleep(0.005)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=120)
    assert process.returncode == 130
    assert "Traceback" not in errors
    assert read_gains(tmp_path / "out" / "gains.toml")[0].integral_V_per_um_s > 0.0


TIRING = """
import sys
from pathlib import Path
from pythonfmu.builder import FmuBuilder
FmuBuilder.build_FMU(Path(sys.argv[1]), dest=Path(sys.argv[2]), needsExecutionTool=False)
"""


@pytest.mark.slow
def test_a_plant_that_breaks_keeps_the_best_so_far(tmp_path: Path) -> None:
    slave = SLAVES / "bender_tuner_test_tiring.py"
    subprocess.run([sys.executable, "-c", TIRING, str(slave), str(tmp_path)], check=True, capture_output=True)
    (fmu,) = tmp_path.glob("*.fmu")
    done = tune("--fmu", fmu, "--evaluations", 500, "--objective", "itae", "--out", "out", cwd=tmp_path)
    assert done.returncode == 1, done.stderr
    said = [line for line in done.stderr.splitlines() if line.startswith("bender:")]
    assert len(said) == 1
    assert "worn out" in said[0]
    assert "evaluations of reliable_bas" in said[0]
    facts = document(tmp_path / "out")
    assert facts["status"] == "failed"
    assert "worn out" in facts["reason"]
    gains, _, _ = read_gains(tmp_path / "out" / "gains.toml")
    assert facts["best"]["parallel"]["integral_V_per_um_s"] == gains.integral_V_per_um_s


@pytest.mark.skipif(os.name == "nt", reason="a console interrupt cannot be sent to one child process there")
@pytest.mark.slow
def test_an_interrupt_leaves_an_older_complete_result_alone(tuned: Path, paper_fmu: Path, tmp_path: Path) -> None:
    shutil.copytree(tuned / "out", tmp_path / "out")
    older = {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    for number in (signal.SIGHUP, signal.SIGTERM):
        said = said_when_interrupted(number, paper_fmu, tmp_path)
        assert re.search(r"out.gains\.partial\.toml; out.gains\.toml is of an earlier run", said)
        now = {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()}
        assert older.items() <= now.items()
        assert json.loads(now["tuning.partial.json"])["status"] == "interrupted"
    assert tune(*small(paper_fmu), "--out", "out", cwd=tmp_path).returncode == 0
    assert not list((tmp_path / "out").glob("*.partial.*"))


def test_an_exposure_is_in_seconds_as_in_the_bench_file():
    words = argparse.ArgumentParser()
    add_arguments(words)
    assert settings_from(words.parse_args(["--exposure", "0.015"])).exposure_s == 0.015
