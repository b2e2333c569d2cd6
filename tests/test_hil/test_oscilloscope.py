"""Oscilloscopes and the Red Pitaya: their words, the instant of a reading, and what is no reading."""

import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from emulated_bench import ScriptedLink
from hypothesis import given
from hypothesis import strategies as st

from bender_emulator.sensors.scope import SCOPE_INSTRUMENTS
from bender_emulator.sensors.settings import SCOPES as EMULATED
from bender_emulator.sensors.settings import SensorEmulation
from bender_emulator.sensors.transducer import Transducer
from bender_emulator.servers import TcpServer
from bender_hil.sensors.oscilloscope import Oscilloscope, OscilloscopeSettings
from bender_hil.sensors.scope_dialect import SCOPES, numbers
from bender_hil.sensors.sensor import Reading
from bender_hil.supply.failures import BadReplyError, ComplaintError, NoReplyError, WrongInstrumentError

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
    found = scope.read(1.0)
    assert found is not None
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


def test_a_record_longer_than_the_time_between_two_is_refused():
    with pytest.raises(ValueError, match="rate_Hz"):
        OscilloscopeSettings("ASRL1::INSTR", aperture_s=0.05).make(30.0)


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
    found = scope.read(2.0)
    assert found is not None
    return found


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
    import json

    from bender_cli.main import main

    monkeypatch.chdir(tmp_path)
    text = f'[emulator]\nsensor = "{model}"\n[guard]\nheartbeat_s = 1.0\nframe_age_s = 0.8\n'
    (tmp_path / "bench.toml").write_text(text)
    assert main(["hil", "--bench", "bench.toml", "--setpoint", "12", "--duration", "3", "--out", "run"]) == 0
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["step"]["steady_state_error_um"] == pytest.approx(0.0, abs=0.2)
