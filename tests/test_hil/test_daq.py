"""A DAQ as source and sensor: over the stand-in, which has the names and arguments of the maker's package."""

import enum
import inspect
import time
import types
from pathlib import Path
from typing import Any

import pytest

from bender_emulator.sources import daq_stand_in
from bender_hil.emulated import EmulatedBench, EmulationSettings
from bender_hil.sensors.daq_input import DaqInput, DaqInputSettings
from bender_hil.sources.amplifier import Amplifier
from bender_hil.sources.daq_output import DaqOutputSettings
from bender_hil.sources.kinds import make_source
from bender_hil.supply.source import Bounds
from bender_loop.errors import InputError


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
        reading = sensor.read(0.1)
        assert reading is not None
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
    reading = sensor.read(0.1)
    assert reading is not None
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
    reading = sensor.read(0.1)
    assert reading is not None
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
        reading = sensor.read(1.0)
        places_um.append(bench.supply.truth()["tip_um"])
        assert reading is not None
        calibration = settings.sensor_calibration()
        assert calibration is not None
        assert min(places_um) - 0.5 < calibration.to_um(reading.value) < max(places_um) + 0.5
        sensor.close()
        source.off_blind()
        time.sleep(0.05)
        assert source.confirm_off()
        source.close()
        assert abs(bench.supply.truth()["output_V"]) < 1.0
