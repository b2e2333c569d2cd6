"""The fault matrix: a slice among the slow tests, every fault in every state by `pytest -m trial tests/test_hil`."""

import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from bench_trials import fault_matrix
from bench_trials.fault_matrix import FAULTS, STATES, Cell, cells, follow_model, judged, run_cell
from bench_trials.matrix import Run, run_matrix
from following_controllers import tuned_on

from bender_loop.control.plant import restart
from bender_loop.fmu.plant import FmuPlant
from bender_tuner.results.gains_file import write_gains

pytest.importorskip("pyvisa_py")

_TEN_V = 10.0
# what no supply answers to, or does not obey, cannot be confirmed
NEVER_CONFIRMED = ("a byte every 100 ms", "output stuck on", "answers one question late", "instrument hangs")
CONFIRMED = ("one answer missing", "link drops", "protection trips", "local key pressed", "answers 30 ms late")
OTHERS = ("voltage reads 30 V", "mains dip", "settings without effect")
LOST = [
    ("SIGQUIT to the terminal", "holding"), ("SIGTSTP to the terminal", "holding"), ("disk full", "holding"),
    ("SIGSTOP to the controller", "descending"), ("no memory left", "rising"),
    ("guard killed, no memory left", "holding"), ("standard output closed, output stuck on", "holding"),
    ("controller floods the guard", "holding"),
    ("guard and 1 spare killed", "holding"),
]  # fmt: skip


@pytest.fixture(scope="module")
def fmu() -> Path:
    from bender_export.build import ensure_plant_fmu

    return ensure_plant_fmu("bench")


def shown_after(fmu: Path, voltage_V: float, time_s: float) -> float:
    plant = FmuPlant(fmu)
    try:
        restart(plant)
        return [plant.step(voltage_V, 0.02) for _ in range(round(time_s / 0.02))][-1]
    finally:
        plant.close()


def test_the_matrix_is_large():
    assert len(FAULTS) >= 50
    assert len(cells()) >= 250


@pytest.mark.slow
def test_every_kind_of_fault_of_the_supply_ends_with_the_output_off_or_the_alarm(fmu: Path, tmp_path: Path):
    states = {state: () for state in STATES} | {"rising": OTHERS, "holding": (*NEVER_CONFIRMED, *CONFIRMED)}
    states["descending"] = (*NEVER_CONFIRMED, "link drops")
    states["armed"] = states["opening"] = ("one answer missing", "output stuck on")
    pairs = [(fault, state) for state in STATES for fault in states[state]]
    found = run_matrix(pairs, run_cell, fmu, tmp_path, at_once=4)
    assert [cell for cell in found if cell.broken] == []
    outcomes = {cell.fault: cell.outcome for cell in found if cell.state == "holding"}
    assert {outcomes[fault] for fault in NEVER_CONFIRMED} == {"alarm"}
    # a busy machine may turn a late answer into none; most of what can be confirmed is
    assert [outcomes[fault] for fault in CONFIRMED].count("off") >= len(CONFIRMED) - 1


@pytest.mark.slow
@pytest.mark.skipif(not os.path.exists("/proc/self/stat"), reason="reads the kernel's table of processes")
def test_every_kind_of_lost_process_ends_with_the_output_off_or_the_alarm(fmu: Path, tmp_path: Path):
    from bench_trials.process_faults import process_faults, run_process_cell

    everything = process_faults()
    assert len({fault for fault, _ in everything}) >= 40
    assert set(LOST) <= set(everything)
    found = run_matrix(LOST, run_process_cell, fmu, tmp_path, at_once=4)
    assert [cell for cell in found if cell.broken] == []
    assert {cell.outcome for cell in found} <= {"off", "alarm"}


@pytest.fixture(scope="module")
def following(fmu: Path, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Cells whose controller follows the model of the bench."""
    folder = tmp_path_factory.mktemp("following")
    tuned, path = tuned_on(fmu), folder / "gains.toml"
    (folder / tuned.model.fmu).write_bytes(fmu.read_bytes())
    write_gains(path, tuned.gains, tuned.limits, tuned.period_s, tuned.model)
    um_per_V = shown_after(fmu, _TEN_V, 2.0) / _TEN_V
    return partial(run_cell, words_of=partial(follow_model, gains=path, um_per_V=um_per_V))


@pytest.mark.slow
def test_a_run_that_follows_a_model_ends_with_the_output_off_or_the_alarm_too(
    following: Run, fmu: Path, tmp_path: Path
):
    pairs = [(fault, "holding") for fault in (*NEVER_CONFIRMED, *CONFIRMED, *OTHERS)]
    pairs += [("no answers", "rising"), ("link drops", "descending"), ("output stuck on", "armed")]
    found = run_matrix(pairs, following, fmu, tmp_path, at_once=4)
    assert [cell for cell in found if cell.broken] == []
    assert {cell.outcome for cell in found if cell.fault in NEVER_CONFIRMED} == {"alarm"}


@pytest.mark.trial
@pytest.mark.parametrize("fault", FAULTS)
def test_any_fault_of_the_supply_ends_a_run_that_follows_a_model_so_too(
    fault: str, following: Run, fmu: Path, tmp_path: Path
):
    found = run_matrix([(fault, state) for state in STATES], following, fmu, tmp_path)
    assert [cell for cell in found if cell.broken] == []


@pytest.mark.trial
@pytest.mark.parametrize("fault", FAULTS)
def test_any_fault_of_the_supply_in_any_state_ends_with_the_output_off_or_the_alarm(
    fault: str, fmu: Path, tmp_path: Path
):
    found = run_matrix([(fault, state) for state in STATES], run_cell, fmu, tmp_path)
    assert [cell for cell in found if cell.broken] == []


@pytest.mark.trial
@pytest.mark.skipif(not os.path.exists("/proc/self/stat"), reason="reads the kernel's table of processes")
@pytest.mark.parametrize("state", STATES)
def test_any_lost_process_ends_with_the_output_off_or_the_alarm(state: str, fmu: Path, tmp_path: Path):
    from bench_trials.process_faults import process_faults, run_process_cell

    found = run_matrix([x for x in process_faults() if x[1] == state], run_process_cell, fmu, tmp_path)
    assert [cell for cell in found if cell.broken] == []


class Ended:
    """A run that is over: what it printed, and whether it gave an alarm."""

    def __init__(self, alarmed_s: float | None = None) -> None:
        self.alarmed_s = alarmed_s

    def printed(self) -> str:
        return "ended by a rule (heartbeat): no command for 30 s; output off\n"

    def said(self) -> str:
        return "" if self.alarmed_s is None else "OUTPUT STATE UNKNOWN\n"


def outcome(
    monkeypatch: pytest.MonkeyPatch, folder: Path, state: str, volts: Sequence[float], *, armed: bool = True
) -> Cell:
    entries = [{"kind": "armed", "t": 1.0}] if armed else []
    entries += [{"kind": "applied", "t": 2.0 + k, "voltage_V": x} for k, x in enumerate(volts)]
    monkeypatch.setattr(fault_matrix, "journal_of", lambda *_: entries)
    truth = {"is_on": False, "output_V": 0.0}
    empty = Cell("SIGSTOP to the terminal", state, "", None, "")
    run: Any = Ended()
    return judged(empty, run, 1, folder, truth, 33.0, 1.5, journal=lambda _: [])


def test_where_no_voltage_was_applied_nothing_has_to_be_switched_off_in_time(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    assert outcome(monkeypatch, tmp_path, "opening", []).broken == ""
    assert outcome(monkeypatch, tmp_path, "armed", [0.0]).broken == ""
    assert outcome(monkeypatch, tmp_path, "armed", [0.0, 10.0]).seconds == pytest.approx(30.0)
    assert "30.00 s" in outcome(monkeypatch, tmp_path, "armed", [0.0, 10.0]).broken
    assert "31.50 s" in outcome(monkeypatch, tmp_path, "holding", [10.0]).broken


def test_a_run_whose_journal_was_taken_away_had_begun(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    assert outcome(monkeypatch, tmp_path / "gone", "rising", [], armed=False).outcome == "off"
    (tmp_path / "file").touch()
    assert outcome(monkeypatch, tmp_path / "file", "rising", [], armed=False).outcome == "off"
    assert "did not begin" in outcome(monkeypatch, tmp_path, "rising", [], armed=False).broken
    assert outcome(monkeypatch, tmp_path / "gone", "opening", [], armed=False).outcome == "refused"
