"""Supplies: the literal words of their manuals, answers that are none, real sockets that misbehave."""

import contextlib
import math
import socket
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from types import SimpleNamespace

import pytest
from emulated_bench import ScriptedLink
from hypothesis import given
from hypothesis import strategies as st

from bender_hil.guard.settings import GuardOrders
from bender_hil.sources.amplified import Amplified
from bender_hil.sources.amplifier import Amplifier
from bender_hil.sources.kinds import make_source
from bender_hil.sources.line_dialect import LINE_DIALECTS
from bender_hil.sources.line_source import LineSettings, LineSource
from bender_hil.supply import parse
from bender_hil.supply.capability import MODELS, Capability
from bender_hil.supply.dialect import BK_9115, NEEDED
from bender_hil.supply.driver import Supply
from bender_hil.supply.failures import (
    BadReplyError,
    ComplaintError,
    LinkLostError,
    MismatchError,
    NoReplyError,
    SupplyError,
    WrongInstrumentError,
)
from bender_hil.supply.link import LinkSettings, VisaLink
from bender_hil.supply.parse import Identity
from bender_hil.supply.select import SupplySettings
from bender_hil.supply.source import Bounds
from bender_hil.supply.stream import _AT_ONCE, MessageStream, SerialStream
from bender_loop.errors import InputError

pytest.importorskip("pyvisa_py")

IDN = b"B&K Precision, 9115, EMU1, V1\n"


@contextlib.contextmanager
def served(talk: Callable[[socket.socket], None]) -> Iterator[str]:
    """The VISA address of a server whose every connection is handled by `talk`."""
    listener = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        with contextlib.suppress(OSError):
            while True:
                stream, _ = listener.accept()
                with contextlib.suppress(OSError):
                    talk(stream)
                stream.close()

    threading.Thread(target=serve, daemon=True).start()
    try:
        yield f"TCPIP::127.0.0.1::{listener.getsockname()[1]}::SOCKET"
    finally:
        listener.close()


def _link(resource: str) -> VisaLink:
    return VisaLink(LinkSettings(resource, timeout_s=0.1))


def _echo_idn(stream: socket.socket) -> None:
    while stream.recv(100):
        stream.sendall(IDN)


def test_nagles_algorithm_is_off():
    with served(_echo_idn) as resource:
        link = _link(resource)
        link.open()
        inner = link._resource.visalib.sessions[link._resource.session].interface
        assert inner.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
        link.close()


def test_a_port_where_nobody_listens_is_lost_and_says_so():
    with socket.create_server(("127.0.0.1", 0)) as unused:
        port = unused.getsockname()[1]
    link = _link(f"TCPIP::127.0.0.1::{port}::SOCKET")
    with pytest.raises(LinkLostError, match=str(port)):
        _open_and_ask(link)


def _open_and_ask(link: VisaLink) -> None:
    # whether opening or asking fails is up to the platform
    link.open()
    link.query("*IDN?")


def test_a_peer_that_goes_away_ends_within_the_timeout():
    with served(lambda stream: None) as resource:
        link = _link(resource)
        link.open()
        start_s = time.perf_counter()
        with pytest.raises(SupplyError):
            link.query("*IDN?")
        assert time.perf_counter() - start_s < 5.0
        link.close()


def test_silence_is_no_reply():
    with served(lambda stream: time.sleep(0.5)) as resource:
        link = _link(resource)
        link.open()
        with pytest.raises(NoReplyError, match="MEAS:VOLT"):
            link.query("MEAS:VOLT?")
        link.close()


def test_a_link_that_is_closed_cannot_be_written():
    link = _link("TCPIP::127.0.0.1::1::SOCKET")
    with pytest.raises(LinkLostError, match="closed"):
        link.write("VOLT 0")
    link.close()


def test_what_is_no_visa_address_is_bad_input():
    with pytest.raises(InputError, match="VISA address"):
        _link("192.168.1.7:5025").open()


def test_reopening_leaves_late_answers_behind():
    """The peer answers one question late on its first connection; on the second all is well."""
    calls: list[int] = []

    def talk(stream: socket.socket) -> None:
        calls.append(0)
        if len(calls) == 1:
            stream.recv(100)
            stream.sendall(IDN)
            stream.recv(100)
            time.sleep(0.3)
            with contextlib.suppress(OSError):
                stream.sendall(b"1\n")
            return
        while data := stream.recv(100):
            for line in data.split(b"\n"):
                if line.endswith(b"?"):
                    stream.sendall(IDN if b"IDN" in line else b"0\n")

    with served(talk) as resource:
        supply = Supply(_link(resource), MODELS["9115"])
        supply.open()
        with pytest.raises(NoReplyError):
            supply.is_on()
        supply.reconnect()
        supply.resync()
        assert supply.confirm_off()
        supply.close()
    assert len(calls) >= 2


@pytest.mark.parametrize(
    ("name", "value"), [("timeout_s", 0.0), ("timeout_s", float("nan")), ("baud", 0), ("spacing_s", -1.0)]
)
def test_settings_out_of_range(name: str, value: float):
    with pytest.raises(ValueError, match=name):
        LinkSettings("ASRL1::INSTR", **{name: value})  # pyright: ignore[reportArgumentType]


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
    ("read", "text", "value"),
    [
        (parse.switch, "0", False), (parse.switch, "1", True), (parse.switch, " on ", True),
        (parse.switch, "OFF", False),
        *((parse.complaint, x, None) for x in ('0,"No error"', "0", "+0, No error", "0,'No error'")),
        *((parse.complaint, x, x) for x in ('-113,"Undefined header"', "-222", "110,Self test")),
    ],
)  # fmt: skip
def test_switches_and_complaints_are_read(read: Callable[[str, str], object], text: str, value: object):
    assert read("?", text) == value


NO_NUMBERS = ["", "nan", "inf", "1,2", "1 2", "0x1", "1_0", "1e999", "-1E999", "12.3V", "?2.5", '0,"No error"', "１"]


@pytest.mark.parametrize(
    ("read", "text"),
    [
        *((parse.number, x) for x in NO_NUMBERS),
        *((parse.switch, x) for x in ("", "2", "00", "1.0", "yes", "-1")),
        *((parse.complaint, x) for x in ("", "12.5", "No error", "B&K Precision, 9115, 1, 2")),
    ],
)
def test_what_is_no_answer_is_refused(read: Callable[[str, str], object], text: str):
    with pytest.raises(BadReplyError):
        read("?", text)


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


IDN_9115 = ("*IDN?", "B&K Precision, 9115, 800886011777510007, V1.01-V1.00")
IDN_XLN = ("*IDN?", "B&K PRECISION, XLN8018, 275K22178, 1.30-0")
IDN_33220 = ("*IDN?", "Agilent Technologies,33220A,MY44000001,2.00-2.00-22-2")
FINE = ("SYST:ERR?", '0,"No error"')
BOUNDS = Bounds(maximum_V=50.0, protection_V=55.0, current_A=0.01)

ARM_9115 = [
    ("*CLS", None), ("SYST:REM", None), FINE,
    ("OUTP OFF", None), FINE, ("OUTP?", "0"),
    ("VOLT 0.000", None), FINE, ("VOLT?", "0.000"),
    ("CURR 0.010", None), FINE, ("CURR?", "0.010"),
    ("VOLT:RANG 50.000", None), FINE, ("VOLT:RANG?", "50.000"),
    ("VOLT:PROT 55.000", None), FINE, ("VOLT:PROT?", "55.000"),
    ("VOLT:PROT:STAT ON", None), FINE, ("VOLT:PROT:STAT?", "1"),
    ("OUTP ON", None), FINE, ("OUTP?", "1"),
]  # fmt: skip


def _supply(dialogue: list[tuple[str, str | None]], model: str = "9115") -> tuple[Supply, ScriptedLink]:
    link = ScriptedLink(dialogue)
    return Supply(link, MODELS[model]), link


def test_9115_is_armed_word_by_word_and_never_told_its_lower_bound():
    supply, link = _supply([IDN_9115, *ARM_9115])
    assert supply.open().model == "9115"
    assert supply.arm(BOUNDS) == []
    link.finish()
    assert not any("LIM" in line for line in link.sent)


def test_9115_in_a_run_and_on_the_way_down():
    supply, link = _supply(
        [
            ("VOLT 12.346", None), FINE,
            ("MEAS:VOLT?", "12.3401"), ("VOLT?", "12.346"), ("MEAS:CURR?", "0.00012"), ("OUTP?", "1"),
            ("VOLT:PROT:TRIG?", "0"),
            ("VOLT 0.000", None), ("OUTP OFF", None), IDN_9115, ("OUTP?", "0"), IDN_9115, ("SYST:LOC", None),
        ]
    )  # fmt: skip
    supply.set_voltage(12.34567)
    assert (supply.measured_V(), supply.voltage_setting_V()) == (12.3401, 12.346)
    assert (supply.measured_A(), supply.is_on(), supply.has_tripped()) == (0.00012, True, False)
    supply.set_voltage_blind(0.0)
    supply.off_blind()
    assert supply.confirm_off()
    supply.release()
    link.finish()


def test_xln_speaks_its_own_dialect_and_says_what_it_cannot():
    fine = ("ERR?", "0")
    supply, link = _supply(
        [
            IDN_XLN, ("*CLS", None), fine,
            ("OUTP OFF", None), fine, ("OUTP?", "0"),
            ("SOUR:VOLT 0.000", None), fine, ("SOUR:VOLT?", "0.000"),
            ("SOUR:CURR 0.010", None), fine, ("SOUR:CURR?", "0.010"),
            ("OVSET 55.000", None), fine, ("OVSET?", "55.000"),
            ("OUTP ON", None), fine, ("OUTP?", "ON"),
            ("SOUR:VOLT 7.000", None), fine, ("VOUT?", "6.998"), ("IOUT?", "0.001"),
        ],
        "XLN8018",
    )  # fmt: skip
    supply.open()
    assert len(supply.arm(BOUNDS)) == 2
    supply.set_voltage(7.0)
    assert (supply.measured_V(), supply.measured_A()) == (6.998, 0.001)
    link.finish()


def test_a_supply_is_driven_without_what_its_dialect_does_not_have():
    lacking = ("set_current", "current_setting", "measure_current", "measure_voltage", "errors", "release")
    bare = Capability("PSU-7", 80.0, 0.001, replace(BK_9115, **dict.fromkeys(lacking)))
    dialogue = [line for line in ARM_9115 if line != FINE and "CURR" not in line[0]]
    link = ScriptedLink([("*IDN?", "ACME,PSU-7,42,1.0"), *dialogue, ("VOLT 7.000", None)])
    supply = Supply(link, bare)
    supply.open()
    remarks = supply.arm(BOUNDS)
    supply.set_voltage(7.0)
    supply.release()
    assert (supply.measured_V(), supply.measured_A()) == (None, None)
    link.finish()
    assert len(remarks) == 4
    told = ("current limit", "which voltage", "which current", "error queue")
    assert all(part in remark for part, remark in zip(told, remarks, strict=True))


@pytest.mark.parametrize("field", NEEDED)
def test_a_word_that_no_supply_can_be_guarded_without_is_asked_for_by_its_row_and_field(field: str) -> None:
    with pytest.raises(ValueError, match=rf"dialect bk_9115: {field}: found None, expected "):
        replace(BK_9115, **{field: None})


def test_function_generator_is_armed_driven_and_goes_off():
    link = ScriptedLink(
        [
            IDN_33220, ("*CLS", None), FINE, ("OUTP OFF", None), FINE, ("OUTP:LOAD INF", None), FINE,
            ("APPL:DC DEF,DEF,0.0000", None), FINE, ("VOLT:OFFS?", "+0.00000E+00"), ("VOLT:OFFS?", "+0.00000E+00"),
            ("OUTP ON", None), FINE, ("OUTP?", "1"), ("VOLT:OFFS 0.0000", None), FINE,
            ("VOLT:OFFS 1.2500", None), FINE,
            ("OUTP OFF", None), IDN_33220, ("OUTP?", "0"), IDN_33220,
        ]
    )  # fmt: skip
    generator = Amplified(LineSource(link, LINE_DIALECTS["33500"]), Amplifier(2.0))
    generator.open()
    assert len(generator.arm(Bounds(20.0, 21.0, 0.01))) == 1
    generator.set_voltage(2.5)
    generator.off_blind()
    assert generator.confirm_off()
    link.finish()


@pytest.mark.parametrize(
    ("answer", "error"),
    [
        ("B&K Precision, 9116, 1, V1", WrongInstrumentError),
        ("ACME, 9115, 1, V1", WrongInstrumentError),
        ("0", BadReplyError),
        ("", BadReplyError),
    ],
)
def test_nothing_is_sent_to_what_is_not_the_supply(answer: str, error: type[Exception]):
    supply, link = _supply([("*IDN?", answer)])
    with pytest.raises(error):
        supply.open()
    link.finish()


def test_another_serial_number_is_another_instrument():
    supply = Supply(ScriptedLink([IDN_9115]), MODELS["9115"], serial="1")
    with pytest.raises(WrongInstrumentError, match="expected 1"):
        supply.open()


def test_a_second_unit_of_the_model_cannot_say_off_for_the_first():
    other = (IDN_9115[0], "B&K Precision, 9115, 800886011777510008, V1.01-V1.00")
    supply, _ = _supply([IDN_9115, other, IDN_9115, ("OUTP?", "0"), other, IDN_9115, ("OUTP?", "0"), IDN_9115])
    supply.open()
    for _ in range(2):
        with pytest.raises(WrongInstrumentError, match="800886011777510008"):
            supply.confirm_off()
    assert supply.confirm_off()


def test_a_second_generator_cannot_say_off_for_the_first():
    other = (IDN_33220[0], "Agilent Technologies,33220A,MY44000002,2.00-2.00-22-2")
    generator = LineSource(ScriptedLink([IDN_33220, other, other, other]), LINE_DIALECTS["33500"])
    generator.open()
    with pytest.raises(WrongInstrumentError, match="MY44000002"):
        generator.resync()


def test_who_comes_after_a_guard_knows_which_instrument_it_was():
    first = Identity("B&K Precision", "9115", "800886011777510008", "V1.01-V1.00")
    orders = GuardOrders(SupplySettings("ASRL1::INSTR"), "journal", identity=first)
    assert GuardOrders.from_json(orders.to_json()) == orders
    supply = Supply(ScriptedLink([IDN_9115] * 3), MODELS["9115"], identity=orders.identity)
    with pytest.raises(WrongInstrumentError, match="800886011777510008"):
        supply.resync()


@pytest.mark.parametrize("place", [k for k, line in enumerate(ARM_9115) if line == FINE][1:])
def test_a_complaint_about_any_setting_ends_the_arming(place: int):
    supply, link = _supply([*ARM_9115[:place], ("SYST:ERR?", '-222,"Data out of range"')])
    with pytest.raises(ComplaintError, match="-222"):
        supply.arm(BOUNDS)
    link.finish()


@pytest.mark.parametrize("place", [k for k, line in enumerate(ARM_9115) if line[1] is not None and line != FINE])
def test_a_setting_that_reads_back_differently_ends_the_arming(place: int):
    question, answer = ARM_9115[place]
    other = {"0": "1", "1": "0"}.get(str(answer), "49.000")
    supply, link = _supply([*ARM_9115[:place], (question, other)])
    with pytest.raises(MismatchError):
        supply.arm(BOUNDS)
    link.finish()


def test_limits_beyond_the_model_are_refused_before_anything_is_sent():
    supply, _ = _supply([])
    with pytest.raises(
        ValueError, match=r"maximum_V must lie within 0 \.\.\. 80 V with the 9\w+, found .*\[emulator\] supply"
    ):
        supply.arm(Bounds(90.0, 95.0, 0.01))


def test_every_model_of_the_table_can_be_selected():
    for model in [*MODELS, "33xxx"]:
        assert make_source(SupplySettings("ASRL/dev/ttyUSB0::INSTR", model=model), None) is not None
    with pytest.raises(ValueError, match=r"model must be one of .*add-your-own.md.*write-a-source-or-sensor.md"):
        SupplySettings("ASRL1::INSTR", model="9103")
    with pytest.raises(ValueError, match=r"model must be one of .*write-a-source-or-sensor.md"):
        LineSettings("ASRL1::INSTR", model="DG1022")


def test_a_supply_of_another_maker_that_a_package_adds_answers_by_its_model():
    added = Capability("PSU-7", 30.0, 3.0, BK_9115)
    link = ScriptedLink([("*IDN?", "ACME,PSU-7,42,1.0")])
    assert Supply(link, added).open().manufacturer == "ACME"
    other = ScriptedLink([("*IDN?", "ACME,PSU-8,42,1.0")])
    with pytest.raises(WrongInstrumentError, match=r"ACME PSU-8 answers there, expected PSU-7; .*add-your-own"):
        Supply(other, added).open()


@pytest.mark.parametrize(("left", "is_emptied"), [(0, True), (31, True), (32, False)])
def test_a_queue_is_emptied_of_what_was_in_it_and_one_without_an_end_is_a_fault(left: int, is_emptied: bool):
    before = [("SYST:ERR?", '-113,"Undefined header"')] * left
    supply, link = _supply([IDN_9115, *ARM_9115[:2], *before, *(ARM_9115[2:] if is_emptied else [])])
    supply.open()
    if is_emptied:
        supply.arm(BOUNDS)
    else:
        with pytest.raises(ComplaintError, match=r"does not become empty: SYST:ERR. asked 32 times"):
            supply.arm(BOUNDS)
    link.finish()


@pytest.mark.parametrize(("timeout_s", "told_ms"), [(0.2, 200.0), (0.0, 1.0), (-1.0, 1.0)])
def test_a_backend_with_deadlines_of_its_own_is_told_them_and_never_waits_for_ever(timeout_s: float, told_ms: float):
    class Resource:
        timeout = math.nan
        written: bytes = b""

        def write_raw(self, data: bytes) -> None:
            self.written = data

        def read_raw(self) -> bytes:
            return b"30.0\n"

    resource = Resource()
    stream = MessageStream(resource)
    stream.send(b"MEAS:VOLT?\n", timeout_s)
    assert (resource.timeout, resource.written) == (pytest.approx(told_ms), b"MEAS:VOLT?\n")
    resource.timeout = math.nan
    assert stream.some(timeout_s) == b"30.0\n"
    assert resource.timeout == pytest.approx(told_ms)


@pytest.mark.parametrize(("waiting", "asked"), [(0, 1), (1, 1), (17, 17), (10**6, _AT_ONCE)])
def test_a_serial_port_is_read_for_what_waits_there_and_waited_on_for_one_byte(waiting: int, asked: int):
    port = SimpleNamespace(in_waiting=waiting, read=lambda count: bytes(count))
    assert len(SerialStream(port, 0.05, 0.25).some(0.25)) == asked
    assert (port.timeout, port.write_timeout) == (0.05, 0.25)
