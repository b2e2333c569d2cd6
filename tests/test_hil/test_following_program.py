"""A run that follows a model: its commands come about again from its log, whenever they acted."""

import shutil
from pathlib import Path

import pytest
from following_controllers import PERIOD_S, late, tuned_on
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bender_export.build import build_plant_fmu
from bender_hil.log.journal import Journal
from bender_hil.log.replay import replay_run
from bender_hil.runner.following_program import following
from bender_hil.runner.loop import command_delay_s
from bender_hil.runner.program import ClosedLoop
from bender_loop.control.references import Step

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


@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
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
