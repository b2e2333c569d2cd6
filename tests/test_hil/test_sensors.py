"""Sensors that are no camera, oscilloscopes among them: their words, calibration, and what the loop sees."""

import json
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from emulated_bench import ScriptedLink, wait_for
from hypothesis import given
from hypothesis import strategies as st
from present import present

from bender_cli.main import main
from bender_emulator.sensors.scope import SCOPE_INSTRUMENTS
from bender_emulator.sensors.settings import SCOPES as EMULATED
from bender_emulator.sensors.settings import SensorEmulation
from bender_emulator.sensors.transducer import Transducer
from bender_emulator.servers import TcpServer
from bender_hil.calibration.sensor_scale import BEYOND, SensorCalibration, fit_sensor
from bender_hil.runner.picture_checks import NoiseCheck
from bender_hil.runner.program import Decision
from bender_hil.runner.tip_camera import Sight
from bender_hil.sensors import sensor_eyes
from bender_hil.sensors.meter_dialect import METERS
from bender_hil.sensors.multimeter import Multimeter, MultimeterSettings
from bender_hil.sensors.oscilloscope import Oscilloscope, OscilloscopeSettings
from bender_hil.sensors.pace import Pace
from bender_hil.sensors.scope_dialect import SCOPES, numbers
from bender_hil.sensors.sensor import Reading
from bender_hil.sensors.sensor_eyes import NoSensorError, SensorEyes
from bender_hil.sensors.table import SensorTable, conversion
from bender_hil.sensors.text_line import TextLineSettings
from bender_hil.supply.failures import BadReplyError, ComplaintError, MismatchError, NoReplyError, WrongInstrumentError
from bender_hil.supply.parse import Identity
from bender_loop.errors import InputError, RunError

IDN_34465 = ("*IDN?", "Keysight Technologies,34465A,MY57500001,A.03.03-03.15-03.03-00.52-04-03")
SETTINGS = MultimeterSettings("ASRL1::INSTR", "34465A", aperture_s=0.02)
ARM_34465 = [
    IDN_34465, ("*RST", None), ("*CLS", None), ("CONF:VOLT:DC 10", None), ("VOLT:DC:APER 0.02", None),
    ("VOLT:DC:ZERO:AUTO OFF", None), ("TRIG:SOUR IMM", None), ("TRIG:DEL 0", None), ("SAMP:COUN 1", None),
    ("SYST:ERR?", '+0,"No error"'), ("VOLT:DC:APER?", "+2.00000000E-02"),
]  # fmt: skip


def _meter(dialogue: list[tuple[str, str | None]]) -> tuple[Multimeter, ScriptedLink]:
    link = ScriptedLink(dialogue)
    return Multimeter(link, METERS["34465A"], SETTINGS, 30.0), link


def test_a_multimeter_is_set_up_and_triggered():
    meter, link = _meter([*ARM_34465, ("READ?", "+1.25000000E+00"), ("READ?", "+9.90000000E+37")])
    assert meter.open().serial == "MY57500001"
    before_s = time.perf_counter()
    first, second = meter.read(1.0), meter.read(1.0)
    assert first is not None
    assert second is not None
    assert (first.value, first.lost) == (1.25, None)
    assert before_s <= first.time_s - 0.01
    assert "range of 10 V" in str(second.lost)
    link.finish()


@pytest.mark.parametrize(
    ("place", "answer", "error"),
    [
        (0, "ACME,34465A,1,1", WrongInstrumentError),
        (0, "Keysight Technologies,34461A,MY5,1", WrongInstrumentError),
        (9, '-222,"Data out of range"', ComplaintError),
        (10, "+1.00000000E-01", MismatchError),
    ],
)
def test_a_multimeter_that_is_another_or_does_not_obey_is_refused(place: int, answer: str, error: type[Exception]):
    meter, _ = _meter([*ARM_34465[:place], (ARM_34465[place][0], answer)])
    with pytest.raises(error):
        meter.open()


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (
            lambda: SensorTable("multimeter", MultimeterSettings("ASRL1::INSTR", aperture_s=0.05), rate_Hz=30.0),
            "rate_Hz",
        ),
        (lambda: OscilloscopeSettings("ASRL1::INSTR", aperture_s=0.05).make(30.0), "rate_Hz"),
        (lambda: TextLineSettings("ASRL1::INSTR", pattern=r"\d+"), "group"),
    ],
)
def test_a_record_longer_than_the_time_between_readings_and_a_pattern_without_a_group_are_refused(
    make: Callable[[], object], words: str
):
    with pytest.raises(ValueError, match=words):
        make()


@pytest.mark.parametrize(("unit", "factor"), [("um", 1.0), ("nm", 1e-3), ("mm", 1e3), ("m", 1e6)])
def test_lengths_need_no_calibration(unit: str, factor: float):
    assert conversion(unit, None)(2.0) == pytest.approx(2.0 * factor)


def test_volts_need_a_calibration_and_one_for_volts():
    with pytest.raises(ValueError, match="calibrate --sensor"):
        conversion("V", None)
    with pytest.raises(ValueError, match="is for mA"):
        conversion("V", fit_sensor([4.0, 20.0], [0.0, 100.0], "mA"))


@given(
    low=st.floats(-100.0, 100.0),
    span=st.floats(0.01, 100.0),
    ends_um=st.tuples(st.floats(-1e3, 1e3), st.floats(1.0, 1e3), st.booleans()),
)
def test_two_points_make_the_line_through_them(low: float, span: float, ends_um: tuple[float, float, bool]):
    first_um, far_um, falls = ends_um
    second_um = first_um - far_um if falls else first_um + far_um
    fit = fit_sensor([low, low + span], [first_um, second_um], "V", reference_um=0.1)
    assert fit.to_um(low) == pytest.approx(first_um, abs=1e-6)
    assert fit.to_um(low + 0.25 * span) == pytest.approx(first_um + 0.25 * (second_um - first_um), abs=1e-5)
    assert fit.uncertainty_um(low) == pytest.approx(0.1)
    assert np.isnan(fit.to_um(low - 0.1 * span))


def test_the_uncertainty_of_a_table_is_that_of_ordinary_least_squares():
    rng = np.random.default_rng(7)
    volts = np.linspace(0.5, 4.5, 40)
    places_um = 25.0 * volts - 3.0 + 0.2 * rng.standard_normal(40)
    fit = fit_sensor(volts.tolist(), places_um.tolist(), "V")
    # an oracle of its own: numpy's polyfit on the raw readings, its covariance scaled by the same residuals
    (slope, offset), covariance = np.polyfit(volts, places_um, 1, cov=True)
    for reading in (0.5, 2.0, 4.5):
        powers = np.array([reading, 1.0])
        assert fit.to_um(reading) == pytest.approx(slope * reading + offset)
        assert fit.uncertainty_um(reading) == pytest.approx(np.sqrt(powers @ covariance @ powers), rel=1e-6)


def test_a_curve_that_turns_back_is_no_calibration():
    with pytest.raises(ValueError, match="turns back"):
        fit_sensor([0.0, 1.0, 2.0, 3.0], [0.0, 2.0, 2.1, 0.0], "V", degree=2)
    with pytest.raises(ValueError, match="different readings"):
        fit_sensor([1.0, 1.0], [0.0, 5.0], "V")


def test_a_calibration_comes_back_from_its_file(tmp_path):
    fit = fit_sensor([0.0, 1.0, 2.0], [0.0, 10.1, 19.9], "V", degree=2, reference_um=0.05, source="gauge blocks")
    fit.save(tmp_path / "sensor.toml")
    assert SensorCalibration.load(tmp_path / "sensor.toml") == fit
    (tmp_path / "sensor.toml").write_text("[sensor_calibration]\nlow = 1\n")
    with pytest.raises(InputError, match=r"sensor\.toml"):
        SensorCalibration.load(tmp_path / "sensor.toml")


@dataclass
class Scripted:
    """A sensor that gives what it is told to, 200 times a second if not told otherwise."""

    values: list[float]
    unit: str = "um"
    cannot: tuple[str, ...] = ()
    serials: list[str] = field(default_factory=lambda: ["1"])
    fails_at: int = -1
    blocks_at: int = -1
    pause_s: float = 0.005
    gone_after: int = -1
    count: int = 0
    opened: int = 0

    def open(self) -> Identity:
        if 0 <= self.gone_after <= self.opened:
            raise ValueError("gone")
        self.opened += 1
        return Identity("me", "scripted", self.serials[min(self.opened, len(self.serials)) - 1], "1")

    def read(self, timeout_s: float) -> Reading | None:
        time.sleep(self.pause_s)
        self.count += 1
        if self.count == self.fails_at:
            raise OSError("cable")
        if self.blocks_at >= 0 and self.count >= self.blocks_at:
            time.sleep(timeout_s)
            return None
        return Reading(self.values[min(self.count, len(self.values)) - 1], time.perf_counter())

    def close(self) -> None:
        """Nothing is open."""


def _noisy(count: int, level: float = 5.0) -> list[float]:
    return (level + 0.01 * np.random.default_rng(1).standard_normal(count)).tolist()


def _last(eyes: SensorEyes, seconds: float = 0.5) -> Sight:
    sight, end_s = None, time.perf_counter() + seconds
    while time.perf_counter() < end_s:
        sight = eyes.look(0.05) or sight
    return present(sight)


def test_displacements_count_from_the_rest_position():
    with SensorEyes(Scripted([*_noisy(20), *_noisy(500, 12.0)]), lambda value: value) as eyes:
        eyes.zero(10)
        assert eyes.noise_um == pytest.approx(0.01, abs=0.006)
        assert _last(eyes).tip_um == pytest.approx(7.0, abs=0.1)


def test_a_sensor_that_says_the_same_for_ever_is_frozen():
    with SensorEyes(Scripted([*_noisy(20), 5.0]), lambda value: value) as eyes:
        eyes.zero(10)
        assert _last(eyes).frozen > 2
    with SensorEyes(Scripted([5.0]), lambda value: value) as eyes, pytest.raises(RunError, match="repeats_count"):
        eyes.zero(10)
    with SensorEyes(Scripted([5.0]), lambda value: value, repeats_count=True) as eyes:
        eyes.zero(10)
        assert _last(eyes).frozen == 0


def test_a_coarse_sensor_may_repeat_itself_while_the_rest_position_is_taken():
    with SensorEyes(Scripted([*[5.0] * 30, 5.1, *_noisy(500)]), lambda value: value) as eyes:
        eyes.zero(5)
        assert eyes.noise_um > 0.0
        assert abs(_last(eyes, 0.05).tip_um or 1.0) < 0.1


def test_a_sensor_that_repeats_itself_is_given_up_in_time(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(sensor_eyes, "_WAITED_FOR_S", 0.1)
    with SensorEyes(Scripted([5.0]), lambda value: value) as eyes, pytest.raises(RunError, match="all") as refused:
        eyes.zero(100)
    assert int(str(refused.value).split()[3]) < 400


def test_a_slow_sensor_is_not_a_silent_one(monkeypatch: pytest.MonkeyPatch):
    """Twelve readings take longer than what a silent sensor is given."""
    monkeypatch.setattr(sensor_eyes, "_FIRST_READING_S", 0.6)
    with SensorEyes(Scripted(_noisy(50), pause_s=0.1), lambda value: value) as eyes:
        eyes.zero(12)
    with SensorEyes(Scripted(_noisy(50), blocks_at=5), lambda value: value) as eyes, pytest.raises(RunError, match="4"):
        eyes.zero(12)


def test_what_is_outside_the_valid_range_or_the_calibration_is_no_tip():
    with SensorEyes(Scripted([*_noisy(20), 99.0]), lambda value: value, (0.0, 50.0)) as eyes:
        eyes.zero(10)
        sight = _last(eyes)
        assert sight.tip_um is None
        assert "valid range" in str(sight.lost)
    to_um = fit_sensor([0.0, 10.0], [0.0, 10.0], "um").to_um
    with SensorEyes(Scripted([*_noisy(20), 99.0]), to_um) as eyes:
        eyes.zero(10)
        assert "calibration" in str(_last(eyes).lost)


def test_a_sensor_that_fails_is_opened_anew():
    with SensorEyes(Scripted(_noisy(500), fails_at=15), lambda value: value) as eyes:
        eyes.zero(10)
        assert _last(eyes).tip_um is not None
        assert eyes.reopened == 1


@pytest.mark.parametrize(
    ("found", "sentence"),
    [
        (5.0, "read gave 5.0, expected a Reading or None"),
        (Reading("5.0", 0.0), "expected numbers for value and time_s"),  # pyright: ignore[reportArgumentType]
        (Reading(5.0, 1e12), "expected a time of time.perf_counter"),
    ],
)
def test_what_is_no_reading_is_told_and_not_used(found: Any, sentence: str):
    sensor = Scripted(_noisy(500))
    with SensorEyes(sensor, lambda value: value) as eyes:
        eyes.zero(5)
        sensor.read = lambda timeout_s: found  # pyright: ignore[reportAttributeAccessIssue]
        wait_for(lambda: sentence in eyes.trouble())
        wait_for(lambda: eyes.look(0.0) is None)
        assert eyes.look(0.2) is None
        del sensor.read  # pyright: ignore[reportAttributeAccessIssue]
        wait_for(lambda: eyes.look(0.1) is not None)
        assert eyes.trouble() == ""


def test_a_sensor_that_stays_away_says_why_it_failed_and_why_it_cannot_be_opened():
    sensor = Scripted(_noisy(500), fails_at=15, gone_after=1)
    with SensorEyes(sensor, lambda value: value) as eyes:
        eyes.zero(5)
        wait_for(lambda: eyes.trouble() == "cable; it cannot be opened anew: ValueError: gone")


def test_a_sensor_that_cannot_be_opened_is_named():
    sensor = Scripted([], gone_after=0)
    with pytest.raises(NoSensorError, match=r"laser \(here\): .*ValueError: gone; is it switched on"):
        SensorEyes(sensor, lambda value: value, name="laser (here)").__enter__()


def test_another_sensor_at_the_address_is_not_believed():
    sensor = Scripted(_noisy(500), fails_at=15, serials=["1", "2"])
    with SensorEyes(sensor, lambda value: value) as eyes:
        eyes.zero(10)
        _last(eyes)
        assert eyes.reopened == 0
        assert eyes.stalled_s() > 0.2


def test_a_sensor_that_blocks_has_stalled():
    with SensorEyes(Scripted(_noisy(500), blocks_at=15), lambda value: value) as eyes:
        eyes.zero(10)
        time.sleep(0.3)
        assert eyes.stalled_s() > 0.2


def test_readings_that_nobody_fetched_are_counted():
    with SensorEyes(Scripted(_noisy(500)), lambda value: value) as eyes:
        eyes.zero(5)
        eyes.look(0.1)
        time.sleep(0.2)
        assert present(eyes.look(0.1)).skipped > 3


def test_deadlines_that_have_passed_are_skipped():
    pace = Pace(50.0)
    assert pace.wait(0.1)
    time.sleep(0.09)
    start_s = time.perf_counter()
    assert pace.wait(0.1)
    assert pace.wait(0.1)
    assert time.perf_counter() - start_s < 0.045
    assert not Pace(0.5).wait(0.0) or not pace.wait(0.0)


@pytest.mark.parametrize(
    ("scatter_um", "to_and_fro_V", "ends"),
    [(0.02, 0.0, False), (3.0, 0.0, True), (3.0, 0.5, True), (3.0, -0.5, True), (3.0, 0.51, False), (3.0, -0.6, False)],
)
def test_readings_that_scatter_while_the_command_stays_within_half_a_volt_end_the_run(
    scatter_um: float, to_and_fro_V: float, ends: bool
):
    check = NoiseCheck(55.0, lambda: 0.02)
    rng = np.random.default_rng(3)
    trips = []
    for tick in range(100):
        tip_um = 20.0 + scatter_um * float(rng.standard_normal())
        sight = Sight(tick, 0.033 * tick, 0, tip_um, 1.0, None, None)
        trips.append(check.see(sight, Decision(30.0 + to_and_fro_V * (tick // 10 % 2), None)))
    assert any(trips) == ends


def test_a_moving_tip_does_not_scatter():
    check = NoiseCheck(55.0, lambda: 0.02)
    for tick in range(300):
        time_s = 0.033 * tick
        sight = Sight(tick, time_s, 0, 10.0 + 10.0 * np.sin(2.0 * np.pi * 0.5 * time_s), 1.0, None, None)
        assert check.see(sight, Decision(25.0 + 25.0 * np.sin(2.0 * np.pi * 0.5 * time_s), None)) is None


pytest.importorskip("pyvisa_py", reason="needs the extra bench")

PITAYA, DSOX = OscilloscopeSettings("ASRL1::INSTR"), OscilloscopeSettings("ASRL1::INSTR", "DSOX", 2, 5.0)
ARM = {
    "RedPitaya": [
        ("*IDN?", "REDPITAYA,INSTR2024,0,01-02"), ("*CLS", None), ("ACQ:RST", None), ("ACQ:DEC 8192", None),
        ("ACQ:AVG ON", None), ("ACQ:DATA:FORMAT ASCII", None), ("ACQ:DATA:UNITS VOLTS", None),
        ("ACQ:SOUR1:GAIN HV", None), ("ACQ:TRIG:DLY -8039", None), ("SYST:ERR?", '0,"No error"'),
    ],
    "DSOX": [
        ("*IDN?", "KEYSIGHT TECHNOLOGIES,DSO-X 3024A,MY5,02.41"), ("*RST", None), ("*CLS", None),
        (":CHAN2:DISP ON", None), (":CHAN2:COUP DC", None), (":CHAN2:OFFS 0", None), (":CHAN2:RANG 10", None),
        (":TIM:MODE MAIN", None), (":TIM:REF LEFT", None), (":TIM:POS 0", None), (":TIM:RANG 0.01", None),
        (":TRIG:SWE NORM", None), (":SYST:ERR?", '+0,"No error"'),
    ],
}  # fmt: skip
TRIGGERED = {
    "RedPitaya": [("ACQ:START", None), ("ACQ:TRIG NOW", None), ("ACQ:TRIG:FILL?", "0"), ("ACQ:TRIG:FILL?", "1")],
    "DSOX": [(":SING", None), (":TRIG:FORC", None), (":OPER:COND?", "40"), (":OPER:COND?", "32")],
}
READ = {"RedPitaya": "ACQ:SOUR1:DATA:LAT:N? 153", "DSOX": ":MEAS:VAV? DISP,CHAN2"}


def _scope(model: str, *more: tuple[str, str | None]) -> tuple[Oscilloscope, ScriptedLink]:
    link = ScriptedLink([*ARM[model], *more])
    return Oscilloscope(link, SCOPES[model], PITAYA if model == "RedPitaya" else DSOX, 30.0), link


@pytest.mark.parametrize(
    ("model", "answer", "value", "is_lost"),
    [
        ("RedPitaya", "{1.0,2.0,  3.0}", 2.0, False),
        ("RedPitaya", "{1.0,19.9,3.0}", None, True),
        ("RedPitaya", "{1.0,-20,3.0}", None, True),
        ("DSOX", "+1.25E+00", 1.25, False),
        ("DSOX", "+9.9E+37", None, True),
    ],
)
def test_a_record_is_triggered_waited_for_and_read(model: str, answer: str, value: float | None, is_lost: bool):
    scope, link = _scope(model, *TRIGGERED[model], (READ[model], answer))
    scope.open()
    found = present(scope.read(1.0))
    assert (found.lost is not None) == is_lost
    assert value is None or found.value == pytest.approx(value)
    link.finish()


@pytest.mark.parametrize("model", EMULATED)
@pytest.mark.parametrize(
    ("place", "answer", "error"),
    [(0, "ACME,INSTR2024,0,1", WrongInstrumentError), (0, "REDPITAYA,9115,0,1", WrongInstrumentError),
     (0, "KEYSIGHT,34465A,1,1", WrongInstrumentError), (-1, '-222,"Data out of range"', ComplaintError)],
)  # fmt: skip
def test_another_one_or_one_that_complains_is_refused(model: str, place: int, answer: str, error: type[Exception]):
    dialogue = ARM[model][: len(ARM[model]) if place == -1 else 1]
    scope = Oscilloscope(
        ScriptedLink([*dialogue[:-1], (dialogue[-1][0], answer)]), SCOPES[model],
        PITAYA if model == "RedPitaya" else DSOX, 30.0,
    )  # fmt: skip
    with pytest.raises(error):
        scope.open()


@pytest.mark.parametrize("answer", ["{1.0,2.0", "1.0,2.0}", "{}", "{1.0,,2.0}", "{1.0,nan}", "", "nonsense"])
def test_samples_that_are_none_are_no_reading(answer: str):
    scope, _ = _scope("RedPitaya", *TRIGGERED["RedPitaya"], (READ["RedPitaya"], answer))
    scope.open()
    with pytest.raises(BadReplyError):
        scope.read(1.0)


@given(aperture_s=st.floats(1e-5, 0.1))
def test_a_board_takes_what_covers_the_record_and_fits_into_an_answer(aperture_s: float):
    told = {name: int(text) for name, text in numbers(aperture_s).items()}
    assert told["decimation"] in [2**power for power in range(17)]
    assert told["samples"] * told["decimation"] / 125e6 == pytest.approx(aperture_s, rel=0.005)
    # signs, digits and commas of so many samples, within the longest answer that a link takes
    assert 100 <= told["samples"] <= 210
    assert told["delay"] == told["samples"] - 8192


@pytest.mark.parametrize(
    ("wrong", "words"),
    [({"range_V": 10.0}, "1 or 20"), ({"channel": 5}, "channel"),
        ({"channel": 5, "model": "DSOX"}, "channel"), ({"channel": 0}, "channel"), ({"model": "MDO"}, "RedPitaya"),
     ({"aperture_s": 0.2}, "aperture_s"), ({"channel": 1.5}, "whole")],
)  # fmt: skip
def test_what_it_cannot_do_is_said(wrong: dict[str, object], words: str):
    with pytest.raises(ValueError, match=words):
        OscilloscopeSettings("ASRL1::INSTR", **wrong)  # pyright: ignore[reportArgumentType]


Emulated = Callable[..., tuple[Oscilloscope, Transducer, float]]


@pytest.fixture
def emulated() -> Iterator[Emulated]:
    """An oscilloscope on a real socket, before a tip that moves at a constant speed."""
    ends: list[Callable[[], None]] = []

    def make(model: str, speed_um_per_s: float, **settings: float) -> tuple[Oscilloscope, Transducer, float]:
        transducer = Transducer(SensorEmulation(model, volts_per_um=0.01, offset_V=0.0, **settings),
                                np.random.default_rng(3))  # fmt: skip
        start_s = time.perf_counter() - 0.5
        for step in range(3900):
            transducer.follow(start_s + 1e-3 * step, speed_um_per_s * (1e-3 * step - 0.5))
        kind, end = SCOPE_INSTRUMENTS[model]
        server = TcpServer(kind(transducer), end)
        range_V = 1.0 if model == "RedPitaya" else 1.5
        told = OscilloscopeSettings(
            f"TCPIP::127.0.0.1::{server.port}::SOCKET", model, range_V=range_V, aperture_s=0.02, timeout_s=1.0
        )
        scope = told.make(10.0)
        ends.extend([scope.close, server.close])
        scope.open()
        return scope, transducer, start_s + 0.5

    yield make
    for end in ends:
        end()


def _read(scope: Oscilloscope) -> Reading:
    return present(scope.read(2.0))


@pytest.mark.parametrize("model", EMULATED)
def test_a_reading_holds_at_the_middle_of_its_record(emulated: Emulated, model: str):
    scope, _, start_s = emulated(model, 60.0, noise_um=0.05)
    late_ms = []
    for _ in range(6):
        found = _read(scope)
        # the tip was there when the reading says, but for what the wire takes on a busy machine
        late_ms.append(1e3 * (100.0 * found.value / 60.0 - (found.time_s - start_s)))
    assert min(map(abs, late_ms)) < 5.0


@pytest.mark.parametrize("model", EMULATED)
def test_a_tip_beyond_the_range_is_no_reading(emulated: Emulated, model: str):
    scope, transducer, _ = emulated(model, 0.0, range_um=140.0)
    assert _read(scope).lost is None
    transducer.faults = transducer.faults.with_fault("travel_um", 170.0)
    assert "range" in str(_read(scope).lost)


@pytest.mark.parametrize("model", EMULATED)
def test_a_trigger_that_is_not_taken_is_no_answer_for_ever(emulated: Emulated, model: str):
    scope, _, _ = emulated(model, 0.0)
    other = "ACQ:TRIG:DLY 2000000000" if model == "RedPitaya" else ":TIM:RANG 400"
    scope._link.write(other)  # pyright: ignore[reportPrivateUsage]
    start_s = time.perf_counter()
    with pytest.raises(NoReplyError):
        scope.read(2.0)
    assert time.perf_counter() - start_s < 3.0


@pytest.mark.slow
@pytest.mark.parametrize("model", EMULATED)
def test_a_loop_over_it_reaches_its_set_point(model: str, tmp_path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    text = f'[emulator]\nsensor = "{model}"\n[guard]\nheartbeat_s = 1.0\nframe_age_s = 0.8\n'
    (tmp_path / "bench.toml").write_text(text)
    assert main(["hil", "--bench", "bench.toml", "--setpoint", "12", "--duration", "3", "--out", "run"]) == 0
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["step"]["steady_state_error_um"] == pytest.approx(0.0, abs=0.2)


def test_the_calibration_of_a_sensor_comes_with_a_picture_of_its_fit(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    pytest.importorskip("matplotlib", reason="needs the extra pictures")
    out = tmp_path / "sensor.toml"
    assert main(["calibrate", "--sensor", "0.5:0", "2.4:51", "4.5:100", "--out", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["written"] == [str(out), str(out.with_suffix(".png"))]
    assert out.with_suffix(".png").read_bytes().startswith(b"\x89PNG")


def test_the_margin_of_a_calibration_is_the_one_that_the_page_says():
    page = Path(__file__).parents[2] / "docs" / "how-to" / "calibrate-a-sensor.md"
    assert f"up to {100.0 * BEYOND:g} % of the span" in page.read_text(encoding="utf-8")
