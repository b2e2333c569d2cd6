"""`python -m bender_emulator`: the emulated supply with the physics behind it, as a process of its own.

Reads its settings as one line from the standard input, answers with one line that says where everything is, and ends
when the standard input has ended and nobody talks to the supply any more: with the process that started it, however
that one ended.
"""

import gc
import json
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from bender_emulator.console import Console
from bender_emulator.generator import GeneratorInstrument
from bender_emulator.instrument import Instrument
from bender_emulator.physics import Physics
from bender_emulator.sensors.meter import MeterInstrument
from bender_emulator.sensors.scope import SCOPE_INSTRUMENTS
from bender_emulator.sensors.settings import TEXT
from bender_emulator.sensors.text_stream import TextStream
from bender_emulator.sensors.transducer import Transducer
from bender_emulator.servers import PtyServer, TcpServer
from bender_emulator.settings import SupplyEmulation
from bender_emulator.sources.controllers import DaqInstrument, GcsInstrument, ThorlabsInstrument
from bender_emulator.sources.siglent import SiglentInstrument
from bender_emulator.tip_board import TipWriter
from bender_loop.errors import InputError, RunError
from bender_loop.fmu.plant import FmuPlant

_LINGER_S = 20.0
_SWITCH_S = 1e-4
"""After which a thread lets the others have the interpreter."""
INSTRUMENTS: dict[str, Callable[[np.random.Generator], Instrument]] = {
    "33xxx": GeneratorInstrument,
    "33500": GeneratorInstrument,
    "SDG": SiglentInstrument,
    "MDT693B": ThorlabsInstrument,
    "GCS": GcsInstrument,
    "daq": DaqInstrument,
}
"""Instruments that are no supply, by the name of their dialect."""


def main() -> int:
    """Serve until the standard input ends."""
    # an interrupt at the keyboard reaches every process of the terminal; the supply outlives the way down
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    line = sys.stdin.readline()
    if not line.endswith("\n"):
        # whoever started this process was interrupted before it could say what for
        return 1
    settings = SupplyEmulation.from_json(line)
    try:
        plant = FmuPlant(settings.fmu, output_name=settings.output, parameters=settings.parameters)
    except (InputError, RunError) as error:
        _say({"failed": str(error), "status": 2 if isinstance(error, InputError) else 1})
        return 1
    with plant, TipWriter(settings.board) as board:
        plant.reset()
        _serve(settings, plant, board)
    return 0


def _serve(settings: SupplyEmulation, plant: FmuPlant, board: TipWriter) -> None:
    rng = np.random.default_rng(settings.seed)
    kind = INSTRUMENTS.get(settings.model)
    if kind is not None:
        instrument = kind(rng)
    else:
        instrument = Instrument(settings.model, settings.maximum_V, settings.maximum_A, rng)
    if isinstance(instrument, DaqInstrument):
        instrument.on_clock = board.start_clock
    transducer, sensor = _sensor(settings)
    follow = None if transducer is None else transducer.follow
    physics = Physics(instrument, settings.terminals, plant, board, settings.step_s, settings.amplifier, follow)
    if settings.link == "pty":
        server = PtyServer(instrument, settings.answer_end, settings.baud, Path(settings.terminal_path))
        resource = f"ASRL{server.path}::INSTR"
    else:
        server = TcpServer(instrument, settings.answer_end, settings.port)
        resource = f"TCPIP::127.0.0.1::{server.port}::SOCKET"
    console = Console(instrument, physics, server.drop, server.is_busy)
    told: dict[str, object] = {"resource": resource, "console": console.port, "password": console.password}
    if isinstance(server, TcpServer):
        told["port"] = server.port
    if transducer is not None and sensor is not None:
        console.add_sensor(transducer, sensor.drop, sensor.is_busy)
        told["sensor"] = f"TCPIP::127.0.0.1::{sensor.port}::SOCKET"
    # milliseconds of a collection, or of a thread that keeps the interpreter, would be taken for the bench's own delay
    sys.setswitchinterval(_SWITCH_S)
    gc.collect()
    gc.freeze()
    gc.disable()
    physics.start()
    _say(told)
    sys.stdin.read()
    _wait_while_busy(server)
    physics.stop()
    console.close()
    server.close()
    if sensor is not None:
        sensor.close()


def _sensor(settings: SupplyEmulation) -> tuple[Transducer | None, TcpServer | TextStream | None]:
    """The emulated sensor beside the microscope, where there is one."""
    if settings.sensor is None:
        return None, None
    transducer = Transducer(settings.sensor, np.random.default_rng(settings.seed + 2))
    if settings.sensor.kind == TEXT:
        return transducer, TextStream(transducer)
    if settings.sensor.kind in SCOPE_INSTRUMENTS:
        kind, end = SCOPE_INSTRUMENTS[settings.sensor.kind]
        return transducer, TcpServer(kind(transducer), end)
    return transducer, TcpServer(MeterInstrument(transducer), "\n")


def _wait_while_busy(server: TcpServer | PtyServer) -> None:
    """A guard that has outlived its controller finds the supply where it was, to switch it off."""
    end_s = time.perf_counter() + _LINGER_S
    while server.is_busy() and time.perf_counter() < end_s:
        time.sleep(0.02)


def _say(message: dict[str, object]) -> None:
    sys.stdout.write(json.dumps(message) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
