"""A stand-in for the part of `nidaqmx` that the bench uses, over the emulated plant.

The maker's driver has simulated devices, but it cannot be had from a package registry, and a simulated device has no
plant between its output and its input. So `backend` of an emulated bench names this module: the names and arguments are
those of `nidaqmx` (a test holds them against the package where it is installed), the device is called
`EMU:PORT:BOARD`, its output goes over TCP to the emulated instrument, its input reads the tip board.
"""

import contextlib
import enum
import socket
import time
import types
from typing import Any

import numpy as np

from bender_emulator.tip_board import TipReader
from bender_loop.shell.messages import LOOPBACK

VOLTS_PER_UM, OFFSET_V, NOISE_V = 0.05, 0.5, 2e-4
_TIMEOUT_S = 1.0


class DaqError(Exception):
    """What the driver raises."""


class TerminalConfiguration(enum.Enum):
    """How an input is wired."""

    DEFAULT, RSE, NRSE, DIFF, PSEUDO_DIFF = range(5)


class AcquisitionType(enum.Enum):
    """How long samples are taken."""

    FINITE, CONTINUOUS = range(2)


constants = types.SimpleNamespace(TerminalConfiguration=TerminalConfiguration, AcquisitionType=AcquisitionType)


def emulated_device(port: int, board: str) -> str:
    """Return the name of the device behind an emulated output and a tip board."""
    return f"EMU:{port}:{board.replace('/', '|')}"


class _Wire:
    """The line to the emulated output."""

    def __init__(self, device: str) -> None:
        try:
            self._socket = socket.create_connection((LOOPBACK, int(device.split(":")[1])), timeout=_TIMEOUT_S)
        except OSError as error:
            raise DaqError(f"-200284: the device does not answer ({error})") from error
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._lines = self._socket.makefile("rb")

    def ask(self, line: str) -> str:
        try:
            self._socket.sendall(line.encode() + b"\n")
            answer = self._lines.readline().decode().strip()
        except OSError as error:
            raise DaqError(f"-200284: {error}") from error
        if not answer:
            raise DaqError("-200284: the device has gone")
        return answer

    def close(self) -> None:
        with contextlib.suppress(OSError):
            self._lines.close()
            self._socket.close()


_WIRES: dict[str, tuple[_Wire, int]] = {}
"""One line to each device, and how many tasks use it: the emulated instrument serves one client."""


def _wire_to(device: str) -> _Wire:
    wire, users = _WIRES.get(device) or (_Wire(device), 0)
    _WIRES[device] = wire, users + 1
    return wire


def _hang_up(device: str) -> None:
    wire, users = _WIRES.pop(device)
    if users > 1:
        _WIRES[device] = wire, users - 1
    else:
        wire.close()


class Task:
    """A task with one channel."""

    def __init__(self, new_task_name: str = "") -> None:
        self.name = new_task_name
        self._device = ""
        self._wire: _Wire | None = None
        self._board: TipReader | None = None
        self._is_read_back = False
        self._begun_s = self._sample_s = 0.0
        self._clock_source, self._count = "", 0
        self._buffer: list[float] = []
        self._taken = 0
        self._rng = np.random.default_rng(11)
        self.ao_channels = types.SimpleNamespace(add_ao_voltage_chan=self._add_output)
        self.ai_channels = types.SimpleNamespace(add_ai_voltage_chan=self._add_input)
        self.timing = types.SimpleNamespace(cfg_samp_clk_timing=self._configure)
        self.in_stream = _InStream(self)

    def start(self) -> None:
        """Let the clock run, or wait for that of the output."""
        self._begun_s, self._taken = time.perf_counter(), 0
        if self._buffer and self._wire is not None:
            levels = " ".join(f"{level_V:.6f}" for level_V in self._buffer)
            if self._wire.ask(f"PLAY {1.0 / self._sample_s!r} {levels}") != "ok":
                raise DaqError("-200077: the requested value is not a supported value")

    def stop(self) -> None:
        """Stop the clock."""

    def close(self) -> None:
        """Let go of the channel."""
        if self._wire is not None:
            _hang_up(self._device)
        if self._board is not None:
            self._board.close()
        self._wire = self._board = None

    def write(self, data: Any, auto_start: bool = True, timeout: float = 10.0) -> int:
        """Set the output, or load what `start` plays."""
        del timeout
        if isinstance(data, list):
            if self._sample_s <= 0.0 or auto_start:
                raise DaqError("-200547: a buffer needs a sample clock, and is started later")
            self._buffer = data
            return len(data)
        if self._sample_s > 0.0:
            raise DaqError("-200609: a task with a sample clock takes no single samples")
        if self._wire is None or self._wire.ask(f"AO {data!r}") != "ok":
            raise DaqError("-200077: the requested value is not a supported value")
        return 1

    def read(self, number_of_samples_per_channel: Any = None, timeout: float = 10.0) -> Any:
        """Return one sample, or as many as were asked for when they are there."""
        if self._is_read_back and self._wire is not None:
            return float(self._wire.ask("AI?"))
        count = int(number_of_samples_per_channel or 1)
        if self._clock_source:
            return self._clocked(count, timeout)
        due_s = self._begun_s + (self._taken + count) * self._sample_s
        if due_s - time.perf_counter() > timeout:
            time.sleep(timeout)
            raise DaqError("-200284: some or all of the samples requested have not yet been acquired")
        time.sleep(max(0.0, due_s - time.perf_counter()))
        if self._board is None:
            raise DaqError("-200088: the task is closed")
        self._taken += count
        volts = OFFSET_V + VOLTS_PER_UM * self._board.at().tip_um
        return (volts + NOISE_V * self._rng.standard_normal(count)).tolist()

    def available(self) -> int:
        """Samples that wait."""
        if self._clock_source:
            return self._clocked_until() - self._taken
        return int((time.perf_counter() - self._begun_s) / self._sample_s) - self._taken

    def _clocked_until(self) -> int:
        """How many samples the clock of the output has brought since this task waits for it."""
        if self._board is None:
            raise DaqError("-200088: the task is closed")
        start_s, rate_Hz = self._board.clock()
        if rate_Hz <= 0.0 or start_s < self._begun_s:
            return 0
        seen_s = self._board.at().time_s - start_s
        return max(0, min(self._count, int(seen_s * rate_Hz) + 1)) if seen_s >= 0.0 else 0

    def _clocked(self, count: int, timeout: float) -> list[float]:
        end_s = time.perf_counter() + timeout
        while self._clocked_until() - self._taken < count:
            if time.perf_counter() > end_s:
                raise DaqError("-200284: some or all of the samples requested have not yet been acquired")
            time.sleep(1e-3)
        if self._board is None:
            raise DaqError("-200088: the task is closed")
        start_s, rate_Hz = self._board.clock()
        places_um = self._board.past_um(start_s + (self._taken + np.arange(count)) / rate_Hz)
        self._taken += count
        return (OFFSET_V + VOLTS_PER_UM * places_um + NOISE_V * self._rng.standard_normal(count)).tolist()

    def _add_output(self, physical_channel: str, min_val: float = -10.0, max_val: float = 10.0) -> None:
        del min_val, max_val
        self._device = _device_of(physical_channel)
        self._wire = _wire_to(self._device)

    def _add_input(
        self,
        physical_channel: str,
        terminal_config: TerminalConfiguration = TerminalConfiguration.DEFAULT,
        min_val: float = -5.0,
        max_val: float = 5.0,
    ) -> None:
        del terminal_config, min_val, max_val
        self._device = device = _device_of(physical_channel)
        self._is_read_back = physical_channel.endswith("_vs_aognd")
        if self._is_read_back:
            self._wire = _wire_to(device)
        else:
            self._board = TipReader(device.split(":", 2)[2].replace("|", "/"))

    def _configure(
        self,
        rate: float,
        source: str = "",
        sample_mode: AcquisitionType = AcquisitionType.FINITE,
        samps_per_chan: int = 1000,
    ) -> None:
        del sample_mode
        self._sample_s, self._clock_source, self._count = 1.0 / rate, source, samps_per_chan


class _InStream:
    def __init__(self, task: Task) -> None:
        self._task = task

    @property
    def avail_samp_per_chan(self) -> int:
        """Samples that wait."""
        return self._task.available()


class _Devices:
    @property
    def device_names(self) -> list[str]:
        """Every name, of which there are as many as there are emulated benches."""
        return _AnyName()

    def __getitem__(self, name: str) -> Any:
        return types.SimpleNamespace(product_type="PCIe-6321", serial_num=1, is_simulated=True)


class _AnyName(list[str]):
    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name.startswith("EMU:")


class System:
    """The driver."""

    @staticmethod
    def local() -> "System":
        """Return that of this machine."""
        return System()

    @property
    def devices(self) -> _Devices:
        """The devices that there are."""
        return _Devices()

    @property
    def driver_version(self) -> Any:
        """Its version."""
        return types.SimpleNamespace(major_version=0, minor_version=0)


system = types.SimpleNamespace(System=System)


def _device_of(physical_channel: str) -> str:
    return physical_channel.rpartition("/")[0]
