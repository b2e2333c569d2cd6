"""Two parts of another package, written from the how-to alone: a source without a switch, a sensor that streams."""

import contextlib
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any, cast

import pytest
from emulated_bench import wait_for
from foreign_bench.streaming import LaserHead
from foreign_bench.switchless import LabAmp
from present import present

from bender_hil.guard.guard import Status
from bender_hil.guard.rules import Trip
from bender_hil.guard.spares import Ended
from bender_hil.runner import steadiness
from bender_hil.runner.run import _explained
from bender_hil.runner.steadiness import NoReadingsError, watched_at_rest
from bender_hil.runner.tip_camera import CameraEyes
from bender_hil.sensors.sensor import Reading
from bender_hil.sensors.sensor_eyes import SensorEyes
from bender_hil.sensors.table import SensorTable, conversion
from bender_hil.sources.kinds import check_source, make_source
from bender_hil.supply.failures import NoReplyError
from bender_hil.supply.parse import Identity
from bender_hil.supply.source import Bounds

BOUNDS = Bounds(50.0, 55.0, 0.01)


class Wire:
    """One instrument behind a socket of this machine, which serves one client after the other."""

    def __init__(self, serve: Callable[[socket.socket], None]) -> None:
        self._serve, self._server = serve, socket.create_server(("127.0.0.1", 0))
        self.port = self._server.getsockname()[1]
        self._link: socket.socket | None = None
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            try:
                self._link, _ = self._server.accept()
                self._serve(self._link)
            except OSError:
                if self._server.fileno() < 0:
                    return

    def unplug(self) -> None:
        """End the link, and answer nobody any more."""
        # closing alone does not end a thread that waits there
        for end in (self._server, self._link):
            if end is not None:
                with contextlib.suppress(OSError):
                    end.shutdown(socket.SHUT_RDWR)
                end.close()


class LabAmpWire:
    """What a LabAmp says.

    Attributes:
        level_V: that it was told last.
        mute: whether it does nothing and says nothing.
    """

    def __init__(self) -> None:
        self.level_V, self.mute = 7.0, False

    def serve(self, link: socket.socket) -> None:
        for line in link.makefile("r", newline="\r"):
            word, _, value = line.strip().partition(" ")
            if self.mute:
                continue
            if word == "V":
                self.level_V = float(value)
            answer = {"ID": "LABAMP/MK2/0042/1.3", "V?": f"{self.level_V:.2f} {self.level_V - 0.02:.2f}"}.get(word)
            if answer is not None:
                link.sendall(f"{answer}\r".encode())


def frame(number: int, height_nm: int, status: int = 0) -> bytes:
    body = struct.pack(">HiB", number & 0xFFFF, height_nm, status)
    return b"\xaa\x55" + body + bytes([sum(body) & 255])


def stream(link: socket.socket) -> None:
    """What a laser head says: 60 µm, with some noise; two frames come in three parts, as TCP may cut them."""
    assert link.recv(1) == b"I"
    link.sendall(b"LT30   ser 0815 ")
    _, rate_Hz = struct.unpack(">cH", link.recv(3, socket.MSG_WAITALL))
    number = 0
    while True:
        two = frame(number, 60_000 + 7 * (number % 5)) + frame(number + 1, 60_000 + 11 * (number % 3))
        for part in (two[:4], two[4:13], two[13:]):
            link.sendall(part)
            time.sleep(2.0 / rate_Hz / 3.0)
        number += 2


@pytest.fixture
def amp() -> Iterator[tuple[LabAmpWire, Wire]]:
    said = LabAmpWire()
    wire = Wire(said.serve)
    yield said, wire
    wire.unplug()


def test_a_source_without_a_switch_is_armed_driven_and_off_at_0_V(amp: tuple[LabAmpWire, Wire]):
    said, wire = amp
    settings = LabAmp("127.0.0.1", wire.port)
    check_source("labamp", settings)
    source = make_source(settings, None)
    assert source.open() == Identity("LABAMP", "MK2", "0042", "1.3")
    assert said.level_V == 7.0
    assert source.arm(BOUNDS) == ["it has no output switch", "it has no current limit"]
    source.set_voltage(12.5)
    assert (source.voltage_setting_V(), source.measured_V()) == (12.5, pytest.approx(12.48))
    assert not source.confirm_off()
    source.off_blind()
    assert source.confirm_off()
    assert said.level_V == 0.0
    source.close()


def test_a_mute_source_never_says_off(amp: tuple[LabAmpWire, Wire]):
    said, wire = amp
    source = make_source(LabAmp("127.0.0.1", wire.port), None)
    source.open()
    source.arm(BOUNDS)
    source.set_voltage(20.0)
    assert source.voltage_setting_V() == 20.0
    said.mute = True
    source.patience.end_s = time.perf_counter() + 0.3
    with pytest.raises(NoReplyError):
        source.confirm_off()
    assert said.level_V == 20.0
    source.close()


def test_frames_are_read_whole_however_they_are_cut_and_an_unplugged_head_says_so():
    wire = Wire(stream)
    table = SensorTable("laser_head", LaserHead("127.0.0.1", wire.port), rate_Hz=200.0)
    sensor = table.instrument.make(table.rate_Hz)
    with SensorEyes(sensor, conversion(sensor.unit, None), name="laser_head (127.0.0.1)") as eyes:
        assert eyes.identity == Identity("Lasertron", "LT30", "0815", "1")
        eyes.zero(20)
        assert 0.002 < eyes.noise_um < 0.05
        assert eyes.reopened == 0
        wire.unplug()
        wait_for(lambda: "cannot be opened anew" in eyes.trouble())
        assert "the laser head closed the link" in eyes.trouble()
        for code, is_told in (("frame_age", True), ("travel", False)):
            ended = _explained(Ended(Status.TRIPPED, code, "as the guard has it", "", {}), eyes)
            assert ("the laser head closed the link" in str(ended.sentence)) == is_told
            assert ("; sensor: laser_head (127.0.0.1)" in str(ended.sentence)) == is_told


@pytest.mark.parametrize(("code", "is_told"), [("heartbeat", True), ("frame_age", True), ("travel", False)])
def test_why_a_controller_was_silent_is_told(code: str, is_told: bool):
    ended = Ended(Status.TRIPPED, code, "as the guard has it", "", {})
    hangs = Trip("controller_failed", "mine.fmu hangs")
    sentence = _explained(ended, cast(CameraEyes, None), hangs).sentence
    assert sentence == ("as the guard has it (mine.fmu hangs)" if is_told else "as the guard has it")


def test_a_head_that_cannot_be_closed_is_none():
    class Half(LaserHead):
        def make(self, rate_Hz: float) -> Any:
            return type("HalfSensor", (), {"unit": "nm", "cannot": (), "open": None, "read": None, "rate_Hz": rate_Hz})

    with pytest.raises(ValueError, match="without close"):
        SensorTable("laser_head", Half("127.0.0.1"))


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (lambda: 1.0, "read gave 1.0, expected a Reading or None"),
        (lambda: Reading(float("0=5.01"), time.perf_counter()), "could not convert string to float: '0=5.01'"),
        (lambda: Reading(5.0, time.perf_counter() + 3600.0), "expected a time of time.perf_counter"),
    ],
)
def test_a_sensor_of_another_package_that_errs_is_told_what_it_raised(
    wrong: Callable[[], Any], told: str, monkeypatch: pytest.MonkeyPatch
):
    class Erring(LaserHead):
        def make(self, rate_Hz: float) -> Any:
            del rate_Hz
            return SimpleNamespace(
                unit="um", cannot=(), open=lambda: Identity("a", "b", "c", "d"), read=lambda _: wrong(), close=int
            )

    monkeypatch.setattr(steadiness, "LONGEST_S", 2.0)
    sensor = Erring("127.0.0.1").make(30.0)
    with SensorEyes(sensor, conversion(sensor.unit, None)) as eyes, pytest.raises(NoReadingsError) as refused:
        watched_at_rest(eyes)
    assert told in str(refused.value)
    assert "picture" not in str(refused.value)


def test_what_it_cannot_do_is_a_tuple_of_sentences():
    class Texts(LaserHead):
        def make(self, rate_Hz: float) -> Any:
            sensor = LaserHead("127.0.0.1").make(rate_Hz)
            setattr(sensor, "cannot", "it has no range of its own")  # noqa: B010
            return sensor

    with pytest.raises(ValueError, match="cannot: found 'it has no range of its own', expected a tuple of sentences"):
        SensorTable("laser_head", Texts("127.0.0.1"))


def test_frames_that_waited_are_passed_over():
    wire = Wire(stream)
    sensor = LaserHead("127.0.0.1", wire.port).make(500.0)
    sensor.open()
    time.sleep(0.3)
    reading = present(sensor.read(0.1))
    assert reading.passed > 10
    assert 0.0 <= time.perf_counter() - reading.time_s < 0.1
    sensor.close()
    wire.unplug()
