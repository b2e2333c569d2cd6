"""Sources beside the supply: amplifiers, generators and piezo controllers, and those of other packages."""

import threading
import time
from dataclasses import dataclass, field

import pytest
from emulated_bench import ScriptedLink
from hypothesis import given
from hypothesis import strategies as st

from bender_hil.guard.settings import GuardOrders
from bender_hil.sources.amplifier import Amplifier
from bender_hil.sources.kinds import kind_of, make_source, source_class
from bender_hil.sources.line_dialect import LINE_DIALECTS
from bender_hil.sources.line_source import LineSettings, LineSource
from bender_hil.sources.simple import GuardedSimple, SimpleSource
from bender_hil.supply.failures import (
    BadReplyError,
    ComplaintError,
    LinkLostError,
    MismatchError,
    NoReplyError,
    WrongInstrumentError,
)
from bender_hil.supply.parse import Identity
from bender_hil.supply.played_source import can_play
from bender_hil.supply.select import SupplySettings
from bender_hil.supply.source import Bounds
from bender_loop.errors import InputError
from bender_loop.shell.plugins import check_complete

BOUNDS = Bounds(50.0, 55.0, 0.01)
IDN_PI = ("*IDN?", "(c)2015 Physik Instrumente (PI) GmbH & Co. KG,E-709.CHG,0115500620,1.037")
IDN_SDG = ("*IDN?", "Siglent Technologies,SDG1032X,SDG1XCAX1R0001,1.01.01.33R1B6")
DC_AT_0 = ("C1:BSWV?", "C1:BSWV WVTP,DC,OFST,0V")
FINE = ("ERR?", "0")


@given(
    gain=st.floats(0.01, 1000.0),
    polarity=st.sampled_from(["positive", "inverting"]),
    offset_V=st.floats(-10.0, 10.0),
    voltage_V=st.floats(-500.0, 500.0),
)
def test_an_amplifier_gives_what_its_input_is_worked_out_for(
    gain: float, polarity: str, offset_V: float, voltage_V: float
):
    amplifier = Amplifier(gain, polarity, offset_V)
    assert amplifier.output_V(amplifier.input_V(voltage_V)) == pytest.approx(voltage_V, rel=1e-9, abs=1e-9)
    assert (amplifier.input_V(voltage_V + 1.0) > amplifier.input_V(voltage_V)) == (polarity == "positive")


@pytest.mark.parametrize(
    "settings",
    [
        SupplySettings("ASRL1::INSTR", model="9116"),
        SupplySettings("ASRL1::INSTR", model="33xxx", gain=-20.0),
        LineSettings("ASRL1::INSTR", "GCS", axis="A"),
    ],
)
def test_orders_of_a_guard_make_the_source_again(settings: SupplySettings | LineSettings):
    orders = GuardOrders(settings, "journal", amplifier=Amplifier(20.0, "inverting"))
    again = GuardOrders.from_json(orders.to_json())
    assert again.amplifier == orders.amplifier
    assert again.source == settings
    assert type(again.make_source()) is type(make_source(settings, orders.amplifier))


def test_a_kind_that_nobody_knows_is_refused_with_those_that_there_are():
    with pytest.raises(InputError, match=r"expected one of supply, generator, piezo_controller"):
        source_class("van_de_graaff")
    with pytest.raises(ValueError, match="no kind of source"):
        kind_of(object())  # pyright: ignore[reportArgumentType]


def test_a_pi_controller_is_driven_and_off_at_0_V():
    link = ScriptedLink(
        [
            IDN_PI, ("SVO A 0", None), FINE, ("SVA A 0", None), FINE, ("SVA? A", "A=0.0000"), ("SVA? A", "A=0.0000"),
            ("SVA A 7.5000", None), FINE, ("SVA? A", "A=7.5000"), ("VOL? A", "A=7.4981"),
            ("SVA A 0.0000", None), IDN_PI, ("SVA? A", "A=0.0000"), IDN_PI,
        ]
    )  # fmt: skip
    source = LineSource(link, LINE_DIALECTS["GCS"], axis="A")
    source.open()
    assert len(source.arm(BOUNDS)) == 2
    source.set_voltage(7.5)
    assert (source.voltage_setting_V(), source.measured_V()) == (7.5, 7.4981)
    source.off_blind()
    assert source.confirm_off()
    link.finish()


def test_a_pi_controller_that_is_not_at_0_V_is_not_off():
    link = ScriptedLink([IDN_PI, ("SVA? 1", "1=3.0000"), IDN_PI])
    assert not LineSource(link, LINE_DIALECTS["GCS"]).confirm_off()
    link.finish()


def test_a_complaint_of_a_controller_is_told():
    link = ScriptedLink([("SVA 1 7.0000", None), ("ERR?", "17")])
    with pytest.raises(ComplaintError, match="17"):
        LineSource(link, LINE_DIALECTS["GCS"]).set_voltage(7.0)


def test_a_siglent_generator_repeats_the_question_and_has_no_error_queue():
    link = ScriptedLink(
        [
            IDN_SDG, ("*CLS", None), ("C1:OUTP OFF", None), ("C1:OUTP LOAD,HZ", None), ("C1:BSWV WVTP,DC", None),
            ("C1:BSWV OFST,0", None), DC_AT_0, DC_AT_0, ("C1:OUTP ON", None),
            ("C1:OUTP?", "C1:OUTP ON,LOAD,HZ,PLRT,NOR"),
            ("C1:BSWV OFST,2.5000", None), ("C1:BSWV?", "C1:BSWV WVTP,DC,OFST,2.5V"),
            ("C1:OUTP OFF", None), IDN_SDG, ("C1:OUTP?", "C1:OUTP OFF,LOAD,HZ,PLRT,NOR"), IDN_SDG,
        ]
    )  # fmt: skip
    source = LineSource(link, LINE_DIALECTS["SDG"])
    source.open()
    source.arm(Bounds(10.0, 11.0, 0.01, -10.0))
    source.set_voltage(2.5)
    assert source.voltage_setting_V() == 2.5
    source.off_blind()
    assert source.confirm_off()
    link.finish()


def test_a_generator_that_still_plays_a_sine_is_not_armed():
    sine = ("C1:BSWV?", "C1:BSWV WVTP,SINE,FRQ,1000HZ,AMP,4V,OFST,0V")
    prepared = [
        ("*CLS", None), ("C1:OUTP OFF", None), ("C1:OUTP LOAD,HZ", None), ("C1:BSWV WVTP,DC", None),
        ("C1:BSWV OFST,0", None),
    ]  # fmt: skip
    source = LineSource(ScriptedLink([*prepared, sine]), LINE_DIALECTS["SDG"])
    with pytest.raises(MismatchError, match="steady"):
        source.arm(Bounds(10.0, 11.0, 0.01))


def test_another_maker_is_refused_before_anything_is_set():
    link = ScriptedLink([("*IDN?", "Rigol Technologies,DG1032Z,DG1ZA1,00.01.02")])
    with pytest.raises(WrongInstrumentError, match="expected a SDG"):
        LineSource(link, LINE_DIALECTS["SDG"]).open()
    link.finish()


@dataclass
class Plain:
    """A simple source as another package would write it."""

    lowest_V: float = 0.0
    highest_V: float = 100.0
    step_V: float = 0.01
    cannot: tuple[str, ...] = ("it cannot measure",)
    on: bool = True
    level_V: float = 3.0
    serial: str = "1"
    stuck: threading.Event = field(default_factory=threading.Event)
    hangs: bool = False
    broken: bool = False

    def open(self) -> Identity:
        return Identity("me", "plain", self.serial, "1")

    def switch(self, on: bool) -> None:
        self.on = on

    def is_on(self) -> bool:
        return self.on

    def set_voltage(self, voltage_V: float) -> None:
        if self.hangs:
            self.stuck.wait(10.0)
        if self.broken:
            raise OSError("cable")
        self.level_V = voltage_V

    def setting_V(self) -> float:
        return self.level_V

    def measured_V(self) -> float | None:
        return None

    def close(self) -> None:
        pass


def test_a_simple_source_is_armed_driven_and_confirmed_off():
    plain = Plain()
    source = GuardedSimple(lambda: plain)
    source.open()
    assert source.arm(BOUNDS) == ["it cannot measure"]
    assert (plain.on, plain.level_V) == (True, 0.0)
    assert source.rounded(7.126) == pytest.approx(7.13)
    before_s = time.perf_counter()
    assert before_s <= source.set_voltage(7.0) <= time.perf_counter()
    assert source.voltage_setting_V() == 7.0
    assert not source.confirm_off()
    source.off_blind()
    assert source.confirm_off()
    source.close()


def test_a_simple_source_that_hangs_is_left_alone_and_made_anew():
    hung, fresh = Plain(hangs=True), Plain()
    made = iter([hung, fresh])
    source = GuardedSimple(lambda: next(made))
    source.open()
    source.patience.end_s = time.perf_counter() + 0.1
    waited: list[float] = []
    source.patience.waiting = lambda: waited.append(time.perf_counter())
    start_s = time.perf_counter()
    with pytest.raises(NoReplyError):
        source.set_voltage(1.0)
    assert time.perf_counter() - start_s < 0.5
    assert waited
    with pytest.raises(NoReplyError, match="hangs in an earlier call"):
        source.off_blind()
    source.patience.end_s = time.perf_counter() + 2.0
    source.reconnect()
    source.off_blind()
    assert source.confirm_off()
    assert not fresh.on
    hung.stuck.set()


def test_a_simple_source_leaves_no_thread_behind():
    before = set(threading.enumerate())
    source = GuardedSimple(Plain)
    source.open()
    (own,) = set(threading.enumerate()) - before
    source.close()
    own.join(2.0)
    assert not own.is_alive()


def test_a_source_plays_where_it_has_a_buffer_and_says_so_where_it_has_none():
    class Playing(Plain):
        def play(self, levels_V: list[float], rate_Hz: float) -> float:
            return len(levels_V) / rate_Hz

    with_buffer, without = GuardedSimple(Playing), GuardedSimple(Plain)
    assert can_play(with_buffer)
    assert with_buffer.play([1.0, 2.0], 10.0) == 0.2
    assert not can_play(without)
    with pytest.raises(ValueError, match="no buffer"):
        without.play([1.0], 10.0)


def test_what_a_simple_source_raises_becomes_a_fault_of_the_link():
    plain = Plain(broken=True)
    source = GuardedSimple(lambda: plain)
    with pytest.raises(LinkLostError, match="cable"):
        source.set_voltage(1.0)


@pytest.mark.parametrize(
    ("method", "answer", "sentence"),
    [
        ("is_on", "OFF", "is_on gave 'OFF', expected True or False"),
        ("setting_V", "0.00", "setting_V gave '0.00', expected a number"),
        ("open", "a plain one", "open gave 'a plain one', expected an Identity"),
    ],
)
def test_an_answer_of_the_wrong_type_is_told_and_never_means_off(method: str, answer: str, sentence: str):
    plain = Plain()
    setattr(plain, method, lambda: answer)
    source = GuardedSimple(lambda: plain)
    with pytest.raises(BadReplyError, match=sentence):
        {"open": source.open, "setting_V": source.voltage_setting_V, "is_on": source.confirm_off}[method]()


def test_a_source_without_a_switch_says_so_beside_its_settings():
    class Switchless(Plain):
        def is_on(self) -> bool:
            return self.level_V != 0.0

    with pytest.raises(MismatchError, match="has_switch = False"):
        GuardedSimple(Switchless).arm(BOUNDS)
    GuardedSimple(Switchless, has_switch=False).arm(BOUNDS)


def test_what_is_no_source_or_sensor_is_refused_with_what_it_lacks():
    check_complete(Plain(), SimpleSource)

    class Half:
        lowest_V = highest_V = step_V = 0.0

        def open(self) -> None: ...

    with pytest.raises(ValueError, match="make gave a Half without switch, is_on, set_voltage"):
        check_complete(Half(), SimpleSource)


def test_a_second_simple_source_cannot_say_off_for_the_first():
    made = iter([Plain(), Plain(serial="2")])
    source = GuardedSimple(lambda: next(made))
    source.open()
    with pytest.raises(WrongInstrumentError, match="serial number 2"):
        source.reconnect()


def test_bounds_beyond_a_simple_source_are_refused():
    source = GuardedSimple(Plain)
    with pytest.raises(ValueError, match="maximum_V must lie within 0"):
        source.arm(Bounds(120.0, 130.0, 0.01))
