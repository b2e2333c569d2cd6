"""`python -m bender_emulator.microscope`: the microscope as a process of its own.

Prints one line of JSON, {"stream": "tcp://...", "control_port": ...}, when it serves, and ends when its standard input
is closed, so that it never outlives whoever started it.
"""

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np

from bender_emulator.microscope.control import ControlServer
from bender_emulator.microscope.scene import Scene
from bender_emulator.microscope.server import FrameServer
from bender_emulator.microscope.settings import SceneSettings
from bender_emulator.tip_board import TipReader


def main(argv: list[str] | None = None) -> int:
    """Serve until the standard input ends; returns the exit status."""
    arguments = _parser().parse_args(argv)
    try:
        table = json.loads(arguments.scene)
        if not isinstance(table, dict):
            raise ValueError(f"found {arguments.scene!r}, expected a JSON object")
        settings = SceneSettings.from_table(table)
        _serve(arguments, settings)
    except (OSError, ValueError) as error:
        sys.stderr.write(f"microscope: {error}\n")
        return 2
    except KeyboardInterrupt:
        return 130
    return 0


def _serve(arguments: argparse.Namespace, settings: SceneSettings) -> None:
    scene_rng, server_rng = np.random.default_rng(arguments.seed).spawn(2)
    with (
        TipReader(arguments.board) as board,
        FrameServer(
            Scene(settings, scene_rng),
            board.at,
            frames_per_s=arguments.frames_per_s,
            exposure_s=arguments.exposure_s,
            rng=server_rng,
            port=arguments.port,
            stamped=not arguments.unstamped,
        ) as server,
        ControlServer(server, arguments.control_port) as control,
    ):
        sys.stdout.write(json.dumps({"stream": server.address, "control_port": control.port}) + "\n")
        sys.stdout.flush()
        while sys.stdin.buffer.read(1024):
            time.sleep(0.0)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m bender_emulator.microscope", description=__doc__, allow_abbrev=False
    )
    parser.add_argument("--board", type=Path, required=True, metavar="FILE", help="the tip board to read")
    parser.add_argument("--frames-per-s", type=float, default=30.0, metavar="RATE")
    parser.add_argument("--exposure-s", type=float, default=0.004, metavar="SECONDS")
    parser.add_argument("--port", type=int, default=0, help="of the stream at loopback; 0 takes a free one")
    parser.add_argument("--control-port", type=int, default=0, help="of the faults; 0 takes a free one")
    parser.add_argument("--scene", default="{}", metavar="JSON", help="settings of the scene that differ")
    parser.add_argument("--seed", type=int, default=1, help="places the dirt and makes the noise")
    parser.add_argument("--unstamped", action="store_true", help="no number, time and truth in the corner")
    return parser


if __name__ == "__main__":
    sys.exit(main())
