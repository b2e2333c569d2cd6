"""The guard's first contact: who is at the address, who else is, over which line, and what a supply cannot do."""

import os
import time
from dataclasses import replace
from pathlib import Path

import pytest
from emulated_bench import QUICK, assert_off, drive, emulated_supply, orders
from few import few

from bender_emulator.start import EmulatedSupply
from bender_hil.guard.guard import Status
from bender_hil.guard.start import GuardProcess
from bender_loop.errors import RunError

pytest.importorskip("pyvisa_py")


def test_a_supply_without_commands_is_looked_after_too(supply: EmulatedSupply, tmp_path: Path):
    guard = GuardProcess(orders(supply.resource, tmp_path))
    supply.fault("ovp_trip")
    ended = guard.wait()
    assert (ended.status, ended.code) == (Status.TRIPPED, "output_off")
    assert_off(supply)


def test_a_second_client_is_turned_away_and_harms_nobody(supply: EmulatedSupply, tmp_path: Path):
    first = GuardProcess(orders(supply.resource, tmp_path, replace(QUICK, heartbeat_s=5.0, frame_age_s=5.0)))
    drive(first, 5)
    (tmp_path / "second").mkdir()
    with pytest.raises(RunError, match="is nothing else connected"):
        GuardProcess(orders(supply.resource, tmp_path / "second"))
    first.command(99, 5.0, time.perf_counter(), 0.0)
    first.stop()
    assert first.wait().status is Status.DONE


@pytest.mark.skipif(os.name == "nt", reason="no pseudo-terminals")
@pytest.mark.parametrize("model", few(["9115", "XLN8018"], 0))
def test_the_same_over_a_serial_line(tmp_path: Path, model: str):
    with emulated_supply(tmp_path, "pty", model) as supply:
        guard = GuardProcess(orders(supply.resource, tmp_path, model=model))
        drive(guard, 12)
        assert supply.truth()["target_V"] > 20.0
        supply.fault("drop_link")
        drive(guard, 12)
        ended = guard.wait()
        assert (ended.status, ended.code) == (Status.TRIPPED, "supply")
        assert_off(supply)
