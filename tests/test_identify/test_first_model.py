"""First models from records alone: structures, fits, the choice of the order, the command."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from few import few_rows
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import TransferFunction, lsim

from bender_cli.main import main
from bender_identify.first_model.choice import MOST_IN_VAIN, FirstModel, Scored, first_model, is_better, select
from bender_identify.first_model.fit import FirstFit, FitTask, from_search, to_search
from bender_identify.first_model.report import choice_sentence, doubt_sentence, explained_share, numbers, sentences
from bender_identify.first_model.structures import STRUCTURES, Structure
from bender_identify.records.experiment import experiment_of
from bender_identify.settings import Settings
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
    ranges = {"time": (1e-3, 10.0), "frequency": (0.2, 5.0), "damping": (0.01, 0.9), "share": (-0.9, 0.9)}
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


@pytest.mark.slow
def test_a_mode_without_delay_is_found():
    omega, zeta = 2.0 * math.pi * 3.0, 0.08
    found = found_in(record_of([omega**2], [1.0, 2.0 * zeta * omega, omega**2], 0, 0.1))
    assert found.chosen.structure == Structure(modes=1)
    assert found.chosen.values == pytest.approx((3.0, 0.08), rel=0.02)


def test_a_gain_stays_a_gain():
    found = found_in(record_of([1.0], [1e-6, 1.0], 0, 0.5))
    assert found.chosen.structure == Structure()
    assert found.chosen.gain == pytest.approx(1.0, abs=0.01)


@pytest.mark.slow
def test_a_negative_gain_is_one():
    found = found_in(record_of([-0.5], [0.2, 1.0], 0, 0.05))
    assert found.chosen.structure == Structure(lags=1)
    assert found.chosen.gain == pytest.approx(-0.5, rel=0.01)


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
    assert found.loop.held_out_rms < 0.5 * best.held_out_rms
    assert choice_sentence(found).startswith("a loop that does not depend on time (10 plays)")
    assert doubt_sentence(found) == ""
    assert sentences(found)[0] == "gain, order 0; without intervals"


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
    return Scored(fit, rms, rms, np.array(losses), weights)


def test_a_richer_structure_needs_more_than_one_standard_error_on_unseen_blocks():
    gain, lag = scored(Structure(), [1.0] * 18), scored(Structure(lags=1), [0.8] * 18)
    assert select([gain, lag]) is lag
    assert is_better(gain, lag)
    # as much on average, but in one block alone and hardly: 4 % of the rms
    lucky = scored(Structure(lags=1), [1.0] * 17 + [-0.4 + 1.0])
    assert select([gain, lucky]) is gain
    # however little chance there is in it, a hundredth is not worth a number
    hardly = scored(Structure(lags=1), [0.98] * 18)
    assert is_better(gain, hardly)
    assert select([gain, hardly]) is gain


@given(st.lists(st.floats(0.1, 10.0), min_size=6, max_size=18), st.floats(0.05, 0.8))
def test_a_slow_residual_is_evidence_in_every_block(losses: list[float], part: float):
    # whatever the size of the blocks, one that falls everywhere by a tenth and more of the rms is taken
    gain, lag = scored(Structure(), losses), scored(Structure(lags=1), [part * x for x in losses])
    assert select([gain, lag]) is lag


def test_a_simpler_structure_is_written_with_a_reason():
    gain, hardly = scored(Structure(), [1.0] * 18), scored(Structure(lags=1), [0.98] * 18)
    found = FirstModel(gain.fit, (gain, hardly), select([gain, hardly]), None)  # pyright: ignore
    assert "gain+lag" in choice_sentence(found)
    assert "gain is written" in choice_sentence(found)
    assert choice_sentence(FirstModel(hardly.fit, (gain, hardly), hardly, None)) == ""  # pyright: ignore


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


def test_a_record_that_excites_nothing_is_refused_with_what_to_play(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    record = tmp_path / "still.csv"
    rng = np.random.default_rng(1)
    write_record(record, Record(np.arange(200, dtype=np.float64) * 0.1, np.full(200, 5.0), rng.normal(0.0, 1.0, 200)))
    assert main(["model", "fit", str(record), "--out", str(tmp_path / "m.toml")]) == 2
    said = capsys.readouterr().err
    assert "excites nothing" in said
    assert "steps of several sizes" in said
    assert not (tmp_path / "m.toml").exists()


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


def test_another_ending_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    record = tmp_path / "record.csv"
    write_record(record, record_of([0.8], [0.3, 1.0], 3, 0.05, rows=100))
    assert main(["model", "fit", str(record), "--out", str(tmp_path / "m.fmu")]) == 2
    assert "ends with .toml" in capsys.readouterr().err


def test_a_nonlinear_part_is_said_with_what_both_leave_on_the_same_rows():
    time_s = 0.05 * np.arange(600, dtype=np.float64)
    volts = 5.0 * np.repeat(np.random.default_rng(4).uniform(-1.0, 1.0, 60), 10)
    beyond = np.sign(volts) * np.maximum(np.abs(volts) - 1.5, 0.0)
    noise = 0.02 * np.random.default_rng(5).standard_normal(600)
    found = found_in(Record(time_s, volts, beyond + noise))
    assert found.rival is not None
    assert found.rival.held_out_rms < found.beside_rms
    said = choice_sentence(found)
    assert f"{found.rival.held_out_rms:.3g} against {found.beside_rms:.3g}" in said
