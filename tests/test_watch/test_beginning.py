"""What came before a record, or while rows are missing, is unknown, and no change of the device."""

import contextlib
from itertools import pairwise

import numpy as np
import pytest

from bender_compiled.simulation import Drive, Simulator
from bender_export.build import ensure_plant_fmu
from bender_loop.records.record import Record
from bender_plant.model import Model, load_model, model_from_table
from bender_watch.baseline.beginning import COUNT, Beginning
from bender_watch.baseline.expectation import OfFmu, OfModel
from bender_watch.baseline.learn import Baseline, learn, settling_rows
from bender_watch.baseline.pause import Pause
from bender_watch.follow.rows import Rows
from bender_watch.sequential.detector import JUDGED, Detector, Noise, make_tests
from bender_watch.settings import Settings
from bender_watch.watcher import Watcher

PAPER, BEAM = load_model("paper"), load_model("beam")
CREEPING = BEAM.with_block("creep", gains=(0.03, 0.03, 0.03), time_constants_s=(1.0, 10.0, 100.0))
PLAYS = model_from_table(
    {
        "format": 1,
        "name": "plays",
        "block": [
            {"id": "prandtl_ishlinskii"},
            {"id": "creep", "gains": [0.03, 0.03, 0.03], "time_constants_s": [0.5, 5.0, 50.0]},
            {"id": "calibration"},
        ],
    }
)
MODELS = {"paper": PAPER, "creep": CREEPING, "plays": PLAYS}
HOW = Settings(rows_between_false_alarms=1e6, diagnose=False, explain_rows=1000)
BEFORE, ROWS, RATE_Hz, NOISE_um = 1800, 2400, 30.0, 0.05


def recorded(model: Model, seed: int, pause_rows: int = 0, level_um: float = 0.0, level_row: int = 0) -> Record:
    """Return rows of a device that has moved for a minute, and then stood at 0 V for some rows."""
    rng = np.random.default_rng(seed)
    time = np.arange(BEFORE + ROWS) / RATE_Hz
    tones = zip((16.0, 12.0, 8.0), (0.2, 0.53, 1.37), rng.uniform(0.0, 2.0 * np.pi, 3), strict=True)
    voltage = np.sum([a * np.sin(2.0 * np.pi * f * time + p) for a, f, p in tones], axis=0)
    if pause_rows:
        voltage[BEFORE - pause_rows : BEFORE + 5] = 0.0
    clean = Simulator(Drive.of_rows(time, voltage)).run(model).reading_um[BEFORE:]
    moved = np.where(np.arange(ROWS) < level_row, 0.0, level_um)
    return Record(time[BEFORE:], voltage[BEFORE:], clean + NOISE_um * rng.standard_normal(ROWS) + moved)


@pytest.fixture(scope="module")
def known() -> dict[str, tuple[Record, Baseline]]:
    found = {}
    for name, model in MODELS.items():
        training = recorded(model, 1)
        found[name] = training, learn(model, training, HOW.rows_between_false_alarms)
    return found


def without(record: Record, missing: slice | np.ndarray) -> Record:
    time_s, voltage_V, read_um = (
        np.delete(x, missing) for x in (record.time_s, record.voltage_V, record.displacement_um)
    )
    return Record(time_s, voltage_V, read_um)


def alarms(known: dict[str, tuple[Record, Baseline]], name: str, record: Record) -> list[int]:
    return alarms_of(Watcher(MODELS[name], *known[name], HOW), record)


def alarms_of(watcher: Watcher, record: Record) -> list[int]:
    rows = Rows.of(record)
    return [x["row"] for x in [*watcher.begin_record("own", rows), *watcher.take(rows)] if x["event"] == "alarm"]


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("pause_rows", [0, 90])
def test_what_came_before_is_no_alarm(name: str, pause_rows: int, known: dict[str, tuple[Record, Baseline]]) -> None:
    for seed in range(2, 7):
        assert alarms(known, name, recorded(MODELS[name], seed, pause_rows)) == []


@pytest.mark.parametrize("name", MODELS)
def test_a_training_record_in_motion_shows_its_noise_alone(
    name: str, known: dict[str, tuple[Record, Baseline]]
) -> None:
    assert known[name][1].noise_um == pytest.approx(NOISE_um, rel=0.1)


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("pause_rows", [0, 90])
def test_a_level_that_moves_later_is_one(name: str, pause_rows: int, known: dict[str, tuple[Record, Baseline]]) -> None:
    (row,) = alarms(known, name, recorded(MODELS[name], 2, pause_rows, 0.2, 1200))
    assert 1200 < row < 1260


def test_a_level_of_its_own_is_taken_for_the_records_own(known: dict[str, tuple[Record, Baseline]]) -> None:
    assert alarms(known, "paper", recorded(PAPER, 2, level_um=3.0)) == []


def test_a_sensor_that_has_moved_between_records_is_seen_beside_what_a_motion_left(
    known: dict[str, tuple[Record, Baseline]],
) -> None:
    (row,) = alarms(known, "paper", recorded(PAPER, 2, 90, 3.0))
    assert row < 600


def test_pasts_fade_and_are_forgotten() -> None:
    beginning = Beginning(PAPER, False, (-30.0, 30.0), NOISE_um, 1.0 / RATE_Hz)
    beginning.begin(0.0, 10.0, rest=False)
    time = np.arange(1500) / RATE_Hz
    whole = beginning.courses.advance(time, 10.0 * np.cos(time), None)
    assert np.max(np.abs(whole[0])) > 1.0
    assert np.all(whole[-100:] == 0.0)
    other = Beginning(PAPER, False, (-30.0, 30.0), NOISE_um, 1.0 / RATE_Hz)
    other.begin(0.0, 10.0, rest=False)
    parts = [other.courses.advance(time[a : a + 70], 10.0 * np.cos(time[a : a + 70]), None) for a in range(0, 1500, 70)]
    assert np.allclose(np.concatenate(parts), whole, atol=1e-9)


def test_a_signature_that_runs_away_ends_no_watch() -> None:
    """A beam that stiffens rings ever further where sub-steps are coarse, after a step of the command."""
    expectation = OfModel(PAPER, [PAPER.with_block("stiffening", cubic_1_per_um2=1.3e-4)])
    expectation.begin(60.0, 28.893743850085457, rest=False)
    expected, added = expectation.advance(60.0 + np.arange(50) / RATE_Hz, np.full(50, 28.9), None)
    assert np.all(np.isfinite(expected))
    assert np.all(added == 0.0)
    again = OfModel(PAPER, [PAPER.with_block("stiffening", cubic_1_per_um2=1.3e-4)])
    again.restore(expectation.state())
    assert np.all(again.advance(np.array([62.0]), np.zeros(1), None)[1] == 0.0)


def test_unknown_amplitudes_leave_white_noise_of_unit_variance() -> None:
    """The recursive residuals of a regression are white whatever its amplitudes are."""
    rng, rows = np.random.default_rng(3), 4000
    columns = np.column_stack([np.ones(rows), np.exp(-np.arange(rows) / 500.0), np.zeros(rows)])
    found = []
    for _ in range(20):
        own = Detector(
            Noise(np.zeros((1, 0)), np.array([0.5])),
            make_tests((), np.zeros(0), np.zeros(0), np.zeros(0, bool), 1e6),
            2,
        )
        own.take_known(np.zeros(2), np.diag([1e3, 1e3]))
        read = 0.5 * rng.standard_normal(rows) + columns[:, :2] @ rng.normal(0.0, 30.0, 2)
        judged = own.judge(read, np.zeros((rows, 0)), np.full(rows, JUDGED), np.ones(rows), 0, columns)
        assert judged.exceedance is None
        found.append(judged.innovations)
    assert np.std(found) == pytest.approx(1.0, abs=0.02)
    assert np.std(np.array(found)[:, :20]) == pytest.approx(1.0, abs=0.12)


def test_an_fmu_has_no_pasts() -> None:
    beginning = Beginning(None, False, (0.0, 1.0), 1.0, 1.0)
    beginning.begin(0.0, 0.0, rest=False)
    assert np.array_equal(beginning.courses.advance(np.arange(3.0), np.zeros(3), None), np.zeros((3, COUNT)))
    assert not Pause(None, False, (0.0, 1.0), 1.0, 1.0, 0.1).pass_over(None, (0.0, 0.0), (5.0, 1.0))


def test_noise_below_the_least_is_not_quieter() -> None:
    """A record without noise is quieter than the least noise from its first row on."""
    long, short = (recorded(BEAM, seed) for seed in (1, 2))
    clean = [
        Record(x.time_s, x.voltage_V, Simulator(Drive.of_rows(x.time_s, x.voltage_V)).run(BEAM).reading_um)
        for x in (long, short)
    ]
    part = slice(0, 1200)
    training = Record(clean[0].time_s[part], clean[0].voltage_V[part], clean[0].displacement_um[part])
    assert alarms_of(Watcher(BEAM, training, learn(BEAM, training, 1e6), HOW), clean[1]) == []


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("missing", [1, 5, 150, 600])
def test_rows_that_are_missing_while_the_command_moves_are_no_alarm(
    name: str, missing: int, known: dict[str, tuple[Record, Baseline]]
) -> None:
    for seed in range(2, 7):
        begin = 300 + 100 * seed
        assert alarms(known, name, without(recorded(MODELS[name], seed), slice(begin, begin + missing))) == []


@pytest.mark.parametrize("name", MODELS)
def test_rows_that_are_missing_here_and_there_are_none(name: str, known: dict[str, tuple[Record, Baseline]]) -> None:
    missing = np.flatnonzero(np.random.default_rng(9).random(ROWS) < 0.01)
    assert alarms(known, name, without(recorded(MODELS[name], 3), missing)) == []


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("missing", [1, 150])
def test_a_level_that_moves_while_rows_are_missing_is_one(
    name: str, missing: int, known: dict[str, tuple[Record, Baseline]]
) -> None:
    (row,) = alarms(known, name, without(recorded(MODELS[name], 2, 0, 0.3, 1200), slice(1200 - missing, 1200)))
    assert 1200 - missing < row < 1440 - missing


def test_a_device_that_stands_while_rows_are_missing_has_no_other_ways() -> None:
    pause = Pause(PAPER, False, (0.0, 30.0), NOISE_um, 1.0 / RATE_Hz, 0.0)
    stood = OfModel(PAPER)
    stood.begin(0.0, 10.0, rest=False)
    stood.advance(np.zeros(1), np.full(1, 10.0), None)
    assert not pause.pass_over(stood.own_state, (0.0, 10.0), (3.0, 10.0))
    assert pause.pass_over(stood.own_state, (0.0, 10.0), (3.0, 20.0))
    added = pause.courses.advance(np.array([3.0]), np.array([20.0]), None)
    assert added[0, 0] > 1.0


def test_the_next_row_is_judged_alike_whether_rows_are_missing_before_it_in_this_part_or_the_last(
    known: dict[str, tuple[Record, Baseline]],
) -> None:
    record = without(recorded(PAPER, 4), slice(500, 540))
    rows, found = Rows.of(record), []
    for cuts in ([], [499], [500], [501], [200, 500, 900]):
        seen: list[np.ndarray] = []
        watcher = Watcher(PAPER, *known["paper"], HOW, seen=lambda _, e, __, seen=seen: seen.append(e.copy()))
        list(watcher.begin_record("own", rows))
        for begin, end in pairwise([0, *cuts, len(rows)]):
            list(watcher.take(rows.part(slice(begin, end))))
        found.append(np.concatenate(seen))
    assert all(np.allclose(x, found[0], rtol=0.0, atol=1e-6, equal_nan=True) for x in found)


def test_behind_missing_rows_an_fmu_is_not_judged_for_a_while(known: dict[str, tuple[Record, Baseline]]) -> None:
    training, _ = known["paper"]
    with contextlib.closing(OfFmu(ensure_plant_fmu("paper"))) as fmu:
        watcher = Watcher(None, training, learn(fmu, training, HOW.rows_between_false_alarms), HOW)
        record = without(recorded(PAPER, 5), np.r_[800:805, 1500:1520])
        assert alarms_of(watcher, record) == []
    assert watcher.judged == len(record) - 2 * settling_rows(False, watcher.baseline.rows) - 8 * 5 - 8 * 20


def test_a_training_record_that_lacks_rows_shows_its_noise_alone(known: dict[str, tuple[Record, Baseline]]) -> None:
    missing = np.flatnonzero(np.random.default_rng(8).random(ROWS) < 0.02)
    training = without(recorded(PAPER, 1), missing)
    found = learn(PAPER, training, HOW.rows_between_false_alarms)
    assert found.noise_um == pytest.approx(known["paper"][1].noise_um, rel=0.05)
    assert alarms_of(Watcher(PAPER, training, found, HOW), recorded(PAPER, 2)) == []
