"""A slice of the fault matrix: every kind of fault in every state. `bender benchmark hil --faults` runs all of it."""

import os
from pathlib import Path

import pytest

from bender_studies.bench_trials.fault_matrix import FAULTS, STATES, cells, run_cell
from bender_studies.bench_trials.matrix import run_matrix

pytest.importorskip("pyvisa_py")

# what no supply answers to, or does not obey, cannot be confirmed
NEVER_CONFIRMED = ("a byte every 100 ms", "output stuck on", "answers one question late", "instrument hangs")
CONFIRMED = ("one answer missing", "link drops", "protection trips", "local key pressed", "answers 30 ms late")
OTHERS = ("voltage reads 30 V", "mains dip", "settings without effect")
LOST = [
    ("SIGQUIT to the terminal", "holding"), ("SIGTSTP to the terminal", "holding"), ("disk full", "holding"),
    ("SIGSTOP to the controller", "descending"), ("controller floods the guard", "holding"),
    ("guard and 1 spare killed", "holding"),
]  # fmt: skip


@pytest.fixture(scope="module")
def fmu() -> Path:
    from bender_export.build import ensure_plant_fmu

    return ensure_plant_fmu("bench")


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
    from bender_studies.bench_trials.process_faults import process_faults, run_process_cell

    everything = process_faults()
    assert len({fault for fault, _ in everything}) >= 40
    assert set(LOST) <= set(everything)
    found = run_matrix(LOST, run_process_cell, fmu, tmp_path, at_once=4)
    assert [cell for cell in found if cell.broken] == []
    assert {cell.outcome for cell in found} <= {"off", "alarm"}
