"""FMUs that take their process along, in a process of their own."""

import json
import math
import multiprocessing
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from few import few_rows
from following_controllers import followed
from foreign_fmus import foreign_fmu, needs_compiler

from bender_loop.control.closed_loop import simulate
from bender_loop.control.pid import Gains, Limits
from bender_loop.control.plant import restart
from bender_loop.control.references import Step
from bender_loop.control.sampling import Sampling
from bender_loop.errors import InputError, RunError
from bender_loop.fmu.controller import FmuController
from bender_loop.fmu.followed_model import Loop
from bender_loop.fmu.follower import Follower
from bender_loop.fmu.plant import FmuPlant
from bender_loop.fmu.process.watched import (
    PATIENCE_S,
    WatchedController,
    WatchedFollower,
    WatchedPlant,
    opened_follower,
)
from bender_loop.records.drive import drive
from bender_native.ready import ready_plant_fmu
from bender_tuner.model.scaled_plant import ScaledPlant

GAINS, LIMITS = Gains(0.5, 5.0, 0.0), Limits(0.0, 50.0)


@pytest.fixture(autouse=True)
def temporary(tmp_path, monkeypatch):
    """A temporary folder of the test's own, which must be empty again when it ends."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    yield folder
    assert not list(folder.iterdir())


def traces(plant):
    yield simulate(plant, GAINS, LIMITS, Step(10.0), Sampling(100.0), 0.5)
    rng = np.random.default_rng(3)
    yield simulate(plant, GAINS, LIMITS, Step(10.0), Sampling(30.0, 1, 0.015, 0.01, substeps=5), 0.5, rng)


def test_it_gives_the_same_bits_as_in_this_process(lag_fmu):
    with (
        FmuPlant(lag_fmu, input_name="u", output_name="y") as here,
        WatchedPlant(lag_fmu, input_name="u", output_name="y") as there,
    ):
        assert (there.input, there.output) == (here.input, here.output)
        for one, other in ((here, there), (ScaledPlant(here, 1.3), ScaledPlant(there, 1.3))):
            for a, b in zip(traces(one), traces(other), strict=True):
                assert np.array_equal(a.displacement_um, b.displacement_um)
                assert np.array_equal(a.voltage_V, b.voltage_V)
            times, voltages = np.arange(20) * 0.01, np.linspace(0.0, 5.0, 20)
            assert np.array_equal(drive(one, times, voltages), drive(other, times, voltages))
            assert restart(one) == restart(other)
            assert [one.step(3.0, 0.01), one.read()] == [other.step(3.0, 0.01), other.read()]


def test_whole_runs_go_there_in_one_go(lag_fmu, monkeypatch):
    with WatchedPlant(lag_fmu, input_name="u", output_name="y") as plant:
        monkeypatch.setattr(plant, "step", lambda *_: pytest.fail("a step went there and back alone"))
        assert len(simulate(plant, GAINS, LIMITS, Step(10.0), Sampling(100.0), 0.5).time_s) == 51


def test_parameters_and_their_faults_cross(lag_fmu):
    with WatchedPlant(lag_fmu, input_name="u", output_name="y") as plant:
        plant.set_parameters({"gain": 2e-6})
        plant.reset()
        assert plant.step(1.0, 10.0) == pytest.approx(2.0)
        with pytest.raises(InputError, match="found no parameter 'bogus'"):
            plant.set_parameters({"bogus": 1.0})
        with pytest.raises(ValueError, match="step_s must be a finite number > 0"):
            plant.step(1.0, math.nan)
        assert plant.step(1.0, 0.01) > 0.0


def test_what_cannot_be_opened_is_said_as_ever(lag_fmu, tmp_path):
    with pytest.raises(InputError, match="no such file"):
        WatchedPlant(tmp_path / "missing.fmu")
    with pytest.raises(InputError, match="found no variable 'volts'"):
        WatchedPlant(lag_fmu, input_name="volts", output_name="y")


def in_a_worker(fmu: Path) -> float:
    with WatchedPlant(fmu, input_name="u", output_name="y") as plant:
        return plant.step(1.0, 100.0)


@pytest.mark.slow
def test_the_worker_of_a_pool_can_have_one(lag_fmu, temporary, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(temporary))
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.apply(in_a_worker, (lag_fmu,)) == pytest.approx(1.0)


@needs_compiler
def test_a_controller_gives_the_same_commands_as_in_this_process(tmp_path):
    fmu = foreign_fmu(tmp_path / "controller.fmu", controller=True, input_unit="m", output_unit="V", gain=1e6)
    with FmuController(fmu, 0.05) as here, WatchedController(fmu, 0.05) as there:
        for k in range(20):
            told = (10.0 + k, 0.3 * k, 0.02 + 0.001 * k)
            assert here.step(*told) == there.step(*told) > 0.0
    with pytest.raises(InputError, match="setpoint"):
        WatchedController(foreign_fmu(tmp_path / "plant.fmu"), 0.05)


LOOP = Loop(0.05, LIMITS, 500.0)


@needs_compiler
@pytest.mark.parametrize("lost", [False, True])
def test_a_controller_that_follows_a_model_gives_the_same_commands_as_in_this_process(tmp_path, lost):
    fmu = foreign_fmu(tmp_path / "lag.fmu")
    model = followed(fmu, input="drive.u", output="sensor.y")
    with Follower(fmu, model, GAINS, LOOP) as here, WatchedFollower(fmu, model, GAINS, LOOP) as there:
        for k in range(12):
            told = (10.0 + k, None if lost and k == 4 else 0.3 * k, 0.05, 0.001 * k)
            assert here.step(*told) == there.step(*told)
            assert here.predicted_um() == there.predicted_um()
        here.rest()
        there.rest()
        assert here.step(5.0, 0.0, 0.05) == there.step(5.0, 0.0, 0.05) > 0.0
    with pytest.raises(InputError, match="is not the FMU that the gains were tuned"):
        WatchedFollower(foreign_fmu(tmp_path / "other.fmu", gain=2e-6), model, GAINS, LOOP)


def watched(kind, folder, hostile, after):
    """An FMU that turns hostile after so many steps, as a plant, a controller, or a model that is followed."""
    units = {"controller": True, "input_unit": "m", "output_unit": "V", "gain": 1e6} if kind == "controller" else {}
    fmu = foreign_fmu(folder / "late.fmu", hostile=hostile, after=after, **units)
    patience_s = 0.5 if hostile == "hang" else PATIENCE_S
    if kind == "plant":
        return WatchedPlant(fmu, patience_s=patience_s)
    if kind == "controller":
        return WatchedController(fmu, 0.05, patience_s=patience_s)
    return WatchedFollower(fmu, followed(fmu, input="drive.u", output="sensor.y"), GAINS, LOOP, patience_s=patience_s)


def run_on(there):
    if isinstance(there, WatchedPlant):
        simulate(there, GAINS, LIMITS, Step(1.0), Sampling(100.0), 5.0)
    else:
        _ = [there.step(10.0 + k % 2, 0.0, 0.05) for k in range(5000)]


@needs_compiler
@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize(
    ("kind", "hostile", "how"),
    few_rows(
        [
            ("plant", "crash", r"a run: .*broke off with SIGSEGV after \d+ steps"),
            ("plant", "trap", r"a run: .*broke off with SIGFPE after \d+ steps"),
            ("plant", "leave", r"a run: .*broke off with exit status 0 after \d+ steps"),
            ("plant", "eat", r"a run: .*broke off with SIGABRT after \d+ steps"),
            ("plant", "hang", r"no end within 0.5 s, after \d+ steps; the FMU hangs"),
            ("controller", "crash", "broke off with SIGSEGV after 5 steps"),
            ("controller", "leave", "broke off with exit status 0"),
            ("controller", "close", "broke off with"),
            ("controller", "hang", "no end within 0.5 s, after 5 steps; the FMU hangs"),
            ("controller", "nan", "the command is nan V"),
            ("follower", "crash", "broke off with SIGSEGV after"),
            ("follower", "hang", "no end within 0.5 s, after"),
        ],
        *(0, 1, *range(4, 12)),
    ),
)
def test_an_fmu_that_takes_its_process_along_is_one_sentence_that_stays_said(tmp_path, kind, hostile, how):
    with watched(kind, tmp_path, hostile, {"plant": 300, "controller": 5, "follower": 2000}[kind]) as there:
        begun = time.monotonic()
        with pytest.raises(RunError, match=rf"late.fmu: .*{how}") as first:
            run_on(there)
        assert time.monotonic() - begun < 10.0
        assert "\n" not in str(first.value)
        if isinstance(there, WatchedPlant):
            for call in (there.reset, there.read, lambda: there.step(1.0, 0.1)):
                with pytest.raises(RunError, match=f"^{re.escape(str(first.value))}$"):
                    call()


@needs_compiler
def test_only_a_model_of_this_project_is_followed_in_this_process(tmp_path):
    fmu, ours = foreign_fmu(tmp_path / "lag.fmu"), ready_plant_fmu("beam")
    with opened_follower(fmu, followed(fmu, input="drive.u", output="sensor.y"), GAINS, LOOP) as controller:
        assert isinstance(controller, WatchedFollower)
    with opened_follower(ours, followed(ours), GAINS, LOOP) as controller:
        assert isinstance(controller, Follower)


@needs_compiler
def test_a_start_that_crashes(tmp_path):
    fmu = foreign_fmu(tmp_path / "early.fmu", hostile="crash", after=1)
    with pytest.raises(RunError, match="loading and initialising: the process that ran the FMU broke off"):
        WatchedPlant(fmu)


@pytest.mark.slow
@needs_compiler
def test_an_interrupt_ends_a_hang_and_stops_a_sound_run_between_two_steps(tmp_path, lag_fmu):
    wanted = threading.Event()
    hang = foreign_fmu(tmp_path / "hang.fmu", hostile="hang", after=100)
    with WatchedPlant(hang, interrupted=wanted.is_set) as plant:
        threading.Timer(0.5, wanted.set).start()
        with pytest.raises(RunError, match="no end within 2 s after the interrupt"):
            simulate(plant, GAINS, LIMITS, Step(1.0), Sampling(100.0), 5.0)
    wanted.clear()
    stops = [True]
    # the interrupt comes when the run has begun: on a busy machine the start takes longer than any wait
    with WatchedPlant(
        lag_fmu, input_name="u", output_name="y", interrupted=wanted.is_set,
        tell=lambda _: wanted.set() if stops[0] else None,
    ) as plant:  # fmt: skip
        with pytest.raises(RunError, match="stopped on request"):
            simulate(plant, GAINS, LIMITS, Step(1.0), Sampling(1000.0), 1e4)
        stops[0] = False
        wanted.clear()
        assert len(simulate(plant, GAINS, LIMITS, Step(1.0), Sampling(100.0), 0.5).time_s) == 51


@pytest.mark.slow
@needs_compiler
@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX; a console interrupt cannot be sent to one child there")
@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM", "SIGHUP", None])
def test_tune_outlives_a_late_crash_hears_an_interrupt_during_a_hang_and_keeps_what_is_complete(
    tmp_path, temporary, number
):
    fmu = foreign_fmu(tmp_path / "late.fmu", hostile="hang" if number else "crash", after=30_000)
    words = [sys.executable, "-m", "bender_cli", "tune", "--fmu", str(fmu), "--objective", "itae", "--setpoint", "2"]
    words += ["--evaluations", "100000", "--out", "out"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(words, cwd=tmp_path, env=os.environ | {"TMPDIR": str(temporary)}, **pipes) as process:
        if number:
            # gains are there, and the FMU hangs soon: on a busy machine the start takes longer than any wait
            assert process.stderr is not None
            assert any(", best " in line for line in process.stderr)
            time.sleep(3.0)
            process.send_signal(getattr(signal, number))
        begun_s = time.monotonic()
        out, errors = process.communicate(timeout=120)
        assert not number or time.monotonic() - begun_s < 15.0
    assert process.returncode == (130 if number else 1), errors
    (said,) = (line for line in errors.splitlines() if line.startswith("bender:"))
    assert ("interrupted" if number else "SIGSEGV") in said
    assert (tmp_path / "out" / "gains.toml").is_file()
    status = json.loads((tmp_path / "out" / "tuning.json").read_text(encoding="utf-8"))["status"]
    assert status == ("interrupted" if number else "failed")
    assert out.count("native code") == 1


KILLED = """
import sys, tempfile
from bender_loop.fmu.process.watched import WatchedPlant
# a script that is not written for being run twice
tempfile.tempdir = sys.argv[2]
plant = WatchedPlant(sys.argv[1], input_name="u", output_name="y")
print(plant._process.pid, flush=True)
sys.stdin.read()
"""


@pytest.mark.skipif(os.name == "nt", reason="kills with a signal of POSIX")
def test_nothing_is_left_of_it_when_the_process_in_front_is_killed(lag_fmu, temporary, tmp_path):
    script = tmp_path / "killed.py"
    script.write_text(KILLED, encoding="utf-8")
    words = [sys.executable, str(script), str(lag_fmu), str(temporary)]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as front:
        assert front.stdout is not None
        worker = int(front.stdout.readline())
        assert len(list(temporary.iterdir())) == 1
        front.send_signal(signal.SIGKILL)
        front.wait(10.0)
    end = time.monotonic() + 20.0
    while time.monotonic() < end and (list(temporary.iterdir()) or Path(f"/proc/{worker}").exists()):
        time.sleep(0.05)
    assert not list(temporary.iterdir())
