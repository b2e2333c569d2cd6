"""Isolated readings far from both neighbours are left out of a first model; what the device does is not."""

import numpy as np
import pytest

from bender_identify.first_model.choice import first_model
from bender_identify.first_model.course import experiments_of
from bender_identify.first_model.report import facts, sentences
from bender_loop.records.record import Record

STROKE_um, NOISE_um = 20.0, 0.02


def stairs(rng: np.random.Generator, rows: int = 240) -> np.ndarray:
    return np.repeat(rng.uniform(0.0, 40.0, rows // 12), 12)


def lagging(volts: np.ndarray, time_constant_rows: float, rng: np.random.Generator) -> np.ndarray:
    """A first-order lag, row by row: the command of a row acts until the next one."""
    kept = np.exp(-1.0 / time_constant_rows)
    read = np.zeros(volts.size)
    for k in range(1, volts.size):
        read[k] = kept * read[k - 1] + (1.0 - kept) * volts[k - 1]
    return read * STROKE_um / 40.0 + NOISE_um * rng.standard_normal(volts.size)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("strokes", [1.0, 200.0])
def test_a_few_misread_frames_do_not_move_the_first_model(strokes: float, seed: int):
    rng = np.random.default_rng(seed)
    volts = stairs(rng)
    read = lagging(volts, 5.0, rng)
    rows = rng.choice(np.arange(12, volts.size - 1), 4, replace=False)
    spoiled = read.copy()
    spoiled[rows] += strokes * STROKE_um * rng.choice([-1.0, 1.0], 4)
    time_s = np.arange(volts.size, dtype=float) / 10.0
    clean, found = (
        first_model(experiments_of([Record(time_s, volts, x)], ["record"], "hold")) for x in (read, spoiled)
    )
    assert found.chosen.structure == clean.chosen.structure
    assert found.chosen.gain == pytest.approx(clean.chosen.gain, rel=0.01)
    assert found.chosen.values == pytest.approx(clean.chosen.values, rel=0.05)
    if strokes >= 5.0:
        left_out = facts(found)["records"][0]["set_aside_s"]
        assert left_out == pytest.approx(sorted(time_s[rows]))
        assert f"4 readings left out at {left_out[0]:.6g}" in sentences(found)[-1]


def test_a_slow_sine_with_a_stray_in_its_second_row():
    rng = np.random.default_rng(5)
    time_s = 0.9 * np.arange(209, dtype=float)
    volts = 0.2 - 0.2 * np.cos(2.0 * np.pi * time_s / 90.0) + 0.02
    read = 0.58 * np.roll(volts, 1) + 1e-3 * rng.standard_normal(time_s.size)
    read[[1, 61, 72, 205]] += 0.97
    found = first_model(experiments_of([Record(time_s, volts, read)], ["record"], "hold"))
    assert found.chosen.structure.name == "gain"
    assert found.chosen.gain == pytest.approx(0.58, rel=0.01)


@pytest.mark.parametrize("time_constant_rows", [0.3, 1.0, 4.0])
def test_answers_to_short_pulses_are_no_misread_frames(time_constant_rows: float):
    rng = np.random.default_rng(6)
    volts = np.zeros(400)
    volts[rng.choice(np.arange(10, 390), 12, replace=False)] = 40.0
    record = Record(np.arange(volts.size, dtype=float) / 10.0, volts, lagging(volts, time_constant_rows, rng))
    assert experiments_of([record], ["record"], "hold")[0].misread_s == ()


def test_coarse_readings_that_flicker_are_no_misread_frames():
    rng = np.random.default_rng(7)
    volts = stairs(rng, 480)
    read = np.round(lagging(volts, 5.0, rng) / 2.0 + 0.1 * rng.standard_normal(volts.size)) * 2.0
    record = Record(np.arange(volts.size, dtype=float) / 10.0, volts, read)
    assert experiments_of([record], ["record"], "hold")[0].misread_s == ()


def test_a_short_record_with_a_stray_is_still_long_enough() -> None:
    rng = np.random.default_rng(9)
    volts = np.repeat(rng.uniform(0.0, 40.0, 5), 5)
    read = 0.5 * np.roll(volts, 1) + NOISE_um * rng.standard_normal(25)
    read[0] = 0.0
    lost = np.isin(np.arange(25), [3, 4, 9, 23, 24])
    read[lost] = np.nan
    read[12] += 500.0
    (ready,) = experiments_of([Record(np.arange(25.0) / 10.0, volts, read)], ["record"], "hold")
    assert ready.misread_s == pytest.approx((1.2,))


def test_readings_behind_pauses_are_told() -> None:
    rng = np.random.default_rng(10)
    volts = stairs(rng, 480)
    read = lagging(volts, 8.0, rng)
    kept = np.delete(np.arange(480), np.arange(115, 125))
    record = Record(np.arange(480.0)[kept] / 10.0, volts[kept], read[kept])
    (ready,) = experiments_of([record], ["record"], "hold")
    # ten rows are missing; the lag of 0.8 s answers for 3.7 s
    assert 30 <= ready.behind_pauses <= 45
    found = first_model([ready])
    assert facts(found)["records"][0]["behind_pauses"] == ready.behind_pauses
    assert f"{ready.behind_pauses} readings behind a pause left out" in sentences(found)[-1]
    assert found.chosen.values[0] == pytest.approx(0.8, rel=0.05)
