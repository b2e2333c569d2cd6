"""Each driver against the literal words of its manual."""

import pytest
from emulated_bench import ScriptedLink

from bender_hil.guard.settings import GuardOrders
from bender_hil.sources.amplified import Amplified
from bender_hil.sources.amplifier import Amplifier
from bender_hil.sources.kinds import make_source
from bender_hil.sources.line_dialect import LINE_DIALECTS
from bender_hil.sources.line_source import LineSource
from bender_hil.supply.capability import MODELS, Capability
from bender_hil.supply.dialect import BK_9115
from bender_hil.supply.driver import Supply
from bender_hil.supply.failures import BadReplyError, ComplaintError, MismatchError, WrongInstrumentError
from bender_hil.supply.parse import Identity
from bender_hil.supply.select import SupplySettings
from bender_hil.supply.source import Bounds

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
    with pytest.raises(ValueError, match="model must be one of"):
        SupplySettings("ASRL1::INSTR", model="9103")


def test_a_supply_of_another_maker_that_a_package_adds_answers_by_its_model():
    added = Capability("PSU-7", 30.0, 3.0, BK_9115)
    link = ScriptedLink([("*IDN?", "ACME,PSU-7,42,1.0")])
    assert Supply(link, added).open().manufacturer == "ACME"
    other = ScriptedLink([("*IDN?", "ACME,PSU-8,42,1.0")])
    with pytest.raises(WrongInstrumentError, match=r"ACME PSU-8 answers there, expected PSU-7; .*add-your-own"):
        Supply(other, added).open()
