import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_hil.supply import parse
from bender_hil.supply.dialect import BK_9115
from bender_hil.supply.failures import BadReplyError


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_number_is_read_as_it_was_printed(value: float):
    assert parse.number("?", repr(value)) == value


@given(st.text(max_size=12))
def test_a_number_is_finite_or_refused(text: str):
    try:
        assert math.isfinite(parse.number("?", text))
    except BadReplyError:
        assert not text.isascii() or not text.strip().isdigit()


@pytest.mark.parametrize(
    "text", ["", "nan", "inf", "1,2", "1 2", "0x1", "1_0", "1e999", "-1E999", "12.3V", "?2.5", '0,"No error"', "１"]
)
def test_what_is_no_number_is_refused(text: str):
    with pytest.raises(BadReplyError):
        parse.number("MEAS:VOLT?", text)


@pytest.mark.parametrize(("text", "on"), [("0", False), ("1", True), (" on ", True), ("OFF", False)])
def test_switch(text: str, on: bool):
    assert parse.switch("OUTP?", text) is on


@pytest.mark.parametrize("text", ["", "2", "00", "1.0", "yes", "-1"])
def test_what_is_no_switch_is_refused(text: str):
    with pytest.raises(BadReplyError):
        parse.switch("OUTP?", text)


@pytest.mark.parametrize("text", ['0,"No error"', "0", "+0, No error", "0,'No error'"])
def test_no_complaint(text: str):
    assert parse.complaint("SYST:ERR?", text) is None


@pytest.mark.parametrize("text", ['-113,"Undefined header"', "-222", "110,Self test"])
def test_complaint(text: str):
    assert parse.complaint("SYST:ERR?", text) == text


@pytest.mark.parametrize("text", ["", "12.5", "No error", "B&K Precision, 9115, 1, 2"])
def test_what_is_no_complaint_is_refused(text: str):
    with pytest.raises(BadReplyError):
        parse.complaint("SYST:ERR?", text)


def test_the_emulator_is_known_by_its_serial_number():
    assert parse.identity("*IDN?", "B&K Precision, 9115, EMU000001, V1").is_emulated
    assert not parse.identity("*IDN?", "B&K Precision, 9115, 800886011777510007, V1").is_emulated


@pytest.mark.parametrize("field", ["set_upper_bound", "output_on", "prepare"])
def test_an_empty_command_is_refused_by_its_name(field: str) -> None:
    with pytest.raises(ValueError, match=f"{field}: found an empty command"):
        replace(BK_9115, **{field: ("*CLS", "") if field == "prepare" else ""})
    assert replace(BK_9115, set_upper_bound=None, prepare=()).prepare == ()


@pytest.mark.parametrize(
    "answer", ["", "B&K, 9115, 1", "B&K, 9115, 1, V1, more", "B&K, , 1, V1", "B&K, 9115, 1,", ",,,"]
)
def test_an_identification_has_four_fields_and_none_is_empty(answer: str):
    with pytest.raises(BadReplyError, match="serial"):
        parse.identity("*IDN?", answer)
