"""A record beside its replay: figures, the overlay, sensors whose zero moved."""

import io
import math

import numpy as np
import pytest
from few import few_rows
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from matplotlib.axes import Axes
from PIL import Image
from scipy.signal import lfilter

from bender_loop.errors import InputError
from bender_loop.records.compare import Recalibration, agreement, compare, recalibrate
from bender_loop.records.record import Record
from bender_loop.records.replay import RESTING_UM, replay
from bender_loop.records.zero_move import without_zero_move, zero_move
from bender_report.chart import MOST_POINTS, thinned
from bender_report.record_overlay import SHOWN_REVERSALS, Overlay, draw_overlay, overlay_figure, reversals, window
from bender_report.wording import shown_in

READINGS = hnp.arrays(np.float64, st.integers(5, 40), elements=st.floats(-50, 50, width=32))


def test_hand_numbers():
    measured, simulated = np.array([0.0, 2.0, 4.0]), np.array([1.0, 2.0, 3.0])
    result = compare(measured, simulated)
    assert result.before.rms_um == pytest.approx(math.sqrt(2 / 3))
    assert result.before.nrmse_percent == pytest.approx(100 * math.sqrt(2 / 3) / 4)
    assert result.before.fit_percent == pytest.approx(100 * (1 - math.sqrt(2) / math.sqrt(8)))
    assert (result.recalibration.gain, result.recalibration.offset_um) == pytest.approx((2.0, -2.0))
    assert result.recalibrated.rms_um == pytest.approx(0.0, abs=1e-12)
    assert result.recalibrated.fit_percent == pytest.approx(100.0)


@given(READINGS, READINGS)
def test_recalibration_is_the_line_of_polyfit_and_never_widens_the_gap(measured, simulated):
    size = min(measured.size, simulated.size)
    measured, simulated = measured[:size], simulated[:size]
    result = compare(measured, simulated)
    assert result.recalibrated.rms_um <= result.before.rms_um * (1 + 1e-9) + 1e-9
    if np.ptp(simulated) > 0.1:
        line = recalibrate(measured, simulated)
        expected = tuple(np.polyfit(simulated, measured, 1))
        assert (line.gain, line.offset_um) == pytest.approx(expected, rel=1e-6, abs=1e-6)


@given(READINGS, st.floats(-1e3, 1e3), st.floats(0.01, 100))
def test_gain_and_offset_of_the_simulation_leave_the_recalibrated_gap_alone(simulated, offset_um, gain):
    rows = np.arange(simulated.size)
    measured = 0.8 * simulated + np.sin(rows)
    # A gain can only be undone where rounding leaves enough of the signal.
    if np.ptp(simulated) < 0.1:
        return
    plain = compare(measured, simulated).recalibrated.rms_um
    bent = compare(measured, gain * simulated + offset_um).recalibrated.rms_um
    assert bent == pytest.approx(plain, rel=1e-6, abs=1e-6)


def test_lost_frames_are_left_out():
    measured, simulated = np.array([0.0, np.nan, 2.0, 4.1]), np.array([0.1, 1e9, 2.0, 4.0])
    result = compare(measured, simulated)
    seen = [0, 2, 3]
    assert (result.rows, result.lost_rows) == (4, 1)
    assert result.before == agreement(measured[seen], simulated[seen])


def test_constant_signals_leave_undefined_figures_undefined():
    flat = np.full(5, 3.0)
    result = compare(flat, np.arange(5.0))
    assert result.before.nrmse_percent is None
    assert result.before.fit_percent is None
    assert result.recalibrated.rms_um == pytest.approx(0.0, abs=1e-12)
    still = compare(np.arange(5.0), flat)
    assert (still.recalibration.gain, still.recalibration.offset_um) == (1.0, -1.0)


@pytest.mark.parametrize(
    ("simulated", "error", "message"),
    [(np.arange(4.0), InputError, "2 readings in 4 rows"), (np.arange(5.0), ValueError, "shapes differ")],
)
def test_too_few_readings_and_other_shapes_are_refused(simulated, error, message):
    with pytest.raises(error, match=message):
        compare(np.array([1.0, np.nan, 2.0, np.nan]), simulated)


def _overlay(rows: int, offset_um: float = 0.0) -> Overlay:
    time_s = np.arange(rows) / 30
    voltage_V = 25 + 25 * np.sin(time_s)
    measured_um = 0.47 * voltage_V + offset_um
    if rows > 10:
        measured_um[4] = np.nan
    return Overlay("record over model", time_s, "time (s)", voltage_V, measured_um, 0.5 * voltage_V)


@pytest.mark.parametrize(
    ("rows", "offset_um", "height"), few_rows([(3, 0.0, 770), (200, 0.0, 770), (20_000, -120.0, 1100)], 2)
)
def test_picture_is_a_png_of_a_fixed_size_with_something_in_it(rows: int, offset_um: float, height: int):
    overlay = _overlay(rows, offset_um)
    png = draw_overlay(overlay, compare(overlay.measured_um, overlay.simulated_um))
    image = np.asarray(Image.open(io.BytesIO(png)).convert("L"))
    # many swings have a panel more: the worst of them
    assert image.shape == (height, 1320)
    assert 0.005 < (image < 200).mean() < 0.5


@pytest.mark.parametrize(("units", "word"), [(("W", "K"), "input"), (("V", "um"), "voltage")])
def test_titles_of_the_picture_call_the_command_what_it_is(
    units: tuple[str, str], word: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    titles: list[str] = []
    monkeypatch.setattr(Axes, "set_title", lambda _axes, text, **_how: titles.append(text))
    overlay = _overlay(200)
    with shown_in(*units):
        draw_overlay(overlay, compare(overlay.measured_um, overlay.simulated_um))
    assert {f"over the acting {word}", f"the same over the {word}"} <= set(titles)


def test_measured_points_lie_on_top_of_the_model_and_both_simulations_are_seen() -> None:
    overlay = _overlay(5_000)
    figure = overlay_figure(overlay, compare(overlay.measured_um, overlay.simulated_um))
    axes = [x for x in figure.axes if x.get_ylabel() == "displacement (µm)"]
    assert len(axes) == 3
    for x in axes:
        points = [line.get_zorder() for line in x.lines if line.get_marker() == "."]
        assert points
        assert min(points) > max(line.get_zorder() for line in x.lines if line.get_marker() != ".")
    # also where the recalibration changes nothing, so that one lies over the other
    (legended,) = (x for x in axes if x.get_legend() is not None)
    lines = {x.get_label(): x for x in legended.lines}
    given, recalibrated = lines["simulated, as given"], lines["simulated, recalibrated"]
    assert given.get_zorder() > recalibrated.get_zorder()
    assert (given.get_linestyle(), recalibrated.get_linestyle()) == ("--", "-")


def test_an_offset_of_rounding_is_told_as_none() -> None:
    measured = np.array([0.0, 2.0, 4.0, 1.0])
    assert Recalibration(1.0, 1e-15).offset_told_um(0.1) == 0.0
    assert compare(measured, measured - 0.3).recalibration.offset_told_um(0.3) == pytest.approx(0.3)


def test_reversals_of_a_triangle_are_its_corners():
    triangle = np.concatenate([np.arange(0, 10), np.arange(10, 0, -1), np.arange(0, 11)]).astype(float)
    assert reversals(triangle).tolist() == [10, 20]


@given(st.floats(-100, 100), st.floats(0.01, 100), st.booleans())
def test_reversals_do_not_depend_on_shift_scale_or_sign(shift, scale, mirrored):
    signal = np.random.default_rng(5).normal(size=50).cumsum()
    bent = shift + (-scale if mirrored else scale) * signal
    assert reversals(bent).tolist() == reversals(signal).tolist()


def test_a_window_shows_all_of_a_short_record():
    rows = np.arange(4_000)
    assert window(np.sin(rows / 400), np.ones(4_000)) == slice(0, 4_000)


@pytest.mark.parametrize("strays", [False, True])
def test_a_window_shows_the_worst_swings_of_a_long_record_whatever_strays_and_is_lost(strays: bool):
    rows = np.arange(4_000)
    residual = np.where((rows > 1_500) & (rows < 1_700), 1.0, 0.1)
    if strays:
        residual[3_000] = 1e3
        residual[200:900:3] = np.nan
    sine = np.sin(rows / 10)
    shown = window(sine, residual)
    assert np.count_nonzero((reversals(sine) >= shown.start) & (reversals(sine) < shown.stop)) == SHOWN_REVERSALS + 1
    assert shown.start <= 1_500
    assert shown.stop >= 1_700


@given(st.integers(1, 50_000), st.integers(0, 2**32 - 1))
def test_thinning_keeps_the_extremes(size, seed):
    signal = np.random.default_rng(seed).normal(size=size)
    rows = thinned(signal)
    assert rows.size <= max(MOST_POINTS, 1)
    assert np.all(np.diff(rows) > 0)
    assert (signal[rows].min(), signal[rows].max()) == (signal.min(), signal.max())


def answering(rng: np.random.Generator, rows: int, lag_rows: float, noise: float, dwell: int = 9) -> Record:
    """A lag under random levels, with outlying and lost readings."""
    command = rng.uniform(-20.0, 30.0, rows // dwell + 1).repeat(dwell)[:rows]
    decay = np.exp(-1.0 / lag_rows)
    read = lfilter([0.0, 0.4 * (1.0 - decay)], [1.0, -decay], command) + noise * rng.standard_normal(rows)
    read[rng.integers(0, rows, 3)] = np.nan
    read[rng.integers(0, rows, 2)] += 300.0
    return Record(np.linspace(0.0, 0.1 * rows, rows), command, read)


@given(
    st.integers(0, 10**6), st.integers(400, 900), st.floats(0.5, 8.0), st.floats(0.3, 0.7), st.floats(8.0, 1e4),
    st.sampled_from((-1.0, 1.0)),
)  # fmt: skip
@examples(max_examples=25)
def test_a_jump_is_found_at_its_row_and_taken_out(
    seed: int, rows: int, lag_rows: float, place: float, spans: float, sign: float
) -> None:
    record = answering(np.random.default_rng(seed), rows, lag_rows, 0.05)
    row, height = round(place * rows), sign * spans * 20.0
    jumped = Record(
        record.time_s, record.voltage_V, record.displacement_um + np.where(np.arange(rows) >= row, height, 0.0)
    )
    steady = without_zero_move(jumped)
    assert steady.zero_move is not None
    # a lost reading leaves the row open
    assert abs(steady.zero_move.row - row) <= 2
    assert steady.zero_move.height_um == pytest.approx(height, abs=1.5)
    assert without_zero_move(steady) is steady


@given(st.integers(0, 10**6), st.integers(40, 600), st.floats(0.5, 200.0), st.integers(1, 60))
@examples(max_examples=30)
def test_what_a_device_answers_is_no_jump(seed: int, rows: int, lag_rows: float, dwell: int) -> None:
    record = answering(np.random.default_rng(seed), rows, lag_rows, 0.05, dwell)
    assert zero_move(record) is None
    assert without_zero_move(record) is record


def one_step(late_rows: int) -> Record:
    command = np.repeat([0.0, 10.0], [60, 140])
    read = np.repeat([0.0, 50.0], [60 + late_rows, 140 - late_rows]) + 0.1 * np.sin(np.arange(200.0))
    return Record(np.linspace(0.0, 20.0, 200), command, read)


def slipping_valve() -> Record:
    """A command that goes down and up once cannot tell a slip from a jump of the reading."""
    command = np.concatenate([np.full(100, 25.0), np.linspace(25.0, 23.0, 100), np.linspace(23.0, 25.0, 100)])
    command += 0.05 * np.random.default_rng(1).standard_normal(300)
    read = np.where(np.arange(300) < 205, 102.0, 99.0) + 0.2 * np.random.default_rng(2).standard_normal(300)
    return Record(10.0 * np.arange(300.0), command, read)


def beyond_squares() -> Record:
    record = answering(np.random.default_rng(1), 400, 2.0, 0.05)
    read_um = np.where(np.arange(400) == 200, 1e308, record.displacement_um)
    return Record(record.time_s, record.voltage_V, read_um)


@pytest.mark.parametrize("record", [one_step(0), one_step(30), slipping_valve(), beyond_squares()])
def test_what_a_command_may_have_done_and_no_number_is_no_jump(record: Record) -> None:
    assert zero_move(record) is None


@pytest.mark.parametrize("height", [-40.0, 30.0])
def test_a_jump_of_about_the_stroke_is_told_where_the_command_turns_often(height: float) -> None:
    record = answering(np.random.default_rng(5), 600, 4.0, 0.05)
    later = np.where(np.arange(600) >= 310, height, 0.0)
    found = zero_move(Record(record.time_s, record.voltage_V, record.displacement_um + later))
    assert found is not None
    assert found.height_um == pytest.approx(height, abs=1.0)


def test_a_jump_while_the_command_rests_is_the_sensor_s() -> None:
    command = np.repeat([0.0, 10.0], [60, 140])
    read = lfilter([0.5], [1.0, -0.7], command) + 0.01 * np.sin(np.arange(200.0))
    later = np.where(np.arange(200) >= 130, 40.0, 0.0)
    found = zero_move(Record(np.linspace(0.0, 20.0, 200), command, read + later))
    assert found is not None
    assert found.row == 130
    assert found.height_um == pytest.approx(40.0, abs=0.05)


@given(st.integers(0, 10**6), st.integers(1, 6), st.floats(0.0, 0.05), st.floats(0.0, 0.3))
@examples(max_examples=30)
def test_friction_that_turns_with_the_motion_is_no_jump(seed: int, turned: int, noise: float, slope: float) -> None:
    way = np.linspace(0.0, 1.0, 80)
    position = np.concatenate([way if k % 2 == 0 else way[::-1] for k in range(turned + 1)])
    force = slope * position + np.sign(np.gradient(position))
    force += noise * np.random.default_rng(seed).standard_normal(force.size)
    assert zero_move(Record(np.linspace(0.0, 1.0, force.size), position, force)) is None


@pytest.mark.parametrize("begins_s", [0.0, 1.0])
def test_a_record_from_rest_is_replayed_from_rest(lag, begins_s: float):
    plant, time_s = lag(), np.arange(200) / 50
    voltage_V = np.where(time_s < begins_s, 0.0, 10.0)
    truth = plant.gain * 10 * -np.expm1(-np.maximum(time_s - begins_s, 0.0) / plant.tau_s)
    result = replay(plant, Record(time_s, voltage_V, truth))
    assert result.start == "rest"
    assert result.simulated_um == pytest.approx(truth, abs=1e-9)
    assert result.acting_V[0] == 0.0


@given(st.floats(-1e3, 1e3), st.floats(0.1, 30), st.booleans())
def test_a_record_that_starts_in_motion_is_met_from_its_first_row(lag, offset_um, gain, lost):
    """Also where the first reading is lost: the lag's answer to a sine long after it began, in closed form."""
    plant, time_s, omega = lag(tau_s=0.3), np.arange(800) / 200, 2 * np.pi
    phase = math.atan(omega * plant.tau_s)
    truth = plant.gain * (5 + 3 * math.cos(phase) * np.sin(omega * time_s - phase))
    read = gain * truth + offset_um
    if lost:
        read[[0, 5, 700]] = np.nan
    result = replay(plant, Record(time_s, 5 + 3 * np.sin(omega * time_s), read), input_hold="linear")
    assert result.start == "motion"
    assert result.simulated_um == pytest.approx(truth, abs=0.01)


@given(st.lists(st.floats(-50, 50), min_size=3, max_size=20), st.floats(1e-6, 1e6), st.sampled_from([0.3, 4.0]))
def test_untimed_rows_are_settled_pairs_whatever_the_times_say_and_however_slow_the_plant_is(
    lag, voltages, scale, tau_s
):
    plant, voltage_V = lag(tau_s=tau_s), np.array(voltages)
    record = Record(scale * np.arange(1, voltage_V.size + 1), voltage_V, np.zeros_like(voltage_V))
    result = replay(plant, record, untimed=True)
    # a lag of 4 s has a few times of the last change before it
    assert result.simulated_um == pytest.approx(plant.gain * voltage_V, abs=10.0 * RESTING_UM)
    assert result.acting_V.tolist() == voltages


def test_acting_voltage_is_that_of_the_row_before_when_held_and_of_the_row_when_straight(lag):
    plant, time_s = lag(), np.arange(4) / 10
    record = Record(time_s, np.array([0.0, 0.0, 2.0, 3.0]), np.zeros(4))
    assert replay(plant, record).acting_V.tolist() == [0.0, 0.0, 0.0, 2.0]
    assert replay(plant, record, input_hold="linear").acting_V.tolist() == [0.0, 0.0, 2.0, 3.0]
