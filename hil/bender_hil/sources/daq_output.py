"""An analogue output of a National Instruments DAQ device, through `nidaqmx` (extra `daq`).

It has no switch and keeps its last voltage when whoever set it is gone: off is 0 V, and a spare guard sets that. Where
the device can read its own output back (`_ao0_vs_aognd` of the X series, or a wire from the output to an input), this
is what is measured, and what "off" rests on; otherwise it is what the driver was told last.
"""

import contextlib
import importlib
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from bender_hil.supply.parse import Identity
from bender_loop.bounds import check_numbers
from bender_loop.errors import InputError
from bender_loop.shell.extras import install_command

NIDAQMX = "nidaqmx"
_OFF_V = 0.02
_NO_SWITCH = "a DAQ output has no switch: off is 0 V, and 0 V is what has to be set before its computer is left"
_NO_READ_BACK = "nothing reads the output back (source.read_back): off rests on the driver's word alone"


@dataclass(frozen=True, slots=True)
class DaqOutputSettings:
    """The keys of `[source]` with `kind = "daq"`; an amplifier behind it has the table `[amplifier]`.

    Attributes:
        device: its name, as NI MAX or `nilsdev` shows it.
        channel: of the output.
        read_back: channel that reads the output back, `"_ao0_vs_aognd"` or `"ai1"`; None for none.
        lowest_V, highest_V: range of the output.
        backend: module that speaks to the driver.
    """

    device: str
    channel: str = "ao0"
    read_back: str | None = None
    lowest_V: float = -10.0
    highest_V: float = 10.0
    backend: str = NIDAQMX

    has_switch = False

    def __post_init__(self) -> None:
        check_numbers(self, {"lowest_V": (-100.0, 0.0), "highest_V": (1e-3, 100.0)})

    @property
    def resource(self) -> str:
        """What tells this output from any other."""
        return f"{self.device}/{self.channel}"

    def make(self) -> "DaqOutput":
        """Return the output."""
        return DaqOutput(self)


class DaqOutput:
    """The output behind the small protocol `SimpleSource`.

    Args:
        settings: which one.
    """

    step_V = 1e-3

    def __init__(self, settings: DaqOutputSettings) -> None:
        self._settings = settings
        self._output: Any = None
        self._input: Any = None
        self._told_V, self._is_playing = 0.0, False
        self.lowest_V, self.highest_V = settings.lowest_V, settings.highest_V
        # takes long, and may be counted as silence later; where it is not installed, opening says so
        with contextlib.suppress(InputError):
            driver_of(settings.backend)
        self.cannot = (_NO_SWITCH,) if settings.read_back is not None else (_NO_SWITCH, _NO_READ_BACK)

    def open(self) -> Identity:
        """Reserve the channels and ask which device it is; nothing is set."""
        settings = self._settings
        driver = driver_of(settings.backend)
        identity = identity_of(driver, settings.device)
        self._output, self._is_playing = self._new_output(), False
        if settings.read_back is not None:
            self._input = driver.Task()
            self._input.ai_channels.add_ai_voltage_chan(f"{settings.device}/{settings.read_back}")
        return identity

    def _new_output(self) -> Any:
        settings = self._settings
        task = driver_of(settings.backend).Task()
        task.ao_channels.add_ao_voltage_chan(settings.resource, min_val=settings.lowest_V, max_val=settings.highest_V)
        return task

    def switch(self, on: bool) -> None:
        """Set 0 V for off."""
        if not on:
            self.set_voltage(0.0)

    def is_on(self) -> bool:
        """Whether more than 20 mV are there, as far as it can be told."""
        measured_V = self.measured_V()
        return abs(self._told_V if measured_V is None else measured_V) > _OFF_V

    def set_voltage(self, voltage_V: float) -> None:
        """Set the level; the driver has written it when this returns."""
        if self._is_playing:
            # a task with a clock takes no single levels; the output keeps the one it is at meanwhile
            self._output.close()
            self._output, self._is_playing = self._new_output(), False
        self._output.write(voltage_V, auto_start=True)
        self._told_V = voltage_V

    def play(self, levels_V: Sequence[float], rate_Hz: float) -> float:
        """Load the levels into the device and start its clock; returns when the first one was there."""
        acquisition = part_of(driver_of(self._settings.backend), "constants").AcquisitionType.FINITE
        self._output.close()
        self._output, self._is_playing = self._new_output(), True
        self._output.timing.cfg_samp_clk_timing(rate_Hz, sample_mode=acquisition, samps_per_chan=len(levels_V))
        self._output.write(list(levels_V), auto_start=False)
        self._told_V = levels_V[-1]
        before_s = time.perf_counter()
        self._output.start()
        return 0.5 * (before_s + time.perf_counter())

    def setting_V(self) -> float:
        """The level that the driver was told last: it cannot be asked."""
        return self._told_V

    def measured_V(self) -> float | None:
        """What the device reads back; None where nothing is wired to do so."""
        return None if self._input is None else float(self._input.read())

    def close(self) -> None:
        """Let go of the channels; the output keeps its voltage."""
        for task in (self._output, self._input):
            if task is not None:
                task.close()
        self._output = self._input = None


def driver_of(backend: str) -> Any:
    """Import what speaks to the driver; InputError where it is not installed."""
    try:
        return importlib.import_module(backend)
    except ImportError as error:
        raise InputError(
            f"{backend} cannot be imported ({error}): {install_command('daq')}, and install NI-DAQmx"
        ) from error


def identity_of(driver: Any, device: str) -> Identity:
    """Ask the driver which device that is; InputError where there is none of that name."""
    system = part_of(driver, "system").System.local()
    names = system.devices.device_names
    if device not in names:
        there = ", ".join(names) or "none: no device is connected"
        raise InputError(f"device: found {device!r}, expected one of {there}")
    found = system.devices[device]
    version = system.driver_version
    firmware = f"{version.major_version}.{version.minor_version}"
    serial = f"{int(found.serial_num):08X}"
    # a device that the driver simulates says so, as an emulated one does
    serial = f"EMU{serial}" if found.is_simulated else serial
    return Identity("National Instruments", str(found.product_type), serial, firmware)


def part_of(driver: Any, name: str) -> Any:
    """Return a module of the driver's package, imported by it already or not."""
    return getattr(driver, name, None) or importlib.import_module(f"{driver.__name__}.{name}")
