"""Every kind of sensor that `kind` under `[sensor]` may name; the camera has tables of its own."""

from collections.abc import Mapping
from typing import Any

from bender_hil.sensors.daq_input import DaqInputSettings
from bender_hil.sensors.multimeter import MultimeterSettings
from bender_hil.sensors.oscilloscope import OscilloscopeSettings
from bender_hil.sensors.text_line import TextLineSettings
from bender_loop.shell.plugins import SENSORS, known_kinds, settings_class

CAMERA = "camera"
OURS: Mapping[str, type] = {
    "multimeter": MultimeterSettings,
    "oscilloscope": OscilloscopeSettings,
    "text": TextLineSettings,
    "daq": DaqInputSettings,
}


def sensor_kinds() -> list[str]:
    """Return every name, those of other packages last."""
    return [CAMERA, *known_kinds(SENSORS, OURS)]


def sensor_class(kind: str) -> type[Any]:
    """Return the settings of a kind of sensor but the camera.

    Raises:
        InputError: there is no such kind, or its package is broken.
    """
    return settings_class(SENSORS, OURS, kind, "sensor")
