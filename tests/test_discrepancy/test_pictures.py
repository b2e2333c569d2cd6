"""Pictures of effects and records: against closed forms, every view drawn once, the same in any process."""

import subprocess
from dataclasses import replace

import numpy as np
import pytest
from few import few
from reported_diagnosis import NOISE_um, hypothesis, record_of, told

from bender_compiled.parallel_map import THREADS
from bender_discrepancy.conclusion.findings import find
from bender_discrepancy.report.chart_process import BESIDE, CHARTS, ChartProcess, charts_of
from bender_discrepancy.report.effect_pictures import components
from bender_discrepancy.report.pictured_record import PicturedRecord
from bender_discrepancy.report.residual_pictures import over_frequency
from bender_discrepancy.report.signature.drives import simulate
from bender_discrepancy.report.signature.picture import draw_signature
from bender_discrepancy.report.signature.views import VIEWS, amplitude_spectrum, response
from bender_effects.catalogue import EFFECTS, FULL_VOLTAGE_V, FULL_STROKE_um
from bender_plant.model import load_model
from bender_report.chart import bulk_limits
from bender_report.wording import shown_in

GAIN_um_per_V = FULL_STROKE_um / FULL_VOLTAGE_V


@pytest.mark.parametrize("effect_id", few(EFFECTS, *range(0, 36, 5)))
def test_every_effect_shows_under_its_drive(effect_id: str):
    signature = simulate(EFFECTS[effect_id])
    assert signature.comparison.before.rms_um > signature.drive.noise_um
    if EFFECTS[effect_id].stage == "calibration":
        assert signature.comparison.recalibrated.rms_um < 1e-9
    else:
        assert np.max(np.abs(signature.residual_um)) > 2.0 * signature.drive.noise_um


@pytest.mark.parametrize("value", [0.0, -3.0, 1e9, 1e-310])
def test_an_axis_of_what_stands_still_has_a_length(value: float):
    low, high = bulk_limits(np.full(20, value))
    assert low < value < high


def test_a_delay_turns_the_phase_and_keeps_the_gain():
    signature = simulate(EFFECTS["transport_delay"])
    frequency_Hz, late = response(signature, signature.with_um, signature.drive.parts[0])
    _, prompt = response(signature, signature.without_um, signature.drive.parts[0])
    turned = np.unwrap(np.angle(late / prompt))
    assert np.allclose(np.abs(late), GAIN_um_per_V, rtol=0.02)
    assert np.allclose(turned, -2.0 * np.pi * frequency_Hz * 0.05, atol=0.06)


def test_a_lag_is_of_first_order():
    signature = simulate(EFFECTS["source_resistance"])
    frequency_Hz, found = response(signature, signature.with_um, signature.drive.parts[0])
    expected = GAIN_um_per_V / (1.0 + 2j * np.pi * frequency_Hz * 0.02)
    assert np.allclose(found, expected, rtol=0.03)


def test_electrostriction_leaves_its_parabola():
    signature = simulate(EFFECTS["electrostriction"])
    coefficient = EFFECTS["electrostriction"].example["coefficient_um_per_V2"]
    difference = signature.with_um - signature.without_um
    assert np.allclose(difference, coefficient * signature.drive.acting_V**2, atol=5e-3)


def test_hum_is_seen_at_its_alias():
    signature = simulate(EFFECTS["periodic_disturbance"])
    frequency_Hz, amplitude_um = amplitude_spectrum(signature.residual_um, signature.drive.time_s)
    assert frequency_Hz[np.argmax(amplitude_um)] == pytest.approx(60.0 - 2.0 * 29.97, abs=0.006)


def test_an_amplitude_spectrum_gives_the_amplitude():
    time_s = np.arange(1000) / 100.0
    frequency_Hz, amplitude_um = amplitude_spectrum(3.0 + 0.7 * np.sin(2.0 * np.pi * 5.0 * time_s), time_s)
    assert frequency_Hz[np.argmax(amplitude_um)] == pytest.approx(5.0)
    assert amplitude_um.max() == pytest.approx(0.7, rel=1e-3)


@pytest.mark.parametrize("view", few(VIEWS, 0))
def test_every_view_is_used_and_drawn(view: str):
    effect = next(effect for effect in EFFECTS.values() if effect.view == view)
    assert draw_signature(effect, simulate(effect)).startswith(b"\x89PNG")


PAPER = load_model("paper")


@pytest.mark.parametrize("gain", [1.0, 0.8])
def test_what_is_left_beside_what_an_effect_adds_is_noise(gain: float) -> None:
    effects = {"source_resistance": {"time_constant_s": 0.06}, "backlash": {"half_width_um": 1.5}}
    record = record_of(effects=effects, gain=gain, offset_um=2.0)
    best = hypothesis(PAPER, [record], ("source_resistance", (0.06,)), ("backlash", (1.5,)))
    found = components(find(told([record], best)), 0)
    assert [x.id for x in found] == ["source_resistance", "backlash"]
    for x in found:
        left = x.left_um - x.added_um
        assert np.std(left[np.isfinite(left)]) == pytest.approx(NOISE_um, rel=0.15)
        np.testing.assert_allclose(x.without_um + x.added_um, found[0].without_um + found[0].added_um, atol=1e-9)
        assert np.std(x.added_um) > 3.0 * NOISE_um


ROWS = 400


def pictured() -> PicturedRecord:
    """A record with a gap that a half of it closes."""
    rng, time_s = np.random.default_rng(4), np.arange(ROWS) / 30.0
    volts = 25.0 + 20.0 * np.sin(time_s)
    given = 0.4 * volts
    measured = given + 0.5 * np.cos(time_s) + 0.05 * rng.standard_normal(ROWS)
    return PicturedRecord(
        "record", time_s, "time (s)", volts, np.cos(time_s) > 0.0, measured, given, given, given + 0.4 * np.cos(time_s),
        np.arange(ROWS) % 100 > 60, 0.05, corrected=True,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("units", few([("V", "um"), ("bar", "rpm")], 0))
def test_the_charts_are_the_same_whoever_draws_them(units: tuple[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(THREADS, "2")
    with shown_in(*units):
        alone = charts_of(pictured())
        with ChartProcess() as other:
            other.begin()
            other.begin()
            together = charts_of(pictured(), other)
    assert list(together) == list(alone) == list(CHARTS)
    assert together == alone
    loop = together["loop"]
    assert loop is not None
    assert units[0] in loop.wide
    assert ("rpm" in loop.wide) is (units[1] == "rpm")


def test_what_is_met_exactly_has_no_spectrum() -> None:
    met = replace(pictured(), corrected=False)
    assert over_frequency(met) is not None
    met = replace(met, measured_um=met.given_um, noise_um=0.0)
    assert over_frequency(met) is None


def test_one_core_draws_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(THREADS, "1")
    with ChartProcess() as other:
        other.begin()
        assert not other.ask(pictured(), BESIDE)
        assert other.drawn() == {}


def test_where_no_process_can_be_begun_this_one_draws_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(THREADS, "2")

    def none_left(*_: object, **__: object) -> None:
        raise BlockingIOError("no more processes")

    monkeypatch.setattr(subprocess, "Popen", none_left)
    with ChartProcess() as other:
        other.begin()
        assert set(charts_of(pictured(), other)) == set(CHARTS)
