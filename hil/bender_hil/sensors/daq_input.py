"""An analogue input of a National Instruments DAQ device, through `nidaqmx` (extra `daq`).

The device's own clock takes the samples; each reading is the mean of as many as fit between two. The time of a reading
is worked out from its number: the earliest arrival that was ever seen ties the device's clock to the computer's, and
that tie may drift by 100 ppm, so that a late thread does not shift the time of what it reads.
"""

import math
import time
from dataclasses import dataclass
from typing import Any

from bender_hil.sensors.sensor import Reading
from bender_hil.sources.daq_output import NIDAQMX, driver_of, identity_of, part_of
from bender_hil.supply.parse import Identity
from bender_loop.bounds import check_numbers

TERMINALS = ("DEFAULT", "RSE", "NRSE", "DIFF", "PSEUDO_DIFF")
_DRIFT = 1e-4
_BUFFER_S = 2.0
_LOOK_S = 0.002


@dataclass(frozen=True, slots=True)
class DaqInputSettings:
    """The keys of `[sensor]` with `kind = "daq"`.

    Attributes:
        device: its name, as NI MAX or `nilsdev` shows it.
        channel: of the input.
        terminal: how it is wired: one of `TERMINALS`.
        range_V: largest voltage that is to be measured.
        samples: taken by the device for one reading, which is their mean.
        backend: module that speaks to the driver.
    """

    device: str
    channel: str = "ai0"
    terminal: str = "DEFAULT"
    range_V: float = 10.0
    samples: int = 10
    backend: str = NIDAQMX

    averages_between_readings = True

    def __post_init__(self) -> None:
        check_numbers(self, {"range_V": (1e-3, 100.0), "samples": (1, 10_000)}, whole=("samples",))
        if self.terminal not in TERMINALS:
            raise ValueError(f"terminal: found {self.terminal!r}, expected one of {', '.join(TERMINALS)}")

    def make(self, rate_Hz: float) -> "DaqInput":
        """Return the input."""
        return DaqInput(self, rate_Hz)


class DaqInput:
    """The input behind the `Sensor` protocol.

    Args:
        settings: which one.
        rate_Hz: readings per second.
    """

    unit = "V"
    cannot = ()

    def __init__(self, settings: DaqInputSettings, rate_Hz: float) -> None:
        self._settings, self._period_s = settings, 1.0 / rate_Hz
        self._task: Any = None
        self._number = 0
        self._tie_s = 0.0

    def open(self) -> Identity:
        """Reserve the channel and start the device's clock."""
        settings = self._settings
        driver = driver_of(settings.backend)
        constants = part_of(driver, "constants")
        identity = identity_of(driver, settings.device)
        task = self._task = self._new_task(driver)
        sample_Hz = settings.samples / self._period_s
        task.timing.cfg_samp_clk_timing(
            sample_Hz,
            sample_mode=constants.AcquisitionType.CONTINUOUS,
            samps_per_chan=max(int(_BUFFER_S * sample_Hz), 10 * settings.samples),
        )
        task.start()
        self._number, self._tie_s = 0, time.perf_counter() + self._period_s
        return identity

    def read(self, timeout_s: float) -> Reading | None:
        """Return the newest reading; those before it that wait are passed over and counted."""
        samples = self._settings.samples
        values, passed = self._block(max(timeout_s, self._period_s)), 0
        while self._task.in_stream.avail_samp_per_chan >= samples:
            values, passed = self._block(self._period_s), passed + 1
        value = sum(values) / len(values)
        most_V = self._settings.range_V
        lost = f"overload: beyond its range of {most_V:g} V" if max(map(abs, values)) >= 1.02 * most_V else None
        return Reading(value, self._tie_s + (self._number - 0.5) * self._period_s, lost, passed)

    def record(self, rate_Hz: float, count: int) -> "DaqRecording":
        """Take so many samples by the clock of the device's output, once that runs; nothing else is read meanwhile."""
        self.close()
        settings = self._settings
        driver = driver_of(settings.backend)
        task = self._task = self._new_task(driver)
        task.timing.cfg_samp_clk_timing(
            rate_Hz,
            source=f"/{settings.device}/ao/SampleClock",
            sample_mode=part_of(driver, "constants").AcquisitionType.FINITE,
            samps_per_chan=count,
        )
        task.start()
        return DaqRecording(task, settings.range_V)

    def close(self) -> None:
        """Let go of the channel."""
        task, self._task = self._task, None
        if task is not None:
            task.close()

    def _new_task(self, driver: Any) -> Any:
        settings = self._settings
        task = driver.Task()
        task.ai_channels.add_ai_voltage_chan(
            f"{settings.device}/{settings.channel}",
            terminal_config=part_of(driver, "constants").TerminalConfiguration[settings.terminal],
            min_val=-settings.range_V,
            max_val=settings.range_V,
        )
        return task

    def _block(self, timeout_s: float) -> list[float]:
        samples = self._settings.samples
        values = self._task.read(number_of_samples_per_channel=samples, timeout=timeout_s)
        self._number += 1
        arrived_s = time.perf_counter() - self._number * self._period_s
        self._tie_s = min(self._tie_s + _DRIFT * self._period_s, arrived_s)
        return values if isinstance(values, list) else [float(values)]


class DaqRecording:
    """Samples that the device takes by the clock of its output.

    Args:
        task: that runs.
        range_V: of the input.
    """

    def __init__(self, task: Any, range_V: float) -> None:
        self._task, self._most_V = task, 1.02 * range_V

    def read(self, timeout_s: float) -> list[float]:
        """Return the samples that have come since, NaN for one beyond the range; none within `timeout_s`: nothing."""
        end_s = time.perf_counter() + timeout_s
        while (waiting := self._task.in_stream.avail_samp_per_chan) < 1:
            if time.perf_counter() > end_s:
                return []
            time.sleep(_LOOK_S)
        values = self._task.read(number_of_samples_per_channel=waiting, timeout=timeout_s)
        values = values if isinstance(values, list) else [float(values)]
        return [value if abs(value) < self._most_V else math.nan for value in values]
