"""The emulated microscope: what it draws, its frame server and faults over real sockets, the tip's board."""

import json
import math
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawn_wire import draw
from few import few
from hypothesis import given, settings
from hypothesis import strategies as st
from present import present

from bender_emulator.microscope import (
    FAULTS,
    ControlServer,
    FrameServer,
    Scene,
    SceneSettings,
    Stamp,
    ask_microscope,
    clear_faults,
    read_stamp,
    set_fault,
)
from bender_emulator.microscope.optics import bar, step
from bender_emulator.microscope.stamp import HEIGHT_PX, WIDTH_PX, write_stamp
from bender_emulator.tip_board import TipReader, TipWriter

pytest.importorskip("cv2", reason="needs the extra bench")

PLAIN = SceneSettings(
    width_px=320, height_px=240, rest_x_px=200.0, rest_y_px=120.0, light_levels=190.0, light_slope=0.0, vignette=0.0,
    opacity=130.0 / 190.0, halo=0.0, glint=0.0, dust=0, specks=0, noise_levels=0.0,
)  # fmt: skip


def _scene(**changes: object) -> Scene:
    return Scene(replace(PLAIN, **changes), np.random.default_rng(1))  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("tip_um", few([0.0, 31.7, -60.0], 0))
@pytest.mark.parametrize("blur_px", [0.9, 2.5])
def test_wire_is_where_the_oracle_draws_it(tip_um: float, blur_px: float):
    scene = _scene(blur_px=blur_px, rest_angle_deg=2.0)
    x, y = scene.tip_px(tip_um)
    angle = math.radians(2.0) + PLAIN.rotation_rad_per_um * tip_um
    expected = draw(x, y, angle, blur_px=blur_px)
    # the scene takes a pixel's width for a little more blur, which tells at sharp edges, and the same on both sides
    off = scene.clean(tip_um) - expected
    assert np.abs(off).max() < 3.5
    assert np.sqrt(np.mean(off**2)) < 0.25
    assert abs(off.mean()) < 1e-3
    assert np.abs(scene.render(tip_um) - scene.clean(tip_um)).max() <= 0.51


def test_tip_moves_across_the_wire_by_the_scale():
    scene = _scene(rest_angle_deg=10.0)
    rest, moved = np.array(scene.tip_px(0.0)), np.array(scene.tip_px(30.0))
    assert np.hypot(*(moved - rest)) == pytest.approx(20.0)
    assert (moved - rest) @ (math.cos(math.radians(10.0)), math.sin(math.radians(10.0))) == pytest.approx(0.0, abs=1e-9)


def test_smear_is_the_mean_over_the_exposure():
    scene = _scene(rotation_rad_per_um=0.0)
    smear_px = 6.0
    places_um = (np.arange(200) + 0.5) / 200 * smear_px * PLAIN.um_per_px - smear_px * PLAIN.um_per_px / 2
    expected = np.mean([scene.clean(place) for place in places_um], axis=0)
    assert np.abs(scene.clean(0.0, smear_px) - expected).max() < 0.5


def test_distortion_bends_the_picture_and_not_the_truth():
    straight, bent = _scene(), _scene(distortion=0.05)
    x_um, y_um = bent.object_um()
    row, column = 200, 40
    factor = 1.0 + 0.05 * ((column - 159.5) ** 2 + (row - 119.5) ** 2) / (160**2 + 120**2)
    assert x_um[row, column] == pytest.approx(1.5 * factor * (column - 159.5))
    assert y_um[row, column] == pytest.approx(1.5 * factor * (row - 119.5))
    assert bent.tip_px(40.0) == straight.tip_px(40.0)
    assert np.abs(bent.clean(40.0) - straight.clean(40.0)).max() > 20.0


def test_a_tip_far_away_leaves_the_light_and_noise_of_the_size_asked_for_that_never_repeats():
    scene = _scene(noise_levels=5.0)
    assert np.array_equal(scene.clean(1e5), scene.light)
    assert np.array_equal(scene.clean(-1e5), scene.light)
    first, second = scene.render(1e5).astype(float), scene.render(1e5).astype(float)
    assert np.std(first - 190.0) == pytest.approx(5.0, rel=0.03)
    assert np.std(first - second) == pytest.approx(5.0 * math.sqrt(2.0), rel=0.03)


def test_same_seed_same_pictures():
    one, two = (Scene(SceneSettings(fibres=2, jpeg_quality=80), np.random.default_rng(7)) for _ in range(2))
    assert all(np.array_equal(one.render(tip), two.render(tip)) for tip in (0.0, 10.0))


@given(width=st.floats(0.5, 30.0), blur=st.floats(0.1, 5.0), smear=st.floats(0.0, 30.0))
def test_bar_keeps_its_light(width: float, blur: float, smear: float):
    place = np.arange(-150.0, 150.0, 0.05)
    profile = bar(place, width, blur, smear)
    assert profile.sum() * 0.05 == pytest.approx(width, rel=1e-3)
    assert -1e-9 <= profile.min() <= profile.max() <= 1.0 + 1e-9
    assert np.allclose(bar(-place, width, blur, smear), profile, atol=1e-9)
    rising = step(place, blur, smear)
    assert np.all(np.diff(rising) >= -1e-12)
    assert rising[0] == pytest.approx(0.0, abs=1e-9)
    assert rising[-1] == pytest.approx(1.0)


@settings(max_examples=25)
@given(
    number=st.integers(0, 2**32 - 1), taken_ns=st.integers(0, 2**64 - 1), tip_nm=st.integers(-(2**31), 2**31 - 1),
    seed=st.integers(0, 100),
)  # fmt: skip
def test_stamp_comes_back(number: int, taken_ns: int, tip_nm: int, seed: int):
    rng = np.random.default_rng(seed)
    image = rng.integers(0, 256, (HEIGHT_PX + 5, WIDTH_PX + 9), np.uint8)
    before = image.copy()
    stamp = Stamp(number, taken_ns, tip_nm)
    write_stamp(image, stamp)
    assert read_stamp(image) == stamp
    assert np.array_equal(image[:5], before[:5])
    assert np.array_equal(image[:, :9], before[:, :9])


def test_damaged_or_missing_stamp_is_none():
    image = np.full((HEIGHT_PX, WIDTH_PX), 128, np.uint8)
    assert read_stamp(image) is None
    write_stamp(image, Stamp(1, 2, 3))
    image[:4, :4] = 255 - image[:4, :4]
    assert read_stamp(image) is None
    assert read_stamp(image[:10]) is None
    with pytest.raises(ValueError, match="image: found"):
        write_stamp(image[:10], Stamp(1, 2, 3))
    with pytest.raises(ValueError, match="does not fit"):
        write_stamp(image, Stamp(-1, 2, 3))


@pytest.mark.parametrize(
    ("table", "named"),
    [
        ({"um_per_px": 0}, "um_per_px"),
        ({"width_px": 640.5}, "width_px"),
        ({"dust": -1}, "dust"),
        ({"opacity": 1.5}, "opacity"),
        ({"jpeg_quality": 101}, "jpeg_quality"),
        ({"blur_px": "much"}, "blur_px"),
        ({"colour": 1}, "colour"),
        ({"noise_levels": math.inf}, "noise_levels"),
    ],
)
def test_bad_settings_are_named(table: dict, named: str):
    with pytest.raises(ValueError, match=f"^{named}: "):
        SceneSettings.from_table(table)


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


@pytest.mark.parametrize(
    ("fault", "low", "high"), [("black", 0, 5), ("white", 250, 255), ("away", 120, 255), (None, 0, 90)]
)
def test_a_lamp_out_or_too_bright_and_a_wire_away_are_what_the_picture_shows(fault: str | None, low: int, high: int):
    with serving(stamped=False) as server:
        if fault is not None:
            server.faults.set(fault)
        with Client(server.address) as client:
            frame = present(client.frame())
    shown = np.percentile(frame, 5) if fault in ("away", None) else frame
    assert low <= np.min(shown) <= np.max(shown) <= high


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
    stamp = present(read_stamp(frame))
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


WRITER = """
import sys, time
from bender_emulator.tip_board import TipWriter
with TipWriter(sys.argv[1]) as board:
    print("ready", flush=True)
    end = time.perf_counter() + 0.5
    k = 0
    while time.perf_counter() < end:
        k += 1
        board.publish(float(k), 2.0 * k, 3.0 * k)
"""


def test_a_reader_in_another_process_never_sees_half_a_line(tmp_path: Path):
    path = tmp_path / "board"
    with subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, text=True) as writer:
        assert writer.stdout is not None
        assert writer.stdout.readline() == "ready\n"
        seen = set()
        with TipReader(path) as reader:
            while writer.poll() is None:
                time_s, tip_um, velocity = reader.at()
                if time_s == int(time_s) and tip_um:
                    assert (tip_um, velocity) == (2.0 * time_s, 3.0 * time_s)
                    seen.add(time_s)
    assert len(seen) > 10


@pytest.mark.skipif(sys.platform == "win32", reason="no signal stops a process on Windows")
def test_a_writer_stopped_in_the_middle_of_a_line_leaves_the_line_before(tmp_path: Path):
    path = tmp_path / "board"
    with subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, text=True) as writer:
        assert writer.stdout is not None
        assert writer.stdout.readline() == "ready\n"
        with TipReader(path) as reader:
            for _ in range(100):
                writer.send_signal(signal.SIGSTOP)
                time.sleep(0.001)
                try:
                    time_s, tip_um, velocity = reader.at()
                finally:
                    writer.send_signal(signal.SIGCONT)
                if tip_um:
                    assert (tip_um, velocity) == (2.0 * time_s, 3.0 * time_s)
                time.sleep(0.001)


def test_a_board_shows_the_tip_at_rest_and_then_each_turn_of_its_lines(tmp_path: Path):
    with TipWriter(tmp_path / "board") as writer, TipReader(tmp_path / "board") as reader:
        assert reader.at()[1:] == (0.0, 0.0)
        for k in range(1, 100):
            writer.publish(float(k), 2.0 * k, 3.0 * k)
            assert reader.at() == (k, 2.0 * k, 3.0 * k)
