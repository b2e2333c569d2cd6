"""First models from records alone: structures, starts, fits, the choice of the order, the command."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from few import few_rows
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.signal import TransferFunction, lsim

from bender_cli.main import main
from bender_identify.first_model.choice import MOST_IN_VAIN, Losses, Scored, first_model, is_better, select
from bender_identify.first_model.course import experiments_of
from bender_identify.first_model.excerpt import MOST_ROWS, excerpts
from bender_identify.first_model.fit import FirstFit, FitTask, from_search, to_search
from bender_identify.first_model.frequency_start import frequency_starts, response
from bender_identify.first_model.linear_structures import linear_structures
from bender_identify.first_model.report import (
    choice_sentence,
    delay_sentence,
    doubt_sentence,
    explained_share,
    numbers,
    quick_sentence,
    sentences,
)
from bender_identify.first_model.structures import STRUCTURES, Structure
from bender_identify.records.experiment import experiment_of
from bender_identify.settings import Settings
from bender_inference.settings import Settings as DiagnoseSettings
from bender_inference.structures import competing_structures
from bender_loop.records.record import Record, write_record
from bender_plant.model import ModelError, load_model

ROW_S = 0.02


def steps(rows: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    volts = np.repeat(rng.uniform(0.0, 40.0, rows), rng.integers(10, 60, rows))[:rows]
    volts[0] = 0.0
    return volts


def record_of(numerator, denominator, delay_rows: int, noise: float, rows: int = 1500, seed: int = 3) -> Record:
    """Return a record of a transfer function, by an integrator that shares nothing with the plant."""
    volts, parts = steps(rows, seed), 20
    fine = np.repeat(volts, parts)
    time_s = np.arange(fine.size, dtype=np.float64) * ROW_S / parts
    read = lsim(TransferFunction(numerator, denominator), fine, time_s, interp=False)[1][::parts]
    read = np.concatenate([np.zeros(delay_rows), read])[:rows]
    rng = np.random.default_rng(seed + 1)
    return Record(np.arange(rows, dtype=np.float64) * ROW_S, volts, read + 2.0 + rng.normal(0.0, noise, rows))


def found_in(record: Record):
    return first_model([experiment_of(record, "first", Settings())])


def test_a_structure_names_its_numbers_and_makes_a_plant():
    structure = Structure(lags=1, modes=2, delay=True)
    assert structure.order == 5
    assert structure.names == (
        "time_constant_s", "frequency_1_Hz", "damping_ratio_1", "frequency_2_Hz", "damping_ratio_2", "share_2",
        "delay_s",
    )  # fmt: skip
    model = structure.model((0.1, 2.0, 0.05, 9.0, 0.02, 0.2, 0.03), 0.7, 1.5)
    values = model.values()
    assert values["linear_transduction.gain_factor"] == 1.0
    assert values["plant_lag.time_constant"] == 0.1
    assert values["transport_delay.delay"] == 0.03
    with pytest.raises(ModelError, match="found 2 numbers, expected 7"):
        structure.model((1.0, 2.0))


@given(st.sampled_from(STRUCTURES), st.integers(0, 2**32 - 1))
def test_coordinates_of_the_search_lead_back(structure: Structure, seed: int):
    rng = np.random.default_rng(seed)
    record = Record(np.arange(40, dtype=np.float64) * 0.1, steps(40, 1), steps(40, 1) * 0.5)
    task = FitTask.of([experiment_of(record, "any", Settings())])
    ranges = {"time": (1e-3, 10.0), "frequency": (0.6, 5.0), "damping": (0.01, 0.9), "share": (-0.9, 0.9)}
    values = tuple(float(rng.uniform(*ranges[name.partition("_")[0]])) for name in structure.names)
    assert from_search(structure, to_search(structure, values, task), task) == pytest.approx(values, rel=1e-6)


def test_a_lag_and_a_delay_are_found_with_intervals_that_hold_them():
    found = found_in(record_of([0.8], [0.3, 1.0], 7, 0.05))
    assert found.chosen.structure == Structure(lags=1, delay=True)
    told = {x["name"]: x for x in numbers(found)}
    for name, truth in {"time_constant_s": 0.3, "delay_s": 7 * ROW_S, "gain": 0.8}.items():
        low, high = told[name]["interval"]
        slack = 0.5 * (high - low)
        assert low - slack < truth < high + slack
        assert high - low < 0.1 * truth
    assert "delay of the sensor from one of the actuator" in delay_sentence(found)


@pytest.mark.parametrize("only", [Structure(modes=1), Structure(lags=1)])
@pytest.mark.parametrize(("share_of_rate", "is_said"), [(0.4, True), (0.1, False)])
def test_a_mode_too_fast_for_the_rows_is_said(only: Structure, share_of_rate: float, is_said: bool):
    omega = 2.0 * math.pi * share_of_rate / ROW_S
    record = record_of([omega**2], [1.0, 0.04 * omega, omega**2], 0, 0.02, rows=600)
    found = first_model([experiment_of(record, "record", Settings())], only=only)
    assert ("rows at" in quick_sentence(found)) is is_said


def test_a_gain_stays_a_gain():
    found = found_in(record_of([1.0], [1e-6, 1.0], 0, 0.5))
    assert found.chosen.structure == Structure()
    assert found.chosen.gain == pytest.approx(1.0, abs=0.01)
    assert delay_sentence(found) == ""


@pytest.mark.slow
def test_orders_end_where_two_in_turn_bring_nothing_and_go_on_to_modes_that_show():
    # a play is no order: what it leaves is neither white nor simulated better by one
    lagging = record_of([0.5], [0.3, 1.0], 0, 0.02)
    read, play_um = np.empty(len(lagging)), 1.0
    read[0] = lagging.displacement_um[0]
    for k in range(1, len(lagging)):
        read[k] = np.clip(read[k - 1], lagging.displacement_um[k] - play_um, lagging.displacement_um[k] + play_um)
    with_play = found_in(Record(lagging.time_s, lagging.voltage_V, read))
    assert max(x.fit.structure.order for x in with_play.scores) == 1 + MOST_IN_VAIN
    assert with_play.chosen.structure.order == 1
    mode = record_of([0.6 * 80.0], [1.0, 1.2, 80.0], 0, 0.02)
    assert max(x.fit.structure.order for x in found_in(mode).scores) >= 2


def swelling_sine(rows: int) -> np.ndarray:
    time_s = np.arange(rows, dtype=np.float64) * ROW_S
    return 20.0 * np.minimum(time_s / 6.0, 1.0) * np.sin(2.0 * math.pi * 0.5 * time_s)


def slider(volts: np.ndarray, holds_V: float) -> np.ndarray:
    """The force of a spring against a block on a dry floor: it slides where the spring is pulled further."""
    block, force = 0.0, np.empty_like(volts)
    for k, at in enumerate(volts):
        block = min(max(block, at - holds_V), at + holds_V)
        force[k] = at - block
    return force


@pytest.mark.slow
def test_a_loop_of_friction_in_a_narrow_band_is_no_delay():
    volts = swelling_sine(900)
    force = slider(volts, 5.0) + np.random.default_rng(5).normal(0.0, 0.1, volts.size)
    found = found_in(Record(np.arange(volts.size, dtype=np.float64) * ROW_S, volts, force))
    assert found.chosen.structure == Structure()
    assert found.chosen.gain > 0.0
    assert found.loop is not None
    best = min(found.scores, key=lambda x: x.held_out_rms)
    assert best.fit.structure != Structure()
    assert found.loop_rms < 0.5 * best.held_out_rms
    said = choice_sentence(found)
    assert said.startswith("a loop that does not depend on time (plays)")
    # the figure of a structure is the one that the table has of it
    assert f"{found.loop_rms:.4g} against {best.held_out_rms:.4g} of {best.fit.structure.name}" in said
    assert doubt_sentence(found) == ""
    assert sentences(found)[0] == "gain, order 0; without intervals"


@pytest.mark.slow
def test_a_mode_that_rings_after_steps_stays_beside_a_loop_of_hysteresis():
    # slow parts and, in the middle, steps that ring: the last block of three has next to no ringing in it
    rows, row_s = 2000, 0.002
    time_s = row_s * np.arange(rows, dtype=np.float64)
    slow = 2.0 * (1.0 - np.cos(2.0 * math.pi * 1.0 * time_s))
    steps = np.repeat(np.random.default_rng(8).uniform(0.0, 4.0, 10), rows // 10)
    volts = np.where((time_s > 0.8) & (time_s < 2.6), steps, slow)
    plays = slider(volts, 0.6) + slider(volts, 1.5)
    forced = volts - 0.1 * plays
    omega, damping = 2.0 * math.pi * 60.0, 0.03
    mode = TransferFunction([omega**2], [1.0, 2.0 * damping * omega, omega**2])
    fine = np.repeat(forced, 20)
    read = lsim(mode, fine, row_s / 20.0 * np.arange(fine.size), interp=False)[1][::20]
    read = read + np.random.default_rng(9).normal(0.0, 0.005, rows)
    found = found_in(Record(time_s, volts, read))
    assert found.loop is not None
    assert found.chosen.structure == Structure(modes=1)
    assert found.chosen.values[0] == pytest.approx(60.0, rel=0.02)
    assert "gain+mode is written with the times that remain beside it" in choice_sentence(found)


@pytest.mark.slow
def test_a_lag_in_the_same_band_is_one():
    volts = swelling_sine(900)
    time_s = np.arange(volts.size, dtype=np.float64) * ROW_S
    read = lsim(TransferFunction([0.5], [0.4, 1.0]), volts, time_s)[1]
    read = read + np.random.default_rng(6).normal(0.0, 0.05, volts.size)
    found = first_model([experiment_of(Record(time_s, volts, read), "first", Settings(), "linear")])
    assert found.loop is None
    assert found.chosen.structure == Structure(lags=1)


def scored(structure: Structure, losses: list[float]) -> Scored:
    fit = FirstFit(structure, tuple(0.1 for _ in structure.names), 1.0, (0.0,), (np.zeros(1),))
    weights = np.full(len(losses), 1.0 / len(losses))
    rms = math.sqrt(float(np.mean(losses)))
    return Scored((fit,), rms, Losses(np.array(losses), weights))


def test_a_richer_structure_needs_more_than_one_standard_error_on_unseen_blocks():
    gain, lag = scored(Structure(), [1.0] * 18), scored(Structure(lags=1), [0.8] * 18)
    assert select([gain, lag]) is lag
    assert is_better(gain.left, lag.left)
    # as much on average, but in one block alone and hardly: 4 % of the rms
    lucky = scored(Structure(lags=1), [1.0] * 17 + [-0.4 + 1.0])
    assert select([gain, lucky]) is gain
    # however little chance there is in it, a hundredth is not worth a number
    hardly = scored(Structure(lags=1), [0.98] * 18)
    assert is_better(gain.left, hardly.left)
    assert select([gain, hardly]) is gain


@given(st.lists(st.floats(0.1, 10.0), min_size=6, max_size=18), st.floats(0.05, 0.8))
def test_a_slow_residual_is_evidence_in_every_block(losses: list[float], part: float):
    # whatever the size of the blocks, one that falls everywhere by a tenth and more of the rms is taken
    gain, lag = scored(Structure(), losses), scored(Structure(lags=1), [part * x for x in losses])
    assert select([gain, lag]) is lag


@pytest.mark.parametrize(("follows_um", "is_doubted"), few_rows([(0.8, False), (0.02, True)], 1))
def test_a_record_that_no_structure_follows_is_said(follows_um: float, is_doubted: bool):
    found = found_in(record_of([follows_um], [0.3, 1.0], 0, 0.5, rows=600))
    assert bool(doubt_sentence(found)) is is_doubted
    assert (explained_share(found) < 0.5) is is_doubted


def test_the_command_writes_model_fmu_and_figures(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    record = tmp_path / "record.csv"
    write_record(record, record_of([0.8], [0.3, 1.0], 3, 0.05, rows=800))
    out = tmp_path / "mine.toml"
    assert main(["model", "fit", str(record), "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "gain + lag + delay, order 1" in printed
    assert str(out) in printed
    assert {x.id for x in load_model(out).blocks} == {
        "transport_delay", "plant_lag", "linear_transduction", "calibration",
    }  # fmt: skip
    told = json.loads(out.with_suffix(".json").read_text(encoding="utf-8"))
    assert told["structure"] == "gain+lag+delay"
    assert out.with_suffix(".fmu").stat().st_size > 1000
    assert main(["compare", str(record), "--model", str(out), "--out", str(tmp_path / "compared")]) == 0
    assert "fitted to 720 of 800 rows and leaves 0.05" in printed
    assert "rms of all 800 rows" in capsys.readouterr().out


def test_numbers_have_the_units_of_the_record(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    record, out = tmp_path / "record.csv", tmp_path / "mine.toml"
    x = record_of([0.8], [0.3, 1.0], 0, 0.05, rows=800)
    rows = zip(x.time_s.tolist(), x.voltage_V.tolist(), x.displacement_um.tolist(), strict=True)
    record.write_text("time_s,flow,pressure\n" + "".join(f"{t!r},{u!r},{y!r}\n" for t, u, y in rows))
    words = [str(record), "--columns", "time_s,flow,pressure", "--units", "s,l/min,bar", "--template", "gain+lag"]
    assert main(["model", "fit", *words, "--out", str(out)]) == 0
    said = capsys.readouterr()
    assert "rms (bar)" in said.out
    assert "µm" not in said.out
    assert "has 1 µm for 1 bar and 1 V for 1 l/min of the record" in said.err
    told = json.loads(out.with_suffix(".json").read_text(encoding="utf-8"))
    assert (told["unit"], told["input_unit"]) == ("bar", "l/min")
    assert {y["name"]: y["unit"] for y in told["numbers"]}["gain"] == "bar/(l/min)"
    assert told["held_out_rms"] > 0.0
    assert told["held_out_rms_um"] is None


def test_readings_far_from_nought_get_a_model_all_the_same(tmp_path: Path):
    record = tmp_path / "far.csv"
    near = record_of([1.0], [0.05, 1.0], 0, 0.01, rows=400)
    write_record(record, Record(near.time_s, near.voltage_V, near.displacement_um - 5e6))
    words = ["model", "fit", str(record), "--template", "gain+lag", "--out", str(tmp_path / "m.toml")]
    assert main(words) == 0
    assert load_model(tmp_path / "m.toml").values()["calibration.offset"] == pytest.approx(-5e6, rel=1e-6)
    first = (tmp_path / "m.toml").read_bytes()
    assert main([*words, "--input-hold", "hold"]) == 0
    assert (tmp_path / "earlier" / "m.toml").read_bytes() == first
    assert {x.name for x in (tmp_path / "earlier").iterdir()} == {"m.toml", "m.fmu", "m.json"}


def still() -> Record:
    rng = np.random.default_rng(1)
    return Record(np.arange(200, dtype=np.float64) * 0.1, np.full(200, 5.0), rng.normal(0.0, 1.0, 200))


@pytest.mark.parametrize(
    ("record", "out", "said"),
    [
        (still(), "m.toml", r"excites nothing.*steps of several sizes"),
        (record_of([0.8], [0.3, 1.0], 3, 0.05, rows=100), "m.fmu", r"ends with \.toml"),
    ],
)
def test_a_record_that_excites_nothing_and_another_ending_are_refused(
    record: Record, out: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    write_record(tmp_path / "record.csv", record)
    assert main(["model", "fit", str(tmp_path / "record.csv"), "--out", str(tmp_path / out)]) == 2
    assert re.search(said, capsys.readouterr().err, re.S)
    assert [x.name for x in tmp_path.iterdir()] == ["record.csv"]


def test_a_nonlinear_part_is_said_with_what_both_leave_on_unseen_blocks():
    time_s = 0.05 * np.arange(600, dtype=np.float64)
    volts = 5.0 * np.repeat(np.random.default_rng(4).uniform(-1.0, 1.0, 60), 10)
    beyond = np.sign(volts) * np.maximum(np.abs(volts) - 1.5, 0.0)
    noise = 0.02 * np.random.default_rng(5).standard_normal(600)
    found = found_in(Record(time_s, volts, beyond + noise))
    assert found.rival is not None
    assert found.rival_rms < found.best.held_out_rms
    said = choice_sentence(found)
    assert f"{found.rival_rms:.4g} against {found.best.held_out_rms:.4g}" in said
    assert "not by the last column" not in said
    simplest = min(found.scores, key=lambda x: x.numbers)
    richer = replace(simplest, fits=tuple(replace(x, structure=Structure(lags=2)) for x in simplest.fits))
    beside = replace(found, scores=(simplest, richer), selected=richer)
    assert "not by the last column, where each stands alone" in choice_sentence(beside)


def levels(rows: int, seed: int, hold: int = 12) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.repeat(rng.uniform(-3.0, 3.0, rows), hold)[:rows]


def lagging(volts: np.ndarray, tau_s: float, step_s: float = ROW_S) -> np.ndarray:
    """A first-order lag of held inputs, read at the end of each row before the next input acts."""
    decay, y, read = math.exp(-step_s / tau_s), 0.0, []
    for u in volts:
        read.append(y)
        y = decay * y + (1.0 - decay) * u
    return np.array(read)


def linear_record(volts: np.ndarray, read: np.ndarray, noise: float, step_s: float = ROW_S) -> Record:
    rng = np.random.default_rng(11)
    return Record(step_s * np.arange(volts.size, dtype=np.float64), volts, read + rng.normal(0.0, noise, read.size))


def test_candidates_come_best_first_and_the_first_one_is_the_device():
    volts = levels(500, 3)
    late = np.concatenate([np.zeros(4), lagging(volts, 0.3)])[: volts.size]
    found = linear_structures(linear_record(volts, 2.0 * late + 5.0, 0.02))
    assert found[0].structure == Structure(lags=1, delay=True)
    values = found[0].model.values()
    assert values["plant_lag.time_constant"] == pytest.approx(0.3, rel=0.03)
    assert values["transport_delay.delay"] == pytest.approx(4 * ROW_S, abs=0.3 * ROW_S)
    others = [x.unseen_rms for x in found[1:]]
    assert others == sorted(others)
    assert found[-1].structure == Structure()
    assert all(len(x.losses) == len(found[0].losses) for x in found)


@pytest.mark.slow
def test_dead_time_is_found_in_a_record_that_starts_in_motion():
    # the first rows belong to inputs that no row shows
    volts = 5.0 + levels(460, 5)
    late = np.concatenate([np.full(9, 5.0), lagging(volts, 0.2)])[: volts.size]
    late[:9] = 4.0
    found = linear_structures(linear_record(volts[60:], late[60:], 0.02))
    assert found[0].structure.delay
    assert found[0].model.values()["transport_delay.delay"] == pytest.approx(9 * ROW_S, abs=0.5 * ROW_S)


@pytest.mark.parametrize("warm", [False, True], ids=["at rest", "in motion"])
def test_a_slow_device_whose_first_command_acts_already_began_where_its_readings_say(warm: bool):
    rng = np.random.default_rng(6)
    power = np.repeat(rng.uniform(0.0, 100.0, 25), 20)
    before = 70.0 if warm else 0.0
    times_s = 2.0 * np.arange(power.size, dtype=np.float64)
    rise = lsim(TransferFunction([0.6], [45.0, 1.0]), power, times_s, interp=False)[1]
    readings = 22.0 + rise + 0.6 * before * np.exp(-times_s / 45.0) + rng.normal(0.0, 0.1, power.size)
    experiments = experiments_of([Record(times_s, power, readings)], ["heater"], "hold")
    assert experiments[0].in_motion is warm
    if not warm:
        chosen = first_model(experiments).chosen
        assert chosen.structure == Structure(lags=1)
        assert chosen.values[0] == pytest.approx(45.0, abs=0.3)
        assert chosen.offsets[0] == pytest.approx(22.0, abs=0.2)


@pytest.mark.slow
def test_a_spring_that_stiffens_is_likelier_than_a_second_mode():
    rng, step_s, omega = np.random.default_rng(2), 0.01, 2.0 * math.pi * 4.0
    volts = np.repeat(rng.uniform(-1.0, 1.0, 120), 5)
    read, state = [], np.zeros(2)
    for u in volts:
        read.append(state[0])

        def rates(_: float, s: np.ndarray, u: float = u) -> list[float]:
            return [s[1], -2 * 0.05 * omega * s[1] - omega**2 * (s[0] + 0.8 * s[0] ** 3 - u)]

        state = solve_ivp(rates, (0.0, step_s), state, rtol=1e-7, atol=1e-9).y[:, -1]
    record = linear_record(volts, np.array(read), 0.01, step_s)
    found = first_model([experiment_of(record, "duffing", Settings())])
    assert found.rival is not None
    assert found.rival.effect == "stiffening"
    assert found.chosen.structure == Structure(modes=1)
    assert found.rival.part["cubic_1_per_um2"] > 0.0


@pytest.mark.slow
def test_a_spring_that_has_raised_the_frequency_by_a_third_is_seen_in_a_sweep():
    rng, step_s, omega = np.random.default_rng(3), 0.001, 2.0 * math.pi * 20.0
    time_s = step_s * np.arange(3000)
    volts = np.sin(2.0 * math.pi * (2.0 * time_s + 9.0 * time_s**2))
    read, place, speed = [], 0.0, 0.0
    for u in volts:
        read.append(place)
        for _ in range(20):
            speed += 5e-5 * (omega**2 * (2.0 * u - place - 0.15 * place**3) - 0.5 * omega * speed)
            place += 5e-5 * speed
    readings = np.array(read) + 0.005 * rng.standard_normal(time_s.size)
    found = first_model([experiment_of(linear_record(volts, readings, 0.005, step_s), "sweep", Settings())])
    assert found.rival is not None
    assert found.rival.effect == "stiffening"
    assert found.chosen.structure == Structure(modes=1)


@pytest.mark.slow
def test_a_reading_without_sign_hides_its_lag_and_is_no_reason_to_refuse():
    volts = np.where(levels(500, 8, 20) > 0.0, 1.5, -1.5)
    read = np.abs(lagging(volts, 0.25))
    experiment = experiment_of(linear_record(volts, read, 0.01), "counter", Settings(), any_answer=True)
    found = first_model([experiment])
    assert found.rival is not None
    assert found.rival.effect == "fold"
    hidden = [x for x in linear_structures(linear_record(volts, read, 0.01)) if x.hidden_behind]
    assert [x.hidden_behind for x in hidden] == ["fold"]
    assert hidden[0].model.values()["plant_lag.time_constant"] == pytest.approx(0.25, rel=0.1)


@pytest.mark.slow
def test_a_lag_and_a_delay_behind_a_loop_of_an_actuator_in_use_are_told_apart():
    """Preisach's relays that all fall at 0 V, a lag of 50 ms, a delay of 40 ms, by numbers of their own."""
    up, down = np.meshgrid(np.linspace(0.02, 1.0, 30), np.linspace(0.01, 0.97, 30), indexing="ij")
    weight = np.where(up > down, np.exp(-4.0 * (up - down)) * np.exp(0.4 * (up + down)), 0.0)
    share = 0.4 / weight.sum()
    levels_V = np.repeat([0.0, 30.0, 60.0, 90.0, 60.0, 30.0, 0.0], 500)
    cycles = np.concatenate([np.tile(100.0 * np.abs(np.linspace(-1.0, 1.0, n, endpoint=False)), 8) for n in (200, 60)])
    volts = np.concatenate([levels_V, 100.0 - cycles])
    is_up, answer = np.zeros_like(up, dtype=bool), np.empty(volts.size)
    for k, x in enumerate(volts / 100.0):
        is_up = (is_up | (x >= up)) & (x > down)
        answer[k] = 0.6 * x + share * float(weight[is_up].sum())
    parts = 40
    fine, faded = np.repeat(answer, parts), math.exp(-1e-3 / 0.05)
    read, late = np.empty(fine.size), 0.0
    for k, x in enumerate(fine):
        late = faded * late + (1.0 - faded) * x
        read[k] = late
    read = 50.0 * np.concatenate([np.zeros(41), read])[: fine.size : parts]
    read += 0.03 * np.random.default_rng(2).standard_normal(read.size)
    record = Record(0.04 * np.arange(volts.size, dtype=np.float64), volts, read)
    found = found_in(record)
    assert found.loop is not None
    assert found.chosen.structure == Structure(lags=1, delay=True)
    assert found.chosen.values == pytest.approx((0.05, 0.04), rel=0.1)
    # it is the first of those that compete
    (looped,) = (x for x in linear_structures(record) if x.behind_a_loop)
    assert looped.structure == Structure(lags=1, delay=True)
    competing = competing_structures([record], DiagnoseSettings())
    assert competing[0].model.values()["plant_lag.time_constant"] == pytest.approx(0.05, rel=0.1)


@pytest.mark.parametrize("hold", ["hold", "linear"])
def test_excerpts_are_short_and_keep_what_the_rows_show(hold):
    rows = 30_000
    time_s = 1e-3 * np.arange(rows, dtype=np.float64)
    volts = np.sin(2.0 * math.pi * 0.7 * time_s) * np.exp(-((time_s - 20.0) ** 2) / 20.0)
    read = lsim(TransferFunction([1.0], [0.05, 1.0]), volts, time_s)[1]
    whole = experiment_of(Record(time_s, volts, read), "long", Settings(), hold)
    parts = excerpts([whole])
    assert sum(x.time_s.size for x in parts) <= 1.1 * MOST_ROWS
    assert all(np.all(np.diff(x.time_s) > 0.0) for x in parts)
    # what moves shows
    counted = np.concatenate([x.measured_um[x.fitted | x.held_out] for x in parts])
    assert np.std(counted) > 0.9 * np.std(read)
    assert excerpts([parts[0]]) == [parts[0]]


def test_two_equal_lags_are_no_mode_at_its_largest_damping():
    rng = np.random.default_rng(8)
    volts = np.concatenate([[0.0], levels(799, 8)])
    time_s = 0.05 * np.arange(volts.size, dtype=np.float64)
    read = lsim(TransferFunction([1.0], [0.09, 0.6, 1.0]), volts, time_s, interp=False)[1]
    found = linear_structures(linear_record(volts, read + 0.01 * rng.standard_normal(read.size), 0.05))
    of_order_two = [x for x in found if x.structure.order == 2 and not x.structure.delay]
    assert {x.structure.name: x.rings for x in of_order_two} == {"gain+lag+lag": True, "gain+mode": False}


def lag_and_mode() -> tuple[np.ndarray, np.ndarray]:
    omega = 2.0 * np.pi * 3.0
    return np.array([omega**2]), np.polymul([0.2, 1.0], [1.0, 2.0 * 0.1 * omega, omega**2])


def two_modes() -> tuple[np.ndarray, np.ndarray]:
    """Modes of 3 and 8 Hz; the second one has 0.4 of the answer."""
    parts = [
        (np.array([part * w**2]), np.array([1.0, 2.0 * zeta * w, w**2]))
        for w, zeta, part in ((2.0 * np.pi * 3.0, 0.1, 0.6), (2.0 * np.pi * 8.0, 0.05, 0.4))
    ]
    (b1, a1), (b2, a2) = parts
    return np.polyadd(np.polymul(b1, a2), np.polymul(b2, a1)), np.polymul(a1, a2)


@pytest.mark.parametrize(
    ("structure", "system", "values"),
    [
        (Structure(lags=1, modes=1, delay=True), lag_and_mode(), (0.2, 3.0, 0.1)),
        # a share is a guess
        (Structure(modes=2, delay=True), two_modes(), (8.0, 0.05, 3.0, 0.1, 0.1)),
    ],
)
def test_a_start_has_the_roots_of_a_record_and_its_delay(structure, system, values):
    """The record is computed by another integrator."""
    experiment = experiment_of(record_of(*system, delay_rows=30, noise=0.0, rows=3000), "first", Settings())
    starts = list(frequency_starts(structure, experiment, np.arange(0.4, 0.8, ROW_S / 2)))
    nearest = min(starts, key=lambda x: abs(x[-1] - 30 * ROW_S))
    assert nearest == pytest.approx((*values, 30 * ROW_S), rel=0.1)


def test_a_short_record_has_no_response_and_a_gain_no_roots():
    short = Record(0.02 * np.arange(100.0), np.arange(100.0), np.arange(100.0))
    experiment = experiment_of(short, "first", Settings())
    assert response(experiment) is None
    assert list(frequency_starts(Structure(lags=1), experiment, np.zeros(1))) == []
    assert list(frequency_starts(Structure(), experiment, np.zeros(1))) == []
