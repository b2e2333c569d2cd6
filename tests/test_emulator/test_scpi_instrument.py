"""The emulated supply's language, without any wire."""

import math
from time import perf_counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_emulator.__main__ import INSTRUMENTS
from bender_emulator.conversation import Conversation, Hangup
from bender_emulator.faults import Faults
from bender_emulator.generator import GeneratorInstrument
from bender_emulator.instrument import Instrument
from bender_emulator.sensors.settings import KINDS
from bender_emulator.terminals import TerminalSettings, step
from bender_hil.sensors.meter_dialect import METERS
from bender_hil.sensors.scope_dialect import SCOPES
from bender_hil.sources.line_dialect import LINE_DIALECTS
from bender_hil.supply.select import GENERATOR


@pytest.fixture
def instrument() -> Instrument:
    return Instrument("9115", 80.0, 60.0, np.random.default_rng(0))


class _Wire:
    def __init__(self) -> None:
        self.data = b""

    def send(self, data: bytes) -> None:
        self.data += data


@pytest.mark.parametrize(
    "words",
    ["VOLT", "volt", "VOLTage", ":VOLT", "SOUR:VOLT", "SOURce:VOLTage:LEVel:IMMediate:AMPLitude", "source:volt:lev"],
)
def test_a_header_has_many_forms(instrument: Instrument, words: str):
    assert instrument.execute(f"{words} 12.5") is None
    assert instrument.execute(f"{words}?") == "12.500"
    assert instrument.execute("SYST:ERR?") == '0,"No error"'


@pytest.mark.parametrize("words", ["VOLTA", "VOL", "VOLTS", "VOLT:", "SOURC:VOLT"])
def test_between_the_short_and_the_long_form_there_is_nothing(instrument: Instrument, words: str):
    assert instrument.execute(f"{words} 1") is None
    assert instrument.execute("SYST:ERR?") == '-113,"Undefined header"'


@given(st.text(max_size=30))
def test_no_line_breaks_it(line: str):
    fresh = Instrument("9115", 80.0, 60.0, np.random.default_rng(0))
    fresh.execute(line)
    assert fresh.execute("*IDN?") is not None


def test_units_minimum_and_maximum(instrument: Instrument):
    instrument.execute("VOLT 1500 mV")
    assert instrument.execute("VOLT?;VOLT? MAX;VOLT? MIN") == "1.500;80.000;0.000"
    instrument.execute("VOLT MAX")
    assert instrument.target_V == 80.0


def test_the_9115_calls_its_lower_bound_limit(instrument: Instrument):
    instrument.execute("VOLT:LIM 50")
    instrument.execute("VOLT 20")
    assert instrument.execute("SYST:ERR?") == '-222,"Data out of range"'
    instrument.execute("VOLT:LIM 0;VOLT:RANG 50;VOLT 20")
    assert instrument.target_V == 20.0
    instrument.execute("VOLT 60")
    assert instrument.target_V == 20.0


def test_a_value_out_of_range_is_silent_until_asked_for(instrument: Instrument):
    assert instrument.execute("VOLT 99") is None
    assert instrument.target_V == 0.0
    assert instrument.execute("SYST:ERR?;SYST:ERR?") == '-222,"Data out of range";0,"No error"'


def test_a_full_queue_says_so(instrument: Instrument):
    for _ in range(30):
        instrument.execute("NONSENSE")
    answers = [instrument.execute("SYST:ERR?") for _ in range(21)]
    assert answers[19] == '-350,"Queue overflow"'
    assert answers[20] == '0,"No error"'


def test_a_tripped_protection_keeps_the_output_off_until_cleared(instrument: Instrument):
    instrument.execute("OUTP ON")
    instrument.trip()
    instrument.execute("OUTP ON")
    assert instrument.execute("OUTP?;VOLT:PROT:TRIG?") == "0;1"
    instrument.execute("*CLS;PROT:CLE;OUTP ON")
    assert instrument.execute("OUTP?;VOLT:PROT:TRIG?") == "1;0"


def test_local_refuses_settings_until_remote(instrument: Instrument):
    instrument.faults = Faults(local=True)
    instrument.execute("VOLT 5")
    assert instrument.execute("SYST:ERR?") == '-203,"Command protected"'
    instrument.execute("SYST:REM;VOLT 5")
    assert instrument.target_V == 5.0


def test_xln_has_words_of_its_own():
    xln = Instrument("XLN8018", 80.0, 18.0, np.random.default_rng(0))
    xln.execute("OUT ON;SOUR:VOLT 3;OVSET 55")
    assert xln.execute("OUT?;OVSET?;MODEL?;STATUS?") == "1;55.000;XLN8018;01"
    xln.execute("MEAS:VOLT?")
    assert xln.execute("ERR?") == '-113,"Undefined header"'


def test_the_function_generator_has_levels_and_a_sine():
    generator = GeneratorInstrument(np.random.default_rng(0))
    assert generator.execute("OUTP:LOAD INF;APPL:DC DEF,DEF,2.5;OUTP ON;OUTP?;VOLT:OFFS?") == "1;+2.50000E+00"
    assert generator.level_V(perf_counter()) == 2.5
    generator.execute("APPL:SIN 0.5,20,0")
    start_s = generator.arrivals[-1][0]
    assert generator.level_V(start_s + 0.5) == pytest.approx(10.0)
    assert generator.level_V(start_s + 1.5) == pytest.approx(-10.0)
    generator.execute("VOLT:OFFS 11;APPL:SIN 1,2")
    assert generator.execute("SYST:ERR?;SYST:ERR?") == '-222,"Data out of range";-109,"Missing parameter"'


def test_bytes_come_in_any_pieces(instrument: Instrument):
    wire = _Wire()
    conversation = Conversation(instrument, wire, "\r\n")
    for piece in (b"VOLT 7\r", b"\nVO", b"LT?\r\n*OP", b"C?\n"):
        conversation.feed(piece)
    assert wire.data == b"7.000\r\n1\r\n"


def test_faults_spoil_answers_and_wear_off(instrument: Instrument):
    wire = _Wire()
    conversation = Conversation(instrument, wire, "\n")
    instrument.execute("VOLT 7")
    instrument.faults = Faults(garble=1)
    conversation.feed(b"VOLT?\nVOLT?\n")
    assert wire.data == b"w.000\n7.000\n"
    wire.data = b""
    instrument.faults = Faults(truncate=1)
    conversation.feed(b"VOLT?\n")
    assert wire.data == b"7."
    wire.data = b""
    instrument.faults = Faults(stale=True)
    conversation.feed(b"*OPC?\nVOLT?\n")
    assert wire.data == b"7.000\n1\n"
    instrument.faults = Faults(reset_on_merged_writes=True)
    with pytest.raises(Hangup):
        conversation.feed(b"VOLT 1\nVOLT?\n")


def test_a_fault_that_is_none_is_refused():
    with pytest.raises(ValueError, match="no fault 'nonsense'"):
        Faults().with_fault("nonsense", 1)


def test_a_level_holds_from_when_it_was_set():
    instrument = Instrument("9115", 80.0, 60.0, np.random.default_rng(0))
    before_s = perf_counter()
    instrument.execute("VOLT 12")
    # a machine that was busy asks late what was set when
    assert instrument.level_V(before_s) == 0.0
    assert instrument.level_V(perf_counter()) == 12.0


VOLTS = st.floats(0.0, 80.0)


@given(VOLTS, VOLTS, st.floats(0.0, 1.0), st.booleans(), st.floats(1e-5, 0.1))
def test_the_output_never_passes_its_target(output: float, target: float, limit: float, on: bool, dt: float):
    wanted = target if on else 0.0
    after, current = step(TerminalSettings(), output, target, limit, on, dt)
    assert min(output, wanted) - 1e-9 <= after <= max(output, wanted) + 1e-9
    assert 0.0 <= current <= limit * (1.0 + 1e-9) + 1e-12


@given(st.floats(1e-4, 0.02), st.floats(1.0, 60.0))
def test_a_low_current_limit_makes_a_slow_rise(limit: float, target: float):
    """C dv/dt = I: the rise takes C V / I."""
    settings = TerminalSettings(slew_V_per_s=1e9)
    expected_s = settings.capacitance_F * target / limit
    output, dt = 0.0, expected_s / 200
    for _ in range(199):
        output, _ = step(settings, output, target, limit, True, dt)
    assert output == pytest.approx(target * 199 / 200, rel=1e-9)


@given(VOLTS, st.booleans(), st.integers(1, 50))
def test_the_fall_does_not_depend_on_the_step(output: float, on: bool, parts: int):
    settings = TerminalSettings()
    whole, _ = step(settings, output, 0.0, 0.01, on, 0.05)
    split = output
    for _ in range(parts):
        split, _ = step(settings, split, 0.0, 0.01, on, 0.05 / parts)
    assert split == pytest.approx(whole, rel=1e-9, abs=1e-12)


def test_off_falls_by_the_bleeder():
    settings = TerminalSettings(off_fall_time_s=0.5)
    after, _ = step(settings, 40.0, 40.0, 0.01, False, 0.5)
    assert after == pytest.approx(40.0 / math.e)


@pytest.mark.parametrize("name", ["slew_V_per_s", "capacitance_F", "fall_time_s", "off_fall_time_s"])
@pytest.mark.parametrize("value", [0.0, math.nan, math.inf])
def test_settings_out_of_range(name: str, value: float):
    with pytest.raises(ValueError, match=name):
        TerminalSettings(**{name: value})


def test_every_instrument_that_can_be_driven_is_emulated():
    assert set(KINDS) == {*METERS, *SCOPES, "text", "daq"}
    assert set(INSTRUMENTS) == {GENERATOR, *LINE_DIALECTS, "daq"}
