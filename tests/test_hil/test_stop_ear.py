import socket
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest
from emulated_bench import assert_off, drive, emulated_supply, orders, wait_until_off
from scripted_source import ClockedSource, KeptJournal

from bender_export.build import ensure_plant_fmu
from bender_hil.bench_file import read_bench
from bender_hil.guard.guard import Guard
from bender_hil.guard.settings import GuardSettings
from bender_hil.guard.spares import Ended
from bender_hil.guard.start import GuardProcess
from bender_hil.guard.stop_ear import HEARD, StopEar, say_stop
from bender_hil.runner.program import OpenLoop
from bender_hil.runner.run import run
from bender_hil.runner.voltages import Voltages
from bender_loop.shell.messages import Listener, call

TOKEN = "0123456789abcdef0123456789abcdef"


def test_a_token_is_as_long_as_a_secret_has_to_be():
    StopEar(TOKEN[:16]).close()
    with pytest.raises(ValueError, match="at least 16 signs, found 15"):
        StopEar(TOKEN[:15])


@pytest.mark.parametrize("wrong", ["", TOKEN[:-1], TOKEN + "0", TOKEN.upper(), "é" * 16])
def test_anything_else_is_not(wrong):
    with StopEar(TOKEN) as ear, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as mouth:
        mouth.settimeout(0.05)
        mouth.sendto(wrong.encode(), ("127.0.0.1", ear.port))
        time.sleep(0.02)
        assert not ear.heard()
        with pytest.raises(TimeoutError):
            mouth.recv(10)


def test_a_flood_costs_little_and_does_not_hide_the_token():
    with StopEar(TOKEN) as ear, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as mouth:
        mouth.settimeout(1.0)
        for _ in range(100):
            mouth.sendto(b"x" * 2000, ("127.0.0.1", ear.port))
        mouth.sendto(TOKEN.encode(), ("127.0.0.1", ear.port))
        time.sleep(0.05)
        looks = 0
        while not ear.heard():
            looks += 1
            assert looks < 20
        assert mouth.recv(10) == HEARD
        assert not ear.heard()


def test_nobody_at_the_port_is_no_answer():
    with StopEar(TOKEN) as ear:
        port = ear.port
    assert not say_stop(port, TOKEN, 0.1)


def test_stop_goes_the_guards_one_way_down(tmp_path):
    with emulated_supply(tmp_path) as supply:
        guard = GuardProcess(replace(orders(supply.resource, tmp_path), stop_token=TOKEN))
        port = guard.ready["stop_port"]
        assert TOKEN not in (tmp_path / "guard.jsonl").read_text()
        drive(guard, 12)
        assert supply.truth()["is_on"]
        pressed_s = time.perf_counter()
        said = threading.Thread(target=lambda: [say_stop(port, TOKEN, 0.05) for _ in range(20)])
        said.start()
        off_s = wait_until_off(supply)
        ended = guard.wait()
        said.join()
        assert (ended.code, ended.sentence, ended.alarm) == ("stop", "STOP was pressed", "")
        # 30 V at 500 V/s are 60 ms; a busy machine gets patience, `bender benchmark hil` measures
        assert 0.0 < off_s - pressed_s < 2.0
        assert_off(supply)
        assert TOKEN not in (tmp_path / "guard.jsonl").read_text()


def test_without_a_token_nobody_listens(tmp_path):
    with emulated_supply(tmp_path) as supply:
        guard = GuardProcess(orders(supply.resource, tmp_path))
        assert "stop_port" not in guard.ready
        guard.stop()
        assert guard.wait().alarm == ""


@pytest.mark.slow
def test_who_says_stop_once_more_on_the_way_down_is_answered():
    listener = Listener()
    theirs = call(listener.port, listener.password)
    ours = listener.accept(5.0)
    listener.close()
    ear = StopEar(TOKEN)
    limits = GuardSettings(shutdown_limit_s=1.5, discharge_limit_s=0.2)
    guard = Guard(ClockedSource(refused_offs=10**6), limits, theirs, KeptJournal(), ear)
    thread = threading.Thread(target=guard.run)
    with ours, theirs, ear:
        thread.start()
        answers = [say_stop(ear.port, TOKEN, 1.0) for _ in range(3)]
        thread.join()
    assert answers == [True, True, True]


class Button:
    """Who may say STOP, and which ports it was told, with how many guards had been waited for by then."""

    token = TOKEN

    def __init__(self) -> None:
        self.waited = 0
        self.told: list[tuple[bool, int]] = []

    def armed(self, port: int | None) -> None:
        self.told.append((port is not None, self.waited))


def test_who_says_stop_is_connected_until_the_output_is_off(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip("cv2")
    button, wait = Button(), GuardProcess.wait

    def waited(guard: GuardProcess) -> Ended:
        ended = wait(guard)
        button.waited += 1
        return ended

    monkeypatch.setattr(GuardProcess, "wait", waited)
    path = tmp_path / "bench.toml"
    path.write_text("[emulator]\n[guard]\nheartbeat_s = 1.0\nframe_age_s = 1.0\n")
    program = OpenLoop(Voltages((0.0,), (0.0,), 0.3))
    run(read_bench(path), program, tmp_path / "run", fmu=ensure_plant_fmu, stop=button)
    assert button.told == [(True, 0), (False, 1)]
