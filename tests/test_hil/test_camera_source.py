"""Opening a source: what it is, what is locked on it, and what is said when it is not there."""

from typing import ClassVar

import pytest

from bender_hil.camera.reader import Camera
from bender_hil.camera.settings import CameraSettings
from bender_hil.camera.source import DEVICE, FILE, STREAM, kind_of, open_source, parse_source
from bender_loop.errors import InputError

cv2 = pytest.importorskip("cv2", reason="needs the extra bench")


def test_kinds_of_source():
    assert [kind_of(one) for one in (0, "0", "/dev/video2", "tcp://127.0.0.1:5", "clip.mp4")] == [
        DEVICE, DEVICE, DEVICE, STREAM, FILE,
    ]  # fmt: skip
    assert (parse_source("3"), parse_source("a3")) == (3, "a3")


@pytest.mark.parametrize(
    ("source", "expected"),
    [(97, "plugged in"), ("nowhere.mp4", "no such file"), ("tcp://127.0.0.1:9", "something serves there")],
)
def test_missing_source_is_one_line_of_advice(source, expected: str, capfd):
    with pytest.raises(InputError, match=expected) as caught, Camera(source):
        pass
    assert "\n" not in str(caught.value)
    assert str(source) in str(caught.value)
    assert capfd.readouterr().err == ""


def test_backend_of_another_platform_is_refused_by_name():
    known = {cv2.videoio_registry.getBackendName(one) for one in cv2.videoio_registry.getBackends()}
    missing = {"dshow": "DSHOW", "v4l2": "V4L2"}
    name = next(name for name, proper in missing.items() if proper not in known)
    with pytest.raises(InputError, match=f"backend: found '{name}'"):
        open_source(0, CameraSettings(backend=name), None)


class Device:
    """A device whose driver refuses everything but the exposure."""

    asked: ClassVar[list[tuple[int, float]]] = []

    def __init__(self, source: int, backend: int, parameters: list[int]) -> None:
        self.opened_with = (source, backend, parameters)

    def isOpened(self) -> bool:
        return True

    def getBackendName(self) -> str:
        return "V4L2"

    def set(self, number: int, value: float) -> bool:
        self.asked.append((number, value))
        return True

    def get(self, number: int) -> float:
        return dict(self.asked)[number] if number == cv2.CAP_PROP_EXPOSURE else -1.0


def test_device_is_locked_and_what_it_accepted_is_told(monkeypatch):
    monkeypatch.setattr(cv2, "VideoCapture", Device)
    monkeypatch.setattr(Device, "asked", [])
    settings = CameraSettings(
        width_px=640, height_px=480, exposure=40.0, gain=2.0, white_balance=5000.0, pixel_format="MJPG"
    )
    opened = open_source("0", settings, 30.0)
    assert opened.accepted["exposure"] == (40.0, 40.0)
    assert opened.accepted["gain"] == (2.0, -1.0)
    assert opened.accepted["frames_per_s"] == (30.0, -1.0)
    order = [number for number, _ in Device.asked]
    assert order.index(cv2.CAP_PROP_AUTO_EXPOSURE) < order.index(cv2.CAP_PROP_EXPOSURE)
    assert order.index(cv2.CAP_PROP_AUTO_WB) < order.index(cv2.CAP_PROP_WB_TEMPERATURE)
    assert order.index(cv2.CAP_PROP_FOURCC) < order.index(cv2.CAP_PROP_FRAME_WIDTH)
    assert dict(Device.asked)[cv2.CAP_PROP_AUTO_EXPOSURE] == 1.0


def test_nothing_is_locked_that_was_not_asked_for(monkeypatch):
    monkeypatch.setattr(cv2, "VideoCapture", Device)
    monkeypatch.setattr(Device, "asked", [])
    assert set(open_source(0, CameraSettings(), None).accepted) == {"buffered_frames", "autofocus"}


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"backend": "gstreamer"}, "backend"),
        ({"width_px": 1.5}, "width_px"),
        ({"exposure": "auto"}, "exposure"),
        ({"pixel_format": "MJPEG"}, "pixel_format"),
        ({"read_timeout_s": 0.0}, "read_timeout_s"),
        ({"repeats_count": 1}, "repeats_count"),
    ],
)
def test_bad_settings_are_named(change: dict, named: str):
    with pytest.raises(ValueError, match=f"^{named}: found"):
        CameraSettings(**change)
