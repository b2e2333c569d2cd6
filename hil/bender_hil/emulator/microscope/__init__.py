"""A microscope over the wire's tip, drawn: scenes with a known truth, and a server that a camera reader opens."""

from bender_hil.emulator.microscope.control import ControlServer, ask_microscope, clear_faults, set_fault
from bender_hil.emulator.microscope.faults import FAULTS
from bender_hil.emulator.microscope.scene import Scene
from bender_hil.emulator.microscope.server import FrameServer
from bender_hil.emulator.microscope.settings import SceneSettings
from bender_hil.emulator.microscope.stamp import Stamp, read_stamp

__all__ = [
    "FAULTS",
    "ControlServer",
    "FrameServer",
    "Scene",
    "SceneSettings",
    "Stamp",
    "ask_microscope",
    "clear_faults",
    "read_stamp",
    "set_fault",
]
