"""`python -m bender_hil.emulator`: the emulated supply with the physics behind it, as a process of its own.

Reads its settings as one line from the standard input, answers with one line that says where everything is, and ends
when the standard input has ended and nobody talks to the supply any more: with the process that started it, however
that one ended.
"""

import json
import signal
import sys
import time
from pathlib import Path

import numpy as np

from bender_hil.emulator.console import Console
from bender_hil.emulator.generator import GeneratorInstrument
from bender_hil.emulator.instrument import Instrument
from bender_hil.emulator.physics import Physics
from bender_hil.emulator.servers import PtyServer, TcpServer
from bender_hil.emulator.settings import SupplyEmulation
from bender_hil.emulator.tip_board import TipWriter
from bender_hil.supply.select import GENERATOR
from bender_loop.errors import InputError, RunError
from bender_loop.fmu.plant import FmuPlant

_LINGER_S = 20.0


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
    if settings.model == GENERATOR:
        instrument: Instrument = GeneratorInstrument(rng)
    else:
        instrument = Instrument(settings.model, settings.maximum_V, settings.maximum_A, rng)
    physics = Physics(instrument, settings.terminals, plant, board, settings.step_s)
    if settings.link == "pty":
        server = PtyServer(instrument, settings.answer_end, settings.baud, Path(settings.terminal_path))
        resource = f"ASRL{server.path}::INSTR"
    else:
        server = TcpServer(instrument, settings.answer_end, settings.port)
        resource = f"TCPIP::127.0.0.1::{server.port}::SOCKET"
    console = Console(instrument, physics, server.drop, server.is_busy)
    physics.start()
    _say({"resource": resource, "console": console.port, "password": console.password})
    sys.stdin.read()
    _wait_while_busy(server)
    physics.stop()
    console.close()
    server.close()


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
