"""The frame server and its faults over real sockets, and as a process of its own."""

import json
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from few import few

from bender_emulator.microscope import (
    FAULTS,
    ControlServer,
    FrameServer,
    Scene,
    SceneSettings,
    ask_microscope,
    clear_faults,
    read_stamp,
    set_fault,
)
from bender_emulator.tip_board import TipWriter

pytest.importorskip("cv2", reason="needs the extra bench")

SHAPE = (96, 160)
SETTINGS = SceneSettings(width_px=SHAPE[1], height_px=SHAPE[0], rest_x_px=100.0, rest_y_px=48.0, dust=1, specks=1)
RATE = 100.0


@contextmanager
def serving(stamped: bool = True) -> Iterator[FrameServer]:
    scene_rng, rng = np.random.default_rng(1).spawn(2)
    scene = Scene(SETTINGS, scene_rng)
    with FrameServer(scene, _still, frames_per_s=RATE, exposure_s=0.001, rng=rng, stamped=stamped) as server:
        yield server


def _still() -> tuple[float, float, float]:
    return time.perf_counter(), 5.0, 0.0


class Client:
    """Reads the stream by the letter of its format."""

    def __init__(self, address: str) -> None:
        host, port = address.removeprefix("tcp://").split(":")
        self._link = socket.create_connection((host, int(port)), 5.0)
        self._lines = self._link.makefile("rb")
        self.header = self._lines.readline()

    def frame(self) -> np.ndarray | None:
        """The next frame, None at the end of the stream."""
        if self._lines.readline() != b"FRAME\n":
            return None
        data = self._lines.read(SHAPE[0] * SHAPE[1])
        return np.frombuffer(data, np.uint8).reshape(SHAPE)

    def within(self, timeout_s: float) -> bool:
        """Whether a frame comes in time."""
        self._link.settimeout(timeout_s)
        try:
            return self.frame() is not None
        except TimeoutError:
            return False

    def close(self) -> None:
        self._lines.close()
        self._link.close()

    def __enter__(self) -> "Client":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def test_stream_is_what_its_format_says_and_carries_the_truth():
    with serving() as server, Client(server.address) as client:
        assert client.header == b"YUV4MPEG2 W160 H96 F100000:1000 Ip A1:1 Cmono\n"
        stamps = [read_stamp(frame) for _ in range(5) if (frame := client.frame()) is not None]
    assert len(stamps) == 5
    assert all(stamp is not None and stamp.tip_nm == 5000 for stamp in stamps)
    numbers = [stamp.number for stamp in stamps if stamp is not None]
    assert numbers == sorted(set(numbers))
    ages_s = [time.perf_counter() - 1e-9 * stamp.taken_ns for stamp in stamps if stamp is not None]
    assert all(0.0 < age < 10.0 for age in ages_s)


def test_new_client_takes_the_place_of_the_old_one():
    with serving() as server, Client(server.address) as old:
        assert old.frame() is not None
        with Client(server.address) as new:
            assert new.frame() is not None
            deadline = time.monotonic() + 5.0
            while old.frame() is not None and time.monotonic() < deadline:
                pass
            assert time.monotonic() < deadline


def test_client_that_does_not_read_loses_frames_and_stops_nobody():
    with serving() as server, Client(server.address) as client:
        deadline = time.monotonic() + 20.0
        while server.unsent == 0 and time.monotonic() < deadline:
            time.sleep(0.05)
        assert server.unsent > 0
        assert client.frame() is not None


def test_stall_stops_the_frames_and_ends_by_itself():
    with serving() as server, Client(server.address) as client:
        assert client.frame() is not None
        server.faults.set("stall", 0.5)
        start = time.monotonic()
        frames = [client.frame() for _ in range(30)]
        assert all(frame is not None for frame in frames)
        assert time.monotonic() - start > 0.4


def test_drop_cuts_the_link_and_refuses_until_cleared():
    with serving() as server, Client(server.address) as client:
        assert client.frame() is not None
        server.faults.set("drop")
        while client.frame() is not None:
            pass
        with Client(server.address) as refused:
            assert refused.header == b""
        server.faults.clear()
        with Client(server.address) as again:
            assert again.frame() is not None


@pytest.mark.parametrize(("fault", "low", "high"), [("black", 0, 5), ("white", 250, 255)])
def test_lamp_faults(fault: str, low: int, high: int):
    with serving(stamped=False) as server:
        server.faults.set(fault)
        with Client(server.address) as client:
            frame = client.frame()
    assert frame is not None
    assert low <= frame.min() <= frame.max() <= high


def test_frozen_picture_repeats_to_the_byte():
    with serving() as server, Client(server.address) as client:
        first, second = client.frame(), client.frame()
        assert first is not None
        assert second is not None
        assert not np.array_equal(first, second)
        server.faults.set("freeze")
        last = client.frame()
        equal = 0
        while equal < 3:
            frame = client.frame()
            assert frame is not None
            assert last is not None
            equal = equal + 1 if np.array_equal(frame, last) else 0
            last = frame


def test_tip_away_leaves_no_wire():
    with serving(stamped=False) as server:
        with Client(server.address) as client:
            seen = client.frame()
        server.faults.set("away")
        with Client(server.address) as client:
            away = client.frame()
    assert seen is not None
    assert away is not None
    assert np.percentile(seen, 5) < 90 < 120 < np.percentile(away, 5)


def test_garbled_stream_is_no_stream_for_long():
    with serving() as server, Client(server.address) as client:
        assert client.frame() is not None
        server.faults.set("garble")
        for _ in range(50):
            if client.frame() is None:
                return
    pytest.fail("fifty garbled frames still had their marks in place")


def test_control_port_answers_by_the_line():
    with serving() as server, ControlServer(server) as control:
        assert set(json.loads(ask_microscope(control.port, "status"))) >= {
            "sent",
            "unsent",
            "late",
            "connected",
            "faults",
        }
        set_fault(control.port, "stall", 30.0)
        set_fault(control.port, "black")
        assert server.faults.active() == {"stall", "black"}
        clear_faults(control.port)
        assert server.faults.active() == frozenset()
        for line, expected in (
            ("explode 1", "fault: found 'explode'"),
            ("stall -1", "duration"),
            ("a b c", "expected"),
        ):
            with pytest.raises(ValueError, match=expected):
                ask_microscope(control.port, line)
        assert {"away", "black", "clock", "drop", "freeze", "garble", "recording", "stall", "torn", "white"} == set(
            FAULTS
        )


def test_impossible_rates_are_refused():
    scene, rng = Scene(SETTINGS, np.random.default_rng(1)), np.random.default_rng(1)
    for rate, exposure, named in ((0.0, 0.0, "frames_per_s"), (30.0, 0.1, "exposure_s"), (2000.0, 0.0, "frames_per_s")):
        with pytest.raises(ValueError, match=named):
            FrameServer(scene, lambda: (0.0, 0.0, 0.0), frames_per_s=rate, exposure_s=exposure, rng=rng)


def test_process_reads_the_board_and_ends_with_its_parent(tmp_path):
    board = tmp_path / "board"
    command = [sys.executable, "-m", "bender_emulator.microscope", "--board", str(board), "--frames-per-s", "60",
               "--scene", json.dumps({"width_px": SHAPE[1], "height_px": SHAPE[0], "rest_x_px": 100.0})]  # fmt: skip
    with TipWriter(board) as writer:
        writer.publish(time.perf_counter(), 12.345, 0.0)
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            place = json.loads(process.stdout.readline())
            with Client(place["stream"]) as client:
                frame = client.frame()
            assert json.loads(ask_microscope(place["control_port"], "status"))["faults"] == []
        finally:
            process.stdin.close()
            assert process.wait(10.0) == 0
            process.stdout.close()
    assert frame is not None
    stamp = read_stamp(frame)
    assert stamp is not None
    assert stamp.tip_nm == 12345


@pytest.mark.parametrize(
    "extra", few([["--scene", "[1]"], ["--scene", '{"dust": -1}'], ["--frames-per-s", "0"], []], 0, 1)
)
def test_process_says_what_is_wrong(tmp_path, extra: list[str]):
    board = tmp_path / "board"
    if extra:
        TipWriter(board).close()
    command = [sys.executable, "-m", "bender_emulator.microscope", "--board", str(board), *extra]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=30, check=False)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith("microscope: ")
    assert len(done.stderr.splitlines()) == 1
