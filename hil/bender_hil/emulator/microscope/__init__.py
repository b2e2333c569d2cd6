"""A microscope over the wire's tip, drawn: scenes with a known truth, and a server that a camera reader opens."""

from .control import ControlServer, ask_microscope, clear_faults, set_fault
from .faults import FAULTS
from .scene import Scene
from .server import FrameServer
from .settings import SceneSettings
from .stamp import Stamp, read_stamp

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
