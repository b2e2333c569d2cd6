from dataclasses import replace

import numpy as np
import pytest

from bender_identify.records.experiment import experiment_of
from bender_identify.records.voltage_path import acting_voltage, drive_of, even_times
from bender_identify.settings import Settings
from bender_loop.errors import InputError
from bender_loop.records.record import Record

TIME = even_times(0.05, 400)
SINE = np.sin(np.pi * TIME)
RISING = Record(TIME, SINE, 2.0 * SINE)
SHIFTED = Record(TIME, np.sin(np.pi * TIME + 1.0), 2.0 * np.sin(np.pi * TIME + 1.0))


def test_the_end_of_a_record_is_held_out() -> None:
    made = experiment_of(RISING, "a", Settings(held_out_share=0.25))
    assert not np.any(made.fitted & made.held_out)
    assert np.all(made.fitted | made.held_out)
    assert made.fitted[:300].all()
    assert made.held_out[300:].all()
    assert made.fitting_all().fitted.all()
    assert made.holding_out_all().held_out.all()


def test_the_first_cycle_is_set_aside_where_the_record_starts_with_a_step() -> None:
    made = experiment_of(SHIFTED, "a", Settings())
    counted = made.fitted | made.held_out
    assert not counted[:39].any()
    assert counted[42:].all()
    assert not (experiment_of(SHIFTED, "a", Settings(set_aside_s=5.0)).fitted[:100]).any()


def test_a_record_from_rest_keeps_its_first_reading_and_one_in_motion_does_not() -> None:
    at_rest = SHIFTED.displacement_um.copy()
    at_rest[0] = 0.0
    made = experiment_of(replace(SHIFTED, displacement_um=at_rest), "a", Settings())
    assert not made.in_motion
    assert made.fitted[0]
    moving = experiment_of(SHIFTED, "a", Settings())
    assert moving.in_motion
    assert moving.lead_rows == 399
    assert not moving.fitted[0]


def test_lost_frames_are_not_counted() -> None:
    lost = RISING.displacement_um.copy()
    lost[[5, 200, 399]] = np.nan
    made = experiment_of(replace(RISING, displacement_um=lost), "a", Settings())
    assert np.flatnonzero(~(made.fitted | made.held_out)).tolist() == [5, 200, 399]


def test_too_few_readings_are_refused() -> None:
    with pytest.raises(InputError, match="12 readings in 12 rows, expected at least 20"):
        experiment_of(Record(TIME[:12], SINE[:12], SINE[:12]), "a", Settings())
    with pytest.raises(InputError, match="left after what is set aside"):
        experiment_of(RISING, "a", Settings(set_aside_s=19.5))


def test_a_held_voltage_acts_one_row_late_and_a_straight_one_at_once() -> None:
    assert acting_voltage(RISING, "hold").tolist() == [0.0, *SINE[:-1]]
    assert acting_voltage(RISING, "linear").tolist() == SINE.tolist()


def test_a_smooth_voltage_goes_through_the_rows_and_its_true_turning_points() -> None:
    drive, lead = drive_of(RISING, "smooth", None, in_motion=False)
    assert lead == 0
    assert np.interp(TIME, drive.command_time_s, drive.voltage_V) == pytest.approx(SINE, abs=1e-12)
    off = np.abs(np.sin(np.pi * drive.command_time_s) - drive.voltage_V)
    inner = (drive.command_time_s > TIME[3]) & (drive.command_time_s < TIME[-4])
    # what comes before the first row and after the last one is not known
    assert off[inner].max() < 1e-4
    assert off.max() < 1e-3
    assert drive.voltage_V.max() == pytest.approx(1.0, abs=1e-5)
    apart = Record(TIME, np.sin(2.9 * TIME), SINE)
    assert drive_of(apart, "smooth", None, False)[0].voltage_V.max() == pytest.approx(1.0, abs=1e-4)


def test_an_untimed_record_is_read_after_its_voltage() -> None:
    made = experiment_of(RISING, "a", Settings(), untimed=True)
    assert made.acting_V.tolist() == SINE.tolist()
    assert np.all(made.drive.row_time_s[1:] > made.drive.command_time_s)
    assert np.all(made.drive.row_time_s[1:-1] < made.drive.command_time_s[1:])
    assert not made.timed
