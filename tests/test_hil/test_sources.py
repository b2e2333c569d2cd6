"""Sources beside the supply: amplifiers, generators, piezo controllers, a DAQ, those of other packages."""

import enum
import inspect
import threading
import time
import types
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from emulated_bench import ScriptedLink
from hypothesis import given
from hypothesis import strategies as st
from present import present

from bender_emulator.sources import daq_stand_in
from bender_hil.emulated import EmulatedBench, EmulationSettings
from bender_hil.guard.settings import GuardOrders
from bender_hil.sensors.daq_input import DaqInput, DaqInputSettings
from bender_hil.sources.amplifier import Amplifier
from bender_hil.sources.daq_output import DaqOutputSettings
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
            IDN_PI, ("SVA? A", "A=7.5000"), IDN_PI, ("SVA A 0.0000", None), IDN_PI, ("SVA? A", "A=0.0000"), IDN_PI,
        ]
    )  # fmt: skip
    source = LineSource(link, LINE_DIALECTS["GCS"], axis="A")
    source.open()
    assert len(source.arm(BOUNDS)) == 2
    source.set_voltage(7.5)
    assert (source.voltage_setting_V(), source.measured_V()) == (7.5, 7.4981)
    assert not source.confirm_off()
    source.off_blind()
    assert source.confirm_off()
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


def test_a_device_that_is_not_there_and_a_package_that_is_not_installed_are_told():
    settings = DaqOutputSettings("Dev1", backend=daq_stand_in.__name__)
    with pytest.raises(InputError, match=r"device: found 'Dev1'"):
        settings.make().open()
    with pytest.raises(InputError, match="python -m pip install nidaqmx"):
        DaqOutputSettings("Dev1", backend="no_such_package").make().open()


def test_the_stand_in_has_the_names_and_arguments_of_the_package():
    nidaqmx = pytest.importorskip("nidaqmx")
    from nidaqmx.task import InStream
    from nidaqmx.task.collections import AIChannelCollection, AOChannelCollection

    ours = daq_stand_in.Task
    pairs = [
        (ours.write, nidaqmx.Task.write), (ours.read, nidaqmx.Task.read), (ours.start, nidaqmx.Task.start),
        (ours.close, nidaqmx.Task.close), (ours._add_output, AOChannelCollection.add_ao_voltage_chan),
        (ours._add_input, AIChannelCollection.add_ai_voltage_chan),
        (ours._configure, nidaqmx.task.Timing.cfg_samp_clk_timing),
    ]  # fmt: skip
    for stand_in, real in pairs:
        known = inspect.signature(real).parameters
        missing = set(inspect.signature(stand_in).parameters) - set(known)
        assert not missing, f"{real.__qualname__} has no {missing}"
    assert hasattr(InStream, "avail_samp_per_chan")
    for ours_too, real in ((daq_stand_in.TerminalConfiguration, "TerminalConfiguration"),):
        theirs: type[enum.Enum] = getattr(nidaqmx.constants, real)
        assert {entry.name for entry in ours_too} <= {entry.name for entry in theirs} | {"DEFAULT"}
    assert nidaqmx.constants.AcquisitionType.CONTINUOUS is not None
    device = nidaqmx.system.Device
    assert all(hasattr(device, name) for name in ("product_type", "serial_num", "is_simulated"))
    assert hasattr(nidaqmx.system.System, "driver_version")


class Clocked:
    """A driver whose device has a clock that runs fast by 50 ppm, on a computer that is late now and then."""

    def __init__(self) -> None:
        self.now_s, self.taken, self.late_s = 1000.0, 0, 0.0
        self.in_stream: Any = types.SimpleNamespace(avail_samp_per_chan=0)

    def read(self, number_of_samples_per_channel: int, timeout: float) -> list[float]:
        del timeout
        self.taken += number_of_samples_per_channel
        self.now_s = 1000.0 + self.taken * 1e-4 / 1.00005
        return [1.0] * number_of_samples_per_channel


def test_readings_keep_their_time_when_the_computer_is_late(monkeypatch: pytest.MonkeyPatch):
    driver = Clocked()
    sensor = DaqInput(DaqInputSettings("Dev1"), 1000.0)
    sensor._task, sensor._tie_s = driver, 1000.0
    late_s = 0.0
    monkeypatch.setattr(time, "perf_counter", lambda: driver.now_s + late_s)
    errors_s = []
    for number in range(1, 60_001):
        late_s = 0.02 if number % 50 == 0 else 1e-4
        reading = present(sensor.read(0.1))
        errors_s.append(reading.time_s - (driver.now_s - 0.5e-3))
    assert max(map(abs, errors_s[100:])) < 3e-4


def test_readings_that_waited_are_passed_over_and_counted():
    driver = Clocked()
    sensor = DaqInput(DaqInputSettings("Dev1"), 1000.0)
    sensor._task, sensor._tie_s = driver, 1000.0
    waiting = iter([35, 25, 15, 5])

    class InStream:
        @property
        def avail_samp_per_chan(self) -> int:
            return next(waiting)

    driver.in_stream = InStream()
    reading = present(sensor.read(0.1))
    assert reading.passed == 3
    assert driver.taken == 40


class _Task:
    """Keeps how it was set up, and gives what it is told to."""

    def __init__(self) -> None:
        self.channel: tuple[Any, ...] = ()
        self.clock: dict[str, Any] = {}
        self.is_started = self.is_closed = False
        self.samples: list[float] = []
        self.ai_channels = types.SimpleNamespace(add_ai_voltage_chan=self._channel)
        self.timing = types.SimpleNamespace(cfg_samp_clk_timing=self._clock)
        self.in_stream = types.SimpleNamespace(avail_samp_per_chan=0)

    def _channel(self, name: str, terminal_config: object, min_val: float, max_val: float) -> None:
        self.channel = name, terminal_config, min_val, max_val

    def _clock(self, rate: float, **words: Any) -> None:
        self.clock = {"rate": rate, **words}

    def start(self) -> None:
        self.is_started = True

    def close(self) -> None:
        self.is_closed = True

    def read(self, number_of_samples_per_channel: int, timeout: float) -> list[float]:
        assert timeout >= 0.0
        taken, self.samples = self.samples[:number_of_samples_per_channel], []
        return taken


@pytest.fixture
def tasks(monkeypatch: pytest.MonkeyPatch) -> list[_Task]:
    """Return the tasks that a DAQ input makes with a driver of its own, one after the other."""
    made: list[_Task] = []

    def task() -> _Task:
        made.append(_Task())
        return made[-1]

    device = types.SimpleNamespace(product_type="PCIe-6321", serial_num=26, is_simulated=False)
    system = types.SimpleNamespace(
        devices=type("Devices", (dict,), {"device_names": ["Dev1"]})(Dev1=device),
        driver_version=types.SimpleNamespace(major_version=23, minor_version=8),
    )
    driver = types.SimpleNamespace(
        Task=task,
        constants=daq_stand_in.constants,
        system=types.SimpleNamespace(System=types.SimpleNamespace(local=lambda: system)),
    )
    monkeypatch.setattr("bender_hil.sensors.daq_input.driver_of", lambda _: driver)
    return made


def test_an_input_is_set_up_and_its_clock_takes_so_many_samples_for_a_reading(tasks: list[_Task]):
    sensor = DaqInput(DaqInputSettings("Dev1", channel="ai3", terminal="DIFF", range_V=5.0, samples=8), 250.0)
    identity = sensor.open()
    assert tuple(identity) == ("National Instruments", "PCIe-6321", "0000001A", "23.8")
    (task,) = tasks
    terminal, kind = daq_stand_in.TerminalConfiguration.DIFF, daq_stand_in.AcquisitionType
    assert task.channel == ("Dev1/ai3", terminal, -5.0, 5.0)
    assert task.clock == {"rate": 2000.0, "sample_mode": kind.CONTINUOUS, "samps_per_chan": 4000}
    assert task.is_started
    recording = sensor.record(500.0, 77)
    assert task.is_closed
    assert tasks[1].clock == {
        "rate": 500.0, "source": "/Dev1/ao/SampleClock", "sample_mode": kind.FINITE, "samps_per_chan": 77,
    }  # fmt: skip
    tasks[1].samples, tasks[1].in_stream.avail_samp_per_chan = [1.0, 5.2, -5.09], 3
    first, beyond, last = recording.read(0.1)
    assert (first, last) == (1.0, -5.09)
    assert beyond != beyond
    tasks[1].in_stream.avail_samp_per_chan = 0
    assert recording.read(0.01) == []
    sensor.close()
    assert tasks[1].is_closed


@pytest.mark.parametrize(("worst_V", "is_lost"), [(10.19, False), (10.2, True), (-10.3, True)])
def test_a_reading_is_the_mean_of_its_samples_and_lost_where_one_is_beyond_the_range(
    tasks: list[_Task], worst_V: float, is_lost: bool
):
    sensor = DaqInput(DaqInputSettings("Dev1", samples=2), 100.0)
    sensor.open()
    tasks[0].samples = [1.0, worst_V]
    reading = present(sensor.read(0.1))
    assert reading.value == pytest.approx((1.0 + worst_V) / 2.0)
    assert (reading.lost is not None) == is_lost
    assert reading.passed == 0


def test_an_output_with_a_read_back_is_armed_driven_and_off(tmp_path: Path):
    from bender_export.build import ensure_plant_fmu

    settings = EmulationSettings(supply="daq", sensor="daq", sensor_settings={"rate_Hz": 200.0})
    with EmulatedBench(settings, ensure_plant_fmu("bench"), 30.0, amplifier=Amplifier(20.0)) as bench:
        source = make_source(settings.source(bench.resource), Amplifier(20.0))
        assert source.open().is_emulated
        remarks = source.arm(Bounds(50.0, 55.0, 0.01))
        assert any("no switch" in remark for remark in remarks)
        source.set_voltage(30.0)
        time.sleep(0.3)
        assert source.measured_V() == pytest.approx(30.0, abs=0.1)
        assert not source.confirm_off()
        sensor = settings.sensor_table(str(bench.sensor_resource)).instrument.make(200.0)
        sensor.open()
        # the tip creeps, and a busy machine lets it creep for a while between two questions
        places_um = [bench.supply.truth()["tip_um"]]
        reading = present(sensor.read(1.0))
        places_um.append(bench.supply.truth()["tip_um"])
        calibration = present(settings.sensor_calibration())
        assert min(places_um) - 0.5 < calibration.to_um(reading.value) < max(places_um) + 0.5
        sensor.close()
        source.off_blind()
        time.sleep(0.05)
        assert source.confirm_off()
        source.close()
        assert abs(bench.supply.truth()["output_V"]) < 1.0
