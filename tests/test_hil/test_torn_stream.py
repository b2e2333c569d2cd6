"""JPEG pictures that arrive cut short, through the real decoder: noticed within a quarter of a second."""

import contextlib
import socket
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import pytest

from bender_emulator.microscope.scene import Scene
from bender_emulator.microscope.settings import SceneSettings
from bender_hil.camera.reader import Camera
from bender_hil.runner.tip_camera import CameraEyes
from bender_loop.shell.opencv import import_cv2
from bender_vision.scale import Calibration
from bender_vision.settings import TrackerSettings
from bender_vision.stillness import Stillness
from bender_vision.tracker import Tracker

pytest.importorskip("cv2")
pytestmark = pytest.mark.slow

RATE, DEADLINE_S, FRAME_AGE_S, ALLOWED = 30.0, 0.25, 0.11, 2


@dataclass
class Stream:
    """Motion JPEG over HTTP; `share` of each picture is sent, `honest` says whether its length is told truly."""

    listener: socket.socket
    share: float = 1.0
    honest: bool = True
    cut_s: float | None = None
    done: threading.Event = field(default_factory=threading.Event)

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.listener.getsockname()[1]}/"

    def serve(self) -> None:
        scene = Scene(SceneSettings(), np.random.default_rng(0))
        while not self.done.is_set():
            with contextlib.suppress(OSError):
                client, _ = self.listener.accept()
                with client:
                    self._talk(client, scene)

    def _talk(self, client: socket.socket, scene: Scene) -> None:
        cv2 = import_cv2()
        client.recv(4096)
        client.sendall(b"HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace;boundary=F\r\n\r\n")
        start_s, number = time.perf_counter(), 0
        while not self.done.is_set():
            number += 1
            time.sleep(max(0.0, start_s + number / RATE - time.perf_counter()))
            tip_um = 10.0 + 8.0 * np.sin(time.perf_counter())
            data = cv2.imencode(".jpg", scene.render(tip_um), [cv2.IMWRITE_JPEG_QUALITY, 90])[1].tobytes()
            sent = data[: int(self.share * len(data))]
            length = len(sent) if self.honest else len(data)
            head = b"--F\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % length
            if self.share < 1.0 and self.cut_s is None:
                self.cut_s = time.perf_counter()
            client.sendall(head + sent + b"\r\n")


@pytest.fixture
def stream() -> Iterator[Stream]:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(0.2)
        served = Stream(listener)
        thread = threading.Thread(target=served.serve, daemon=True)
        thread.start()
        yield served
        served.done.set()
        thread.join(5.0)


@pytest.mark.parametrize("honest", [True, False])
@pytest.mark.parametrize("share", [0.02, 0.2, 0.4])
def test_a_stream_that_is_cut_above_the_wire_is_noticed(stream: Stream, share: float, honest: bool):
    calibration = Calibration.of_scale(1.5)
    settings = TrackerSettings()
    with Camera(stream.address, frames_per_s=RATE) as camera:
        eyes = CameraEyes(camera, Tracker(settings, calibration), Stillness(settings, 10.0))
        eyes.zero(10)
        stream.honest, stream.share = honest, share
        lost, end_s = 0, time.perf_counter() + 5.0
        noticed_s = None
        while noticed_s is None and time.perf_counter() < end_s:
            sight = eyes.look(0.02)
            if sight is not None:
                lost = lost + 1 if sight.tip_um is None else 0
            if lost > ALLOWED or eyes.stalled_s() > FRAME_AGE_S or (sight is not None and sight.frozen > ALLOWED):
                noticed_s = time.perf_counter()
    assert noticed_s is not None
    assert stream.cut_s is not None
    assert noticed_s - stream.cut_s < DEADLINE_S
