"""A run that follows a model: its commands come about again, from its log and in every other place that runs it."""

import shutil
from argparse import Namespace
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from following_controllers import PERIOD_S, late, tuned_on
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from native_hosts import needs_own_compiler

from bender_export.build import build_plant_fmu
from bender_export.following import FOLLOWING_FMU, Host, build_following, followed_equations, following_settings
from bender_hil.bench_file import emulated_bench
from bender_hil.command import followed
from bender_hil.log.journal import Journal
from bender_hil.log.replay import replay_run
from bender_hil.runner.following_program import FollowingLoop, extrapolation, following
from bender_hil.runner.loop import command_delay_s
from bender_hil.runner.program import ClosedLoop
from bender_loop.control.references import Profile, Reference, Step
from bender_loop.control.sampling import Sampling
from bender_loop.control.trace import Trace
from bender_loop.fmu.controller import FmuController
from bender_loop.fmu.file import beyond_learned
from bender_loop.fmu.followed_model import Loop
from bender_loop.fmu.follower import Follower
from bender_loop.fmu.plant import FmuPlant
from bender_native.build import Way, native_following_fmu
from bender_native.compilers import own_platform
from bender_plant.model import load_model
from bender_plant.valid_range import ValidRange
from bender_tuner.task.experiment import StepExperiment
from bender_tuner.task.following import Following

DELAY_S = 0.002


@pytest.fixture(scope="module")
def model_fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_plant_fmu(late(), tmp_path_factory.mktemp("followed") / "model.fmu")


def run_of(fmu: Path, folder: Path, sent_s: list[float]) -> list[float]:
    """Write the log of a run whose commands went out so long after their frames; returns the commands."""
    tuned = tuned_on(fmu)
    plain = ClosedLoop(Step(10.0, time_s=0.05), tuned.gains, tuned.limits, 800.0, 1.0)
    commands, journal = [], Journal(folder / "run.jsonl")
    with following(plain, tuned.model, fmu, 1.0 / PERIOD_S, preview=False) as program:
        program.keep(folder)
        journal.write("start", program=program.facts(), emulated=True, delay_s=DELAY_S, period_s=PERIOD_S)
        for k, wait_s in enumerate(sent_s):
            grabbed_s = 5.0 + PERIOD_S * k
            decision = program.decide(PERIOD_S * k, PERIOD_S, 0.3 * k)
            program.acted(command_delay_s(grabbed_s, grabbed_s + wait_s, DELAY_S))
            journal.write(
                "tick", sequence=k, grabbed_s=grabbed_s, time_s=PERIOD_S * k, dt_s=PERIOD_S, measured_um=0.3 * k,
                setpoint_um=decision.setpoint_um, command_V=decision.voltage_V, aim_um=decision.aim_um,
                sent_s=grabbed_s + wait_s,
            )  # fmt: skip
            commands.append(decision.voltage_V)
    journal.close()
    (folder / "guard.jsonl").touch()
    return commands


@settings(max_examples=5, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.floats(1e-4, 0.03), min_size=12, max_size=12))
def test_a_replay_gives_the_same_bits_whenever_commands_acted(model_fmu: Path, tmp_path: Path, sent_s: list[float]):
    folder = tmp_path / "run"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    run_of(model_fmu, folder, sent_s)
    replayed = replay_run(folder)
    assert (replayed.ticks, replayed.different) == (len(sent_s), 0)


def test_the_models_know_when_a_command_acted(model_fmu: Path, tmp_path: Path):
    runs = []
    for name, sent_s in (("soon", 0.001), ("late", 0.015)):
        (tmp_path / name).mkdir()
        runs.append(run_of(model_fmu, tmp_path / name, [sent_s] * 12))
    assert runs[0] != runs[1]


@pytest.fixture(scope="module")
def learned_fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model that was learned below 8 V, where the tip is at some 7 µm."""
    model = replace(load_model("paper"), valid=ValidRange(0.0, 8.0, 60.0))
    return build_plant_fmu(model, tmp_path_factory.mktemp("learned") / "model.fmu")


@pytest.mark.parametrize(
    ("reference", "said"),
    [(Step(4.0), ""), (Step(12.0), "15.86"), (Profile((0.0, 0.3, 0.6), (2.0, 12.0, 4.0)), "15.86")],
)
def test_a_set_point_beyond_what_the_model_was_learned_from_is_said_beforehand(
    learned_fmu: Path, reference: Reference, said: str, capsys: pytest.CaptureFixture[str]
):
    tuned = tuned_on(learned_fmu)
    plain = ClosedLoop(reference, tuned.gains, tuned.limits, 800.0, 1.0)
    asked = Namespace(gains=learned_fmu.with_name("gains.toml"), profile=None)
    with followed(asked, emulated_bench(), plain, lambda _: tuned.model) as program:
        told = capsys.readouterr().err
        first = program.decide(0.0, PERIOD_S, 0.0)
    assert told.startswith("note: this takes a command of " if said else "")
    assert (f" {said}" in told and "V, the model was learned from 0 to 8 V: beyond" in told) == bool(said)
    with following(plain, tuned.model, learned_fmu, 30.0, preview=False) as again:
        assert again.decide(0.0, PERIOD_S, 0.0) == first, "the look beforehand leaves nothing behind"


def test_of_a_model_that_does_not_say_where_it_was_learned_nothing_is_said(model_fmu: Path):
    tuned = tuned_on(model_fmu)
    plain = ClosedLoop(Step(30.0), tuned.gains, tuned.limits, 800.0, 1.0)
    with following(plain, tuned.model, model_fmu, 30.0, preview=False) as program:
        assert extrapolation(program) == ""


@given(st.lists(st.floats(-100.0, 100.0), min_size=1), st.floats(-50.0, 0.0), st.floats(1.0, 50.0))
def test_only_commands_outside_of_what_was_learned_are_said(commands: list[float], low: float, high: float):
    said = beyond_learned(commands, (low, high), "V")
    outside = [x for x in commands if not low - 1e-3 <= x <= high + 1e-3]
    assert bool(said) or not outside
    assert not (said and all(low <= x <= high for x in commands))
    assert beyond_learned(commands, None, "V") == beyond_learned([], (low, high), "V") == ""


@pytest.fixture(scope="module")
def tuners_run(model_fmu: Path) -> Trace:
    """A step as `bender tune` runs it; readings in halves of a µm go to metres and back without rounding."""
    tuned = tuned_on(model_fmu)
    with closing(FmuPlant(model_fmu)) as plant:
        sampling = Sampling(1.0 / PERIOD_S, noise_um=0.5, quantum_um=0.5)
        experiment = StepExperiment(plant, tuned.limits, 10.0, sampling, 1.0)
        trace = experiment.run(tuned.gains, Following(tuned.model, model_fmu))
    assert len(set(trace.voltage_V)) > 30
    return trace


def test_the_bench_commands_what_the_tuner_did_on_the_same_readings(model_fmu: Path, tuners_run: Trace):
    tuned = tuned_on(model_fmu)
    loop = Loop(PERIOD_S, tuned.limits, tuned.model.slew_V_per_s)
    with Follower(model_fmu, tuned.model, tuned.gains, loop) as follower:
        program = FollowingLoop(Step(10.0), follower, tuned.gains, tuned.model, model_fmu, loop, 1.0)
        rows = zip(tuners_run.time_s, tuners_run.measured_um, strict=True)
        assert [program.decide(t, PERIOD_S, y).voltage_V for t, y in rows] == tuners_run.voltage_V.tolist()


@pytest.mark.parametrize("native", [False, pytest.param(True, marks=needs_own_compiler)])
def test_the_controller_as_an_fmu_does_too(native: bool, model_fmu: Path, tuners_run: Trace, tmp_path: Path):
    tuned = tuned_on(model_fmu)
    if native:
        equations, own = followed_equations(tuned.model, model_fmu), own_platform()
        assert own is not None
        made = native_following_fmu(following_settings(tuned, equations, Host()), equations, Way(2, (own,)))
        (tmp_path / FOLLOWING_FMU).write_bytes(made)
    else:
        build_following(tuned, model_fmu, tmp_path)
    with FmuController(tmp_path / FOLLOWING_FMU, PERIOD_S) as controller:
        rows = zip(tuners_run.setpoint_um, tuners_run.measured_um, strict=True)
        assert [controller.step(r, y, PERIOD_S) for r, y in rows] == tuners_run.voltage_V.tolist()
