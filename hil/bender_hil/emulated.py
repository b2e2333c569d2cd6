"""The emulated bench of a bench file: its table, its processes, and what the file would say of a real one."""

import contextlib
import json
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from bender_emulator.sensors.settings import DAQ, KINDS, SCOPES, TEXT, SensorEmulation
from bender_emulator.settings import SupplyEmulation
from bender_emulator.sources import daq_stand_in
from bender_emulator.sources.daq_stand_in import OFFSET_V, VOLTS_PER_UM, emulated_device
from bender_emulator.start import EmulatedSupply
from bender_emulator.terminals import TerminalSettings
from bender_hil.calibration.sensor_scale import SensorCalibration, fit_sensor
from bender_hil.sensors.daq_input import DaqInputSettings
from bender_hil.sensors.multimeter import MultimeterSettings
from bender_hil.sensors.oscilloscope import OscilloscopeSettings
from bender_hil.sensors.table import SensorTable
from bender_hil.sensors.text_line import TextLineSettings
from bender_hil.sources.amplifier import Amplifier
from bender_hil.sources.daq_output import DaqOutputSettings
from bender_hil.sources.kinds import SourceSettings
from bender_hil.sources.line_dialect import LINE_DIALECTS
from bender_hil.sources.line_source import LineSettings
from bender_hil.supply.capability import MODELS
from bender_hil.supply.select import GENERATOR, SupplySettings
from bender_loop.bounds import check_numbers
from bender_loop.errors import InputError
from bender_loop.shell.closed_at_exit import ClosedAtExit
from bender_loop.shell.process_group import own_group

LINKS = ("tcp", "pty")
MICROSCOPE = "microscope"
_NOWHERE = "TCPIP::127.0.0.1::9::SOCKET"
"""Stands for an address that is known once the emulated sensor runs."""
_LARGEST_PARAMETER = 1e12
_BOUNDS = {
    "baud": (300, 10_000_000),
    "step_s": (1e-4, 0.01),
    "seed": (0, 2**63 - 2),
    "exposure_s": (0.0, 1.0),
}


@dataclass(frozen=True, slots=True)
class EmulationSettings:
    """The table `[emulator]` of a bench file.

    The microscope sees the FMU's output `displacement`, which is what a sensor would read, and not `tip_displacement`:
    so drift, ageing, lens distortion and whatever else a model has behind the tip shows in the pictures, and no effect
    that somebody writes into a bench file stays without effect. The camera adds its own pixels, blur and noise; a
    model for the emulated bench therefore should not have `sensor_quantisation` of its own, unless both are wanted.

    Attributes:
        model: a built-in model or a model file, for which an FMU is made.
        fmu: an FMU instead, whoever made it.
        output: the FMU's output that the microscope sees; None for `displacement`, or the only one.
        parameters: of the FMU, by FMI name: the effects that the nominal model lacks.
        link: "tcp" or "pty".
        baud: of the pseudo-terminal.
        supply: which supply, generator or controller is emulated.
        sensor: "microscope", or a sensor that is no camera: "DMM6500", "34465A", "RedPitaya", "DSOX", "text", "daq".
        sensor_settings: of such a sensor.
        step_s: of the physics.
        seed: of all noise.
        exposure_s: of the camera.
        scene: settings of the picture that differ from the usual.
        terminals: settings of the supply's output that differ from the usual.

    Raises:
        ValueError: a value is out of its range.
    """

    model: str = "bench"
    fmu: str | None = None
    output: str | None = None
    parameters: dict[str, float] = field(default_factory=dict)
    link: str = "tcp"
    baud: int = 57600
    supply: str = "9115"
    sensor: str = MICROSCOPE
    sensor_settings: dict[str, float] = field(default_factory=dict)
    step_s: float = 0.001
    seed: int = 0
    exposure_s: float = 0.004
    scene: dict[str, Any] = field(default_factory=dict)
    terminals: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.link not in LINKS:
            raise ValueError(f"link must be one of {', '.join(LINKS)}, found {self.link!r}")
        known = [*MODELS, GENERATOR, *LINE_DIALECTS, DAQ]
        if self.supply not in known:
            raise ValueError(f"supply must be one of {', '.join(known)}, found {self.supply!r}")
        if self.sensor != MICROSCOPE:
            self.sensing()
        elif self.sensor_settings:
            raise ValueError("sensor_settings stand beside the microscope, whose settings are under scene")
        if not self.model:
            raise ValueError("model must name a built-in model or a model file, found nothing")
        check_numbers(self, _BOUNDS, whole=("baud", "seed"))
        for name, value in self.parameters.items():
            if not abs(value) <= _LARGEST_PARAMETER:
                raise ValueError(f"parameters: {name}: found {value!r}, expected at most {_LARGEST_PARAMETER:g}")
        try:
            TerminalSettings(**self.terminals)
        except TypeError as error:
            known = ", ".join(TerminalSettings.__dataclass_fields__)
            raise ValueError(f"terminals: found {', '.join(self.terminals)}, expected some of {known}") from error

    def sensing(self) -> SensorEmulation:
        """The sensor that is no camera.

        Raises:
            ValueError: there is none, or its settings are not fit.
        """
        if self.sensor not in KINDS:
            raise ValueError(f"sensor must be one of {', '.join((MICROSCOPE, *KINDS))}, found {self.sensor!r}")
        try:
            return SensorEmulation(self.sensor, **self.sensor_settings)
        except TypeError as error:
            known = ", ".join(name for name in SensorEmulation.__dataclass_fields__ if name != "kind")
            found = ", ".join(self.sensor_settings)
            raise ValueError(f"sensor_settings: found {found}, expected some of {known}") from error

    def sensor_calibration(self) -> SensorCalibration | None:
        """What the sensor's volts are worth, as a perfect calibration would say; None for one that gives micrometres.

        Raises:
            ValueError: as of `sensing`.
        """
        sensor = self.sensing()
        if sensor.kind == TEXT:
            return None
        per_um, offset_V = (VOLTS_PER_UM, OFFSET_V) if sensor.kind == DAQ else (sensor.volts_per_um, sensor.offset_V)
        ends_um = (-sensor.range_um, sensor.range_um)
        volts = [offset_V + per_um * end_um for end_um in ends_um]
        return fit_sensor(volts, ends_um, "V", source="the emulated sensor's own settings")

    def sensor_table(self, resource: str) -> SensorTable:
        """What `[sensor]` of a bench file would say; without an address for a sensor that does not run yet.

        Raises:
            ValueError: as of `sensing`.
        """
        sensor, place = self.sensing(), resource or _NOWHERE
        kind, instrument, exposure_s = "multimeter", None, None
        if sensor.kind == TEXT:
            kind, instrument, exposure_s = "text", TextLineSettings(place), sensor.aperture_s
        elif sensor.kind == DAQ:
            kind, exposure_s = "daq", 1.0 / sensor.rate_Hz
            instrument = DaqInputSettings(place, backend=daq_stand_in.__name__)
        elif sensor.kind in SCOPES:
            kind, instrument = "oscilloscope", OscilloscopeSettings(place, sensor.kind, aperture_s=sensor.aperture_s)
        return SensorTable(
            kind,
            instrument or MultimeterSettings(place, sensor.kind, aperture_s=sensor.aperture_s),
            sensor.rate_Hz,
            exposure_s=exposure_s,
            repeats_count=sensor.noise_um == 0.0,
        )

    def source(self, resource: str) -> SourceSettings:
        """What `[source]` of a bench file would say of the emulated one."""
        if self.supply in LINE_DIALECTS:
            return LineSettings(resource, self.supply, baud=self.baud)
        if self.supply == DAQ:
            return DaqOutputSettings(resource, read_back="_ao0_vs_aognd", backend=daq_stand_in.__name__)
        return SupplySettings(resource, model=self.supply, baud=self.baud)


class EmulatedBench(ClosedAtExit):
    """Both processes; a context manager that ends them.

    Args:
        settings: of the bench.
        fmu: the plant.
        frames_per_s: of the camera.
        ports: of the supply's socket and of the camera's stream, so that both come back where they were; 0 for any.
        amplifier: between the source and the actuator; None for none.

    Attributes:
        supply: the emulated supply.
        resource: its VISA address.
        sensor_resource: that of a sensor that is no camera; None where the microscope is the sensor.
        stream: the camera's address, where there is a microscope.
        control_port: of the microscope's faults.
        microscope: its process.

    Raises:
        InputError: the FMU, a parameter or the scene is not fit.
        RunError: a process does not start, or this platform has no pseudo-terminals.
    """

    def __init__(
        self,
        settings: EmulationSettings,
        fmu: Path,
        frames_per_s: float,
        ports: tuple[int, int] = (0, 0),
        amplifier: Amplifier | None = None,
    ) -> None:
        if settings.link == "pty" and sys.platform == "win32":
            raise InputError("emulator.link: there are no pseudo-terminals on Windows; use tcp")
        self._ends = contextlib.ExitStack()
        try:
            folder = Path(
                self._ends.enter_context(
                    tempfile.TemporaryDirectory(prefix="bender-bench-", ignore_cleanup_errors=True)
                )
            )
            board = folder / "tip_board"
            if amplifier is not None and settings.supply in MODELS:
                raise InputError("amplifier: the emulated bench has one behind a generator or a controller only")
            sensor = None if settings.sensor == MICROSCOPE else settings.sensing()
            told = replace(
                _supply_settings(settings, fmu, board, folder),
                port=ports[0],
                amplifier=None if amplifier is None else (amplifier.factor, amplifier.offset_V),
                sensor=None if settings.sensor == DAQ else sensor,
            )
            self.supply = self._ends.enter_context(EmulatedSupply(told))
            device = emulated_device(self.supply.port, str(board))
            self.resource = device if settings.supply == DAQ else self.supply.resource
            self.sensor_resource = device if settings.sensor == DAQ else self.supply.sensor_resource
            if sensor is not None:
                return
            place = self._start_microscope(settings, board, frames_per_s, ports[1])
        except BaseException:
            self._ends.close()
            raise
        self.stream: str = place["stream"]
        self.control_port: int = place["control_port"]

    def close(self) -> None:
        """End both processes and remove what they shared."""
        self._ends.close()

    def _start_microscope(
        self, settings: EmulationSettings, board: Path, frames_per_s: float, port: int
    ) -> dict[str, Any]:
        words = [sys.executable, "-P", "-m", "bender_emulator.microscope", "--board", str(board)]
        words += ["--frames-per-s", repr(frames_per_s), "--exposure-s", repr(settings.exposure_s)]
        words += ["--scene", json.dumps(settings.scene), "--seed", str(settings.seed + 1)]
        words += ["--port", str(port)]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        process = subprocess.Popen(words, **pipes, **own_group())
        self._ends.callback(_end, process)
        self.microscope = process
        line = process.stdout.readline() if process.stdout is not None else ""
        if not line:
            _, complaint = process.communicate(timeout=5.0)
            raise InputError(f"the emulated microscope does not start: {complaint.strip() or 'no word'}")
        return json.loads(line)


def _supply_settings(settings: EmulationSettings, fmu: Path, board: Path, folder: Path) -> SupplyEmulation:
    # generators and controllers speak for themselves
    capability = MODELS.get(settings.supply, MODELS["9115"])
    line = LINE_DIALECTS.get(settings.supply)
    return SupplyEmulation(
        fmu=str(fmu),
        board=str(board),
        output=settings.output,
        parameters=dict(settings.parameters),
        model=settings.supply,
        maximum_V=capability.maximum_V,
        maximum_A=capability.maximum_A,
        answer_end=capability.dialect.read_end if line is None else line.read_end,
        link=settings.link,
        baud=settings.baud,
        terminal_path=str(folder / "tty"),
        step_s=settings.step_s,
        seed=settings.seed,
        terminals=TerminalSettings(**settings.terminals),
    )


def _end(process: "subprocess.Popen[str]") -> None:
    for pipe in (process.stdin, process.stdout, process.stderr):
        if pipe is not None:
            with contextlib.suppress(OSError):
                pipe.close()
    try:
        process.wait(timeout=3.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
