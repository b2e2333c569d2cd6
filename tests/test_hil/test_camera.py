"""The camera: opening it, what is locked on it, and the newest frame from real streams and from bad ones."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from emulated_bench import wait_for
from few import few
from present import present

from bender_emulator.microscope import FrameServer, Scene, SceneSettings, read_stamp
from bender_hil.camera import reader
from bender_hil.camera.reader import Camera, to_grey
from bender_hil.camera.settings import CameraSettings
from bender_hil.camera.source import Opened, open_source
from bender_loop.errors import InputError

cv2 = pytest.importorskip("cv2", reason="needs the extra bench")

SETTINGS = SceneSettings(width_px=160, height_px=96, rest_x_px=100.0, rest_y_px=48.0, dust=0, specks=0)
IMPATIENT = CameraSettings(read_timeout_s=0.2, reopen_pause_s=0.02)


@contextmanager
def serving(rate: float = 60.0) -> Iterator[FrameServer]:
    scene_rng, rng = np.random.default_rng(1).spawn(2)
    with FrameServer(
        Scene(SETTINGS, scene_rng), lambda: (time.perf_counter(), 0.0, 0.0), frames_per_s=rate, exposure_s=0.0, rng=rng
    ) as server:
        yield server


class Scripted:
    """Stands in for a `cv2.VideoCapture`: gives the pictures of a list, then fails or blocks."""

    def __init__(self, pictures: list[np.ndarray], *, block: threading.Event | None = None, step: bool = False) -> None:
        self._pictures, self._block = list(pictures), block
        self._turn = threading.Semaphore(0 if step else 10**6)
        self.released = False

    def step(self) -> None:
        self._turn.release()

    def end(self) -> None:
        self._pictures.clear()
        if self._block is not None:
            self._block.set()
        self.step()

    def grab(self) -> bool:
        if not self._pictures:
            if self._block is not None:
                self._block.wait(30.0)
            return False
        return self._turn.acquire(timeout=10.0)

    def retrieve(self) -> tuple[bool, np.ndarray | None]:
        return bool(self._pictures), self._pictures.pop(0) if self._pictures else None

    def get(self, _: int) -> float:
        return 33.3

    def release(self) -> None:
        self.released = True


def _picture(level: int) -> np.ndarray:
    return np.full((4, 6), level, np.uint8)


@pytest.fixture
def scripted(monkeypatch):
    def use(*captures: Scripted) -> None:
        waiting = list(captures)

        def fake(*_: object) -> Opened:
            if not waiting:
                raise InputError("nothing there")
            return Opened(waiting.pop(0), "SCRIPT", {})

        monkeypatch.setattr(reader, "open_source", fake)

    return use


def test_frames_are_bit_exact_newer_each_time_and_stamped_after_they_were_taken():
    with serving() as server, Camera(server.address, frames_per_s=60.0) as camera:
        frames = [frame for _ in range(8) if (frame := camera.newest(5.0)) is not None]
        assert len(frames) == 8
        assert camera.opened is not None
        assert camera.opened.backend == "FFMPEG"
    numbers = [frame.number for frame in frames]
    assert numbers == sorted(set(numbers))
    for frame in frames:
        stamp = present(read_stamp(frame.image))
        assert 0.0 < frame.grabbed_s - 1e-9 * stamp.taken_ns < 5.0
        assert frame.image.shape == (96, 160)
        assert frame.image.dtype == np.uint8


def test_slow_consumer_gets_the_newest_frame_and_the_count_of_the_others(scripted):
    capture = Scripted([_picture(level) for level in range(1, 8)], block=threading.Event(), step=True)
    scripted(capture)
    with Camera("tcp://x:1") as camera:
        capture.step()
        first = present(camera.newest(5.0))
        for _ in range(4):
            capture.step()
        wait_for(lambda: camera.counts.grabbed == 5)
        latest = present(camera.newest(5.0))
        assert camera.newest(0.02) is None
        capture.end()
    assert (first.number, first.skipped, int(first.image[0, 0])) == (1, 0, 1)
    assert (latest.number, latest.skipped, int(latest.image[0, 0])) == (5, 3, 5)
    assert latest.position_ms == 33.3
    assert camera.counts.skipped == 3


def test_repeated_picture_is_no_new_frame(scripted):
    for settings, grabbed, repeated in ((CameraSettings(), 2, 2), (CameraSettings(repeats_count=True), 4, 0)):
        block = threading.Event()
        scripted(Scripted([_picture(1), _picture(1), _picture(1), _picture(2)], block=block))
        with Camera("tcp://x:1", settings=settings) as camera:
            wait_for(lambda camera=camera: camera.counts.grabbed + camera.counts.repeated == 4)
            assert (camera.counts.grabbed, camera.counts.repeated) == (grabbed, repeated)
            block.set()


def test_frozen_camera_is_a_stalled_camera():
    with serving() as server, Camera(server.address) as camera:
        assert camera.newest(5.0) is not None
        server.faults.set("freeze")
        wait_for(lambda: camera.counts.repeated > 5 and camera.stalled_s() > 0.05)
        assert camera.counts.reopened == 0
        server.faults.clear()
        camera.newest(5.0)
        assert camera.newest(5.0) is not None


@pytest.mark.parametrize("fault", few(["stall", "drop", "garble"], 0))
def test_camera_comes_back_after(fault: str):
    with serving() as server, Camera(server.address, settings=IMPATIENT) as camera:
        first = present(camera.newest(5.0))
        server.faults.set(fault)
        wait_for(lambda: camera.stalled_s() > 0.3)
        while camera.newest(0.01) is not None:
            pass
        server.faults.clear()
        again = present(camera.newest(10.0))
        assert again.number > first.number
        assert camera.counts.reopened >= 1


def test_stall_is_seen_while_the_reader_is_stuck_and_the_reader_is_replaced(scripted, monkeypatch):
    monkeypatch.setattr(reader, "_GIVEN_UP_S", 0.1)
    monkeypatch.setattr(reader, "_CLOSING_S", 0.1)
    stuck, healthy = threading.Event(), threading.Event()
    old, new = Scripted([_picture(1)], block=stuck), Scripted([_picture(2)], block=healthy)
    scripted(old, new)
    with Camera("tcp://x:1", settings=IMPATIENT) as camera:
        assert camera.newest(5.0) is not None
        wait_for(lambda: camera.stalled_s() > 0.15)
        assert int(present(camera.newest(5.0)).image[0, 0]) == 2
        assert not old.released
        stuck.set()
        wait_for(lambda: old.released)
        healthy.set()


def test_missed_frames_are_told_from_the_gaps(scripted):
    block = threading.Event()
    capture = Scripted([_picture(1), _picture(2), _picture(3)], block=block, step=True)
    scripted(capture)
    with Camera("tcp://x:1", frames_per_s=100.0) as camera:
        capture.step()
        assert camera.newest(5.0) is not None
        time.sleep(0.06)
        capture.step()
        assert camera.newest(5.0) is not None
        assert camera.counts.missed >= 4
        capture.end()


def test_file_is_read_to_its_end_at_its_pace(tmp_path: Path):
    path = tmp_path / "frames.y4m"
    pictures = np.random.default_rng(1).integers(0, 256, (5, 16, 16), np.uint8)
    path.write_bytes(
        b"YUV4MPEG2 W16 H16 F25:1 Ip A1:1 Cmono\n" + b"".join(b"FRAME\n" + one.tobytes() for one in pictures)
    )
    with Camera(str(path), frames_per_s=50.0) as camera:
        seen = []
        while (frame := camera.newest(2.0)) is not None:
            seen.append(frame)
        assert camera.ended
    assert seen[-1].number == 5
    assert np.array_equal(seen[-1].image, pictures[-1])
    assert seen[-1].grabbed_s - seen[0].grabbed_s >= 0.7 * (seen[-1].number - seen[0].number) / 50.0


def test_impossible_rate_is_refused():
    with pytest.raises(ValueError, match="frames_per_s"):
        Camera(0, frames_per_s=0.0)


def test_grey_is_luminance():
    grey = np.arange(24, dtype=np.uint8).reshape(4, 6)
    assert to_grey(grey) is grey
    assert np.array_equal(to_grey(grey[:, :, None]), grey)
    assert np.array_equal(to_grey(np.repeat(grey[:, :, None], 3, axis=2)), grey)
    assert to_grey(np.full((1, 1, 3), (0, 255, 0), np.uint8))[0, 0] == 150


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
