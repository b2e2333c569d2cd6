"""A microscope over the wire's tip, drawn: scenes with a known truth, and a server that a camera reader opens.

| module | holds |
|---|---|
| `backdrop` | what lies behind the wire: uneven light, and dirt |
| `control` | the wire by which faults are switched on from outside: one line asks, one line answers |
| `dirt` | things that lie about under a microscope: dust out of focus, grains, hairs |
| `faults` | what can go wrong with the emulated camera, switched on for a while |
| `micrometer` | a stage micrometer under the emulated microscope |
| `optics` | what a blurred, moving edge looks like: profiles that need no picture to be convolved |
| `scene` | the picture that the emulated camera takes of the wire's tip |
| `server` | frames over loopback TCP as a YUV4MPEG2 stream of grey pictures |
| `settings` | what the emulated microscope sees and how badly |
| `stamp` | a patch of black and white cells in the corner of a frame |
"""

from bender_emulator.microscope.control import ControlServer, ask_microscope, clear_faults, set_fault
from bender_emulator.microscope.faults import FAULTS
from bender_emulator.microscope.scene import Scene
from bender_emulator.microscope.server import FrameServer
from bender_emulator.microscope.settings import SceneSettings
from bender_emulator.microscope.stamp import Stamp, read_stamp

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
