"""Frames over loopback TCP as a YUV4MPEG2 stream of grey pictures, which an ordinary `cv2.VideoCapture` opens.

`Cmono` is bit exact from here to the reader. One client is served; a new one takes the place of the old one, as a
reader that opens its source anew expects. A client that does not read loses frames, as a camera's does.
"""

import contextlib
import select
import socket
import threading
import time
from collections.abc import Callable
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from bender_emulator.microscope import faults as fault
from bender_emulator.microscope.faults import Faults
from bender_emulator.microscope.scene import Scene
from bender_emulator.microscope.stamp import Stamp, write_stamp

TipSource = Callable[[], tuple[float, float, float]]
"""Gives time_s (of `time.perf_counter`), tip_um and velocity_um_per_s."""

LOOPBACK = "127.0.0.1"
_SENDING_S = 0.5
_LONGEST_SLEEP_S = 0.1
_FAR_AWAY_UM = 1e5
_FRAME = b"FRAME\n"


class FrameServer:
    """Draws the tip at a fixed rate and sends it to whoever is connected.

    Use it as a context manager; it works in a thread of its own.

    Args:
        scene: what is drawn.
        tip: where the tip is when the shutter opens.
        frames_per_s: rate.
        exposure_s: how long the shutter is open; it smears what moves.
        port: to listen on, at loopback; 0 takes a free one.
        rng: makes the bytes of garbled frames.
        stamped: whether every frame carries its number, time and truth in a corner.

    Raises:
        ValueError: the rate or the exposure is impossible.
        OSError: the port is taken.
    """

    def __init__(
        self,
        scene: Scene,
        tip: TipSource,
        *,
        frames_per_s: float,
        exposure_s: float,
        rng: np.random.Generator,
        port: int = 0,
        stamped: bool = True,
    ) -> None:
        if not 0.0 < frames_per_s <= 1000.0:
            raise ValueError(f"frames_per_s: found {frames_per_s}, expected more than 0, at most 1000")
        if not 0.0 <= exposure_s <= 1.0 / frames_per_s:
            raise ValueError(f"exposure_s: found {exposure_s}, expected 0 to the frames' period")
        self.faults = Faults()
        self._scene, self._tip, self._rng = scene, tip, rng
        self._frames_per_s, self._exposure_s, self._stamped = frames_per_s, exposure_s, stamped
        self._listener = socket.create_server((LOOPBACK, port))
        self._client: socket.socket | None = None
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="frame server", daemon=True)
        self._last: bytes | None = None
        self._shown_um = 0.0
        self.sent = self.unsent = self.late = 0

    @property
    def address(self) -> str:
        """What a camera reader opens."""
        return f"tcp://{LOOPBACK}:{self._listener.getsockname()[1]}"

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._closing.set()
        self._thread.join()
        self._hang_up()
        self._listener.close()

    def status(self) -> dict[str, object]:
        """Counts and faults, for the log."""
        return {
            "sent": self.sent, "unsent": self.unsent, "late": self.late,
            "connected": self._client is not None, "faults": sorted(self.faults.active()),
        }  # fmt: skip

    def _serve(self) -> None:
        period_s = 1.0 / self._frames_per_s
        start_s, tick = time.perf_counter(), 0
        while self._wait_until(start_s + tick * period_s):
            self._meet_clients()
            # only now, so that whoever has just connected sees what was switched before
            active = self.faults.active()
            if self._client is not None and fault.STALL not in active:
                self._send(self._picture(tick, active), active)
            elapsed = int((time.perf_counter() - start_s) / period_s)
            self.late += max(0, elapsed - tick)
            tick = max(tick, elapsed) + 1

    def _wait_until(self, due_s: float) -> bool:
        """Sleep until then; False when the server is to end. Sleeping is finer than waiting for an event on Windows."""
        while not self._closing.is_set():
            left_s = due_s - time.perf_counter()
            if left_s <= 0.0:
                return True
            time.sleep(min(left_s, _LONGEST_SLEEP_S))
        return False

    def _meet_clients(self) -> None:
        if fault.DROP in self.faults.active():
            self._hang_up()
        while select.select([self._listener], [], [], 0.0)[0]:
            with contextlib.suppress(OSError):
                client, _ = self._listener.accept()
                if fault.DROP in self.faults.active():
                    client.close()
                else:
                    self._hang_up()
                    self._greet(client)

    def _greet(self, client: socket.socket) -> None:
        height, width = self._scene.shape
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        client.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 2 * height * width)
        client.settimeout(_SENDING_S)
        rate = f"{round(1000 * self._frames_per_s)}:1000"
        header = f"YUV4MPEG2 W{width} H{height} F{rate} Ip A1:1 Cmono\n".encode("ascii")
        self._client = client
        self._send_bytes(header)

    def _hang_up(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None

    def _picture(self, tick: int, active: frozenset[str]) -> bytes:
        if fault.FREEZE in active and self._last is not None:
            return self._last
        taken_s, tip_um, velocity_um_per_s = self._tip()
        image = self._drawn(tip_um, velocity_um_per_s, active)
        if self._stamped:
            write_stamp(image, Stamp(tick & 0xFFFFFFFF, round(1e9 * taken_s), round(1e3 * tip_um)))
        elif fault.CLOCK in active:
            image[0, 0] ^= 1
        self._last = image.tobytes()
        return self._last

    def _drawn(self, tip_um: float, velocity_um_per_s: float, active: frozenset[str]) -> NDArray[np.uint8]:
        shape = self._scene.shape
        if fault.BLACK in active or fault.WHITE in active:
            return self._lamp(shape, 254 if fault.WHITE in active else 2)
        before = None if self._last is None else np.frombuffer(self._last, np.uint8).reshape(shape).copy()
        if fault.CLOCK in active and before is not None:
            return before
        self._shown_um = self._shown_um if fault.RECORDING in active else tip_um
        shown_um = _FAR_AWAY_UM if fault.AWAY in active else self._shown_um
        image = self._scene.render(shown_um, velocity_um_per_s, self._exposure_s)
        if fault.TORN in active and before is not None:
            image[shape[0] // 4 :] = before[shape[0] // 4 :]
        return image

    def _lamp(self, shape: tuple[int, int], level: int) -> NDArray[np.uint8]:
        return np.uint8(level) + self._rng.integers(0, 2, shape, np.uint8)

    def _send(self, picture: bytes, active: frozenset[str]) -> None:
        client = self._client
        if client is None:
            return
        if not select.select([], [client], [], 0.0)[1]:
            self.unsent += 1
            return
        data = _FRAME + picture
        if fault.GARBLE in active:
            cut = int(self._rng.integers(1, len(data) // 2))
            data = self._rng.bytes(cut) + data[2 * cut :]
        if self._send_bytes(data):
            self.sent += 1

    def _send_bytes(self, data: bytes) -> bool:
        """Whether everything was sent; a client that takes nothing for a while is hung up on."""
        if self._client is None:
            return False
        try:
            self._client.sendall(data)
        except OSError:
            self._hang_up()
            return False
        return True
