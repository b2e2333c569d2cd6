"""When a tick is late: one period after its reading is complete, by the log of the run and by the bench file."""

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_hil.bench_file import BenchFile, CameraTable
from bender_hil.log.read_run import RunLog
from bender_hil.log.summary import summarise
from bender_hil.sensors.daq_input import DaqInputSettings
from bender_hil.sensors.multimeter import MultimeterSettings
from bender_hil.sensors.table import SensorTable
from bender_hil.sensors.text_line import TextLineSettings
from bender_studies.bench_trials.kilohertz import complete_to_command_ms


def _log(period_s: float, averaged_s: float, delays_s: list[float]) -> RunLog:
    """A run whose commands are on the wire so long after their readings are complete."""
    ticks, guard = [], []
    for k, delay_s in enumerate(delays_s):
        grabbed_s = 100.0 + k * period_s
        sent_s = grabbed_s + 0.5 * averaged_s + delay_s
        ticks.append(
            {"kind": "tick", "sequence": k, "grabbed_s": grabbed_s, "sent_s": sent_s, "skipped": 0, "measured_um": 1.0,
             "late": False}
        )  # fmt: skip
        guard.append({"kind": "applied", "sequence": k, "command_time_s": sent_s, "whole": True, "t": sent_s})
    start = {
        "emulated": True, "period_s": period_s, "exposure_s": averaged_s, "deadline_s": period_s + 0.5 * averaged_s,
    }  # fmt: skip
    return RunLog(Path(), start, tuple(ticks), (), tuple(guard))


@given(
    period_s=st.floats(1e-3, 0.1),
    averaged=st.floats(0.0, 1.0),
    shares=st.lists(st.floats(0.0, 3.0).filter(lambda x: abs(x - 1.0) > 1e-3), min_size=2, max_size=20),
)
def test_what_is_averaged_makes_no_tick_late(period_s: float, averaged: float, shares: list[float]):
    log = _log(period_s, averaged * period_s, [share * period_s for share in shares])
    assert summarise(log).late == sum(share > 1.0 for share in shares)
    found_ms = complete_to_command_ms(log)
    assert found_ms == pytest.approx([1e3 * share * period_s for share in shares], abs=1e-6)


def test_a_run_of_an_earlier_version_counts_its_period():
    log = _log(0.01, 0.0, [0.005, 0.015])
    start = {name: value for name, value in log.start.items() if name != "deadline_s"}
    assert summarise(replace(log, start=start)).late == 1


@pytest.mark.parametrize(
    ("table", "averaged_s"),
    [
        (SensorTable("daq", DaqInputSettings("Dev1"), 1000.0), 1e-3),
        (SensorTable("daq", DaqInputSettings("Dev1"), 1000.0, exposure_s=2e-4), 2e-4),
        (SensorTable("multimeter", MultimeterSettings("ASRL1::INSTR", aperture_s=0.02), 30.0), 0.02),
        (SensorTable("text", TextLineSettings("ASRL1::INSTR"), 30.0), None),
    ],
)
def test_the_deadline_of_a_sensor_is_a_period_after_half_of_what_it_averages(
    table: SensorTable, averaged_s: float | None
):
    assert table.averaged_s == averaged_s
    assert BenchFile(sensor=table).deadline_s == pytest.approx(1.0 / table.rate_Hz + 0.5 * (averaged_s or 0.0))


def test_the_deadline_of_a_camera_is_its_period():
    assert BenchFile(camera=CameraTable(frames_per_s=50.0, exposure_s=0.01)).deadline_s == pytest.approx(0.02)
