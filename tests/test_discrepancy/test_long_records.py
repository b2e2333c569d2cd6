"""Long records: which part of them is searched, what its plant remembers, and what is held against the whole."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from reported_diagnosis import FRAME_S, NOISE_um, levels, record_of

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.conclusion.diagnosis_json import outcome
from bender_discrepancy.conclusion.findings import find
from bender_discrepancy.conclusion.measurement.gap import measure
from bender_discrepancy.record_search import search_records
from bender_inference.records import excerpt
from bender_inference.records.excerpt import Excerpt, excerpts
from bender_inference.records.observations import Observations, observe
from bender_loop.records.record import Record
from bender_loop.records.telling_rows import AS_GOOD, first_row, shown_parts
from bender_plant.model import load_model

PAPER = load_model("paper")
# remembers the last command for long, and the largest for ever
REMEMBERING = PAPER.with_block("creep", gains=(0.2, 0.1), time_constants_s=(1.0, 40.0)).with_block(
    "rate_independent_hysteresis", form="plays", thresholds_V=(2.0, 8.0, 20.0), weights_um_per_V=(0.05, 0.05, 0.05)
)


def seen(voltage_V: np.ndarray, linear: bool = False) -> Observations:
    time_s = FRAME_S * np.arange(voltage_V.size, dtype=np.float64)
    return observe(Record(time_s, voltage_V, np.zeros(voltage_V.size)), linear)


def shown_by_hand(volts: np.ndarray, read: np.ndarray, rows: int, first: int) -> float:
    """What part of a record's spectrum and amplitudes a window shows, row by row."""
    parts = []
    for lag in (2**k for k in range(20) if 2**k <= rows and 2**k < volts.size):
        squares = [(volts[k] - volts[k - lag]) ** 2 if k >= lag and read[k] else 0.0 for k in range(volts.size)]
        if sum(squares):
            parts.append(min(np.mean(squares[first : first + rows]) / np.mean(squares), 1.0))
    window = volts[first : first + rows]
    return float((np.mean(parts) if parts else 1.0) * (window.max() - window.min()) / np.ptp(volts))


levels_of_a_record = arrays(np.float64, st.integers(2, 40), elements=st.integers(0, 50).map(float))


@given(levels_of_a_record, st.integers(1, 50), st.integers(0, 99))
def test_the_window_is_the_earliest_that_shows_nearly_as_much_as_any(volts: np.ndarray, rows: int, seed: int) -> None:
    read = np.random.default_rng(seed).random(volts.size) > 0.2
    first = first_row(volts, read, rows)
    if rows >= volts.size or np.ptp(volts) == 0.0:
        assert first == 0
        return
    shown = [shown_by_hand(volts, read, rows, k) for k in range(volts.size - rows + 1)]
    assert shown_parts(volts, read, rows) == pytest.approx(shown)
    assert shown[first] >= AS_GOOD * max(shown) - 1e-9
    assert all(x <= AS_GOOD * max(shown) + 1e-9 for x in shown[:first])


def test_an_excerpt_of_a_sweep_is_not_only_its_quick_end() -> None:
    time_s = 1e-3 * np.arange(60_000)
    phase = 2.0 * np.pi * 0.2 * 10.0 / np.log(500.0) * (500.0 ** (time_s / 60.0) - 1.0) * 6.0
    sweep_V = 25.0 + 20.0 * np.sin(phase)
    first = first_row(sweep_V, np.ones(60_000, dtype=np.bool_), 20_000)
    cycles = np.diff(phase[first : first + 20_000]) / (2.0 * np.pi * 1e-3)
    assert cycles[0] < 10.0
    assert cycles[-1] > 30.0


@pytest.mark.slow
@given(st.lists(st.integers(2, 30_000), min_size=1, max_size=4), st.booleans())
@examples(max_examples=25)
def test_only_long_records_are_cut(sizes: Sequence[int], untimed: bool) -> None:
    found = excerpts([seen(np.full(size, 5.0)) for size in sizes], untimed)
    most = excerpt.MOST_UNTIMED_ROWS if untimed else excerpt.MOST_ROWS
    assert all(x.is_all for x in found) == (sum(sizes) <= most or max(sizes) <= excerpt.FEWEST_OF_ONE)
    for x, size in zip(found, sizes, strict=True):
        assert np.all(np.diff(x.rows) > 0)
        assert 0 <= x.rows[0] <= x.rows[-1] < size
        assert x.rows.size >= min(size, excerpt.FEWEST_OF_ONE // 2)
        assert x.seen().measured_um.size == x.rows.size


def test_rows_under_a_course_that_never_stands_follow_each_other() -> None:
    held = seen(np.random.default_rng(3).normal(0.0, 10.0, 40_000))
    (cut,) = excerpts([replace(held, drive=replace(held.drive, smooth=True))])
    assert np.all(np.diff(cut.rows) == 1)
    assert excerpt.FEWEST_ROWS <= cut.rows.size < held.measured_um.size


def test_what_tells_of_the_time_before_a_record_in_motion_counts_nowhere() -> None:
    rows = 60_000
    moving = seen(25.0 + 20.0 * np.sin(0.01 * np.arange(rows)))
    (cut,) = excerpts([moving])
    assert cut.after_a_guess == excerpt.EXACT_COMMANDS <= cut.rows[0]
    whole = cut.judged(cut.seen())
    assert not whole.usable[: cut.after_a_guess].any()
    assert whole.usable[cut.after_a_guess :].all()
    resting = np.concatenate([np.zeros(100), np.full(rows - 100, 30.0)])
    assert excerpts([seen(resting)])[0].after_a_guess == 0


@given(st.integers(0, 14_000), st.integers(1, 500), st.integers(0, 99), st.booleans())
@examples(max_examples=25)
def test_an_excerpt_keeps_its_clock_and_what_was_commanded_before(first: int, rows: int, seed: int, linear: bool):
    rng = np.random.default_rng(seed)
    # some commands are held for several rows
    volts = np.repeat(rng.uniform(0.0, 50.0, 14_500), rng.integers(1, 4, 14_500))[:14_500]
    whole = seen(volts, linear)
    read = np.flatnonzero(rng.random(rows) > 0.5) + first if seed % 2 else first + np.arange(rows)
    read = read if read.size else np.array([first])
    cut = Excerpt(whole, read)
    x = cut.seen()
    assert np.array_equal(x.time_s, whole.time_s[read])
    assert np.array_equal(x.command_V, volts[read])
    assert np.array_equal(x.acting_V[1:], whole.acting_V[read][1:])
    assert np.all(np.diff(x.drive.command_time_s) > 0.0)
    assert x.drive.voltage_V.size < rows + excerpt.EXACT_COMMANDS + 200
    earlier = x.drive.command_time_s < whole.time_s[read[0]]
    before = x.drive.voltage_V[earlier]
    if read[0]:
        assert (before.min(), before.max()) == (volts[: read[0]].min(), volts[: read[0]].max())
        means = [held_mean_V(y.drive, float(x.time_s[0])) for y in (x, whole)]
        assert means[0] == pytest.approx(means[1], abs=1e-6 if not linear else 0.2)


@given(st.integers(0, 99), st.booleans())
@examples(max_examples=10)
def test_a_plant_is_driven_in_some_rows_of_a_record_as_in_all_of_them(seed: int, linear: bool) -> None:
    rng = np.random.default_rng(seed)
    volts = np.repeat(rng.uniform(0.0, 50.0, 400), rng.integers(1, 9, 400))
    whole = seen(volts, linear)
    read = np.flatnonzero(rng.random(volts.size) > 0.7)
    expected = Simulator(whole.drive).run(REMEMBERING).reading_um[read]
    found = Simulator(Excerpt(whole, read).seen().drive).run(REMEMBERING).reading_um
    assert np.max(np.abs(found - expected)) < 1e-3


def held_mean_V(drive: Drive, until_s: float) -> float:
    early = drive.command_time_s < until_s
    return float(np.average(drive.voltage_V[early], weights=np.diff(np.append(drive.command_time_s[early], until_s))))


@pytest.mark.parametrize(("first", "within_um"), [(1_500, 1e-6), (9_000, 0.1)])
def test_the_plant_of_an_excerpt_remembers(first: int, within_um: float) -> None:
    volts = levels(400.0)
    whole = seen(volts)
    window = slice(first, first + 900)
    cut = Excerpt(whole, np.arange(first, first + 900))
    expected = Simulator(whole.drive).run(REMEMBERING).reading_um[window]
    found = Simulator(cut.seen().drive).run(REMEMBERING).reading_um
    assert np.max(np.abs(found - expected)) < within_um
    forgetful = Simulator(observe(part(record_of(voltage_V=volts), window)).drive).run(REMEMBERING).reading_um
    assert np.max(np.abs(forgetful - expected)) > 1.0


def part(record: Record, rows: slice) -> Record:
    return Record(record.time_s[rows], record.voltage_V[rows], record.displacement_um[rows])


@pytest.mark.slow
def test_a_long_record_is_searched_in_part_and_judged_as_a_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(excerpt, "EXCERPT_ROWS", 2_000)
    voltage_V = np.concatenate([np.zeros(12_000), np.tile(levels(400.0), 4)])
    record = record_of(voltage_V=voltage_V, effects={"source_resistance": {"time_constant_s": 0.03}})
    reading_um = record.displacement_um.copy()
    stray = np.arange(150, reading_um.size, 997)
    reading_um[stray] += 5.0
    reading_um[40_000:40_100] = np.nan
    found = search_records(PAPER, [Record(record.time_s, record.voltage_V, reading_um)])
    assert found.verdict.word == "named"
    assert found.best.hypothesis.effects == ("source_resistance",)
    (rows,) = found.searched
    assert rows.size == pytest.approx(2_000, abs=200)
    assert rows[-1] - rows[0] > 40_000
    findings = find(found)
    measured = measure(found, findings.model, findings.calibration, tmp_path / "model.fmu")
    assert measured.after.rms_um == pytest.approx(NOISE_um, rel=0.02)
    assert measured.judged == pytest.approx(60_000 - 100 - stray.size - 0.85 * rows.size, abs=60)
    assert measured.after_um[0].size == rows.size
    result = outcome(findings, measured)
    (told,) = result["records"]
    assert (told["rows"], told["lost"]) == (60_000, 100)
    assert told["searched_rows"] == [rows[0], rows[-1]]
    assert set(told["outlying_rows"]) <= set(stray.tolist())
    assert any(f"{rows.size} of 60000 rows" in x for x in result["warnings"])


def test_a_memory_that_fades_over_what_is_told_is_as_after_the_whole() -> None:
    """A leak of 2 s at 4 kHz: its state where the excerpt begins comes from commands that are told by their blocks."""
    rng = np.random.default_rng(5)
    time_s = np.arange(40_000) / 4000.0
    volts = np.repeat(rng.uniform(0.0, 50.0, 40), 1000) * np.linspace(1.0, 0.3, 40_000)
    plant = load_model("beam").with_block("charge_leakage", fraction=0.6, time_constant_s=2.0)
    seen = observe(Record(time_s, volts, np.zeros(40_000)))
    part = Excerpt(seen, np.arange(32_000, 36_000))
    whole_um = Simulator(seen.drive).run(plant).reading_um[part.rows]
    part_um = Simulator(part.seen().drive).run(plant).reading_um
    assert float(np.abs(part_um - whole_um).max()) < 2e-3 * float(np.ptp(whole_um))
