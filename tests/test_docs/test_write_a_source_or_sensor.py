"""The how-to of own sources and sensors, followed: its package is installed and drives instruments on the wire."""

import json
import re
import socketserver
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from page_packages import bender, installed

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "how-to" / "write-a-source-or-sensor.md").read_text(encoding="utf-8")
MOST_LINES = 60


class Rig:
    """An amplifier and a probe over one actuator: 0.5 µm/V behind 50 ms.

    Attributes:
        deaf: whether the amplifier takes lines and does nothing with them.
    """

    def __init__(self) -> None:
        self.level_V, self.on, self.deaf, self.silent = 0.0, False, False, False
        self.tip_um, self.seen_s = 0.0, time.perf_counter()
        self.rng = np.random.default_rng(4)
        self.lock = threading.Lock()
        self.highest_V = 0.0

    def amplifier(self, line: str) -> str:
        word, _, value = line.partition(" ")
        with self.lock:
            self.advance()
            if word == "V" and not self.deaf:
                self.level_V = float(value)
                self.highest_V = max(self.highest_V, self.level_V)
            elif word in ("ON", "OFF") and not self.deaf:
                self.on = word == "ON"
            return {"WHO?": "amplifier,7", "V?": f"{self.level_V:.2f}", "STATE?": str(int(self.on))}.get(word, "ok")

    def probe(self, _: str) -> str:
        with self.lock:
            self.advance()
            while self.silent:
                self.lock.release()
                time.sleep(0.01)
                self.lock.acquire()
            return f"{self.tip_um + 0.005 * self.rng.standard_normal():.5f}"

    def advance(self) -> None:
        now_s = time.perf_counter()
        drive_V = self.level_V if self.on else 0.0
        self.tip_um += (0.5 * drive_V - self.tip_um) * -np.expm1((self.seen_s - now_s) / 0.05)
        self.seen_s = now_s


class Server(socketserver.ThreadingTCPServer):
    daemon_threads = allow_reuse_address = True


def served(answer: Any) -> Server:
    class Handler(socketserver.StreamRequestHandler):
        def handle(self) -> None:
            for line in self.rfile:
                try:
                    self.wfile.write(f"{answer(line.decode().strip())}\n".encode())
                except OSError:
                    return

    server = Server(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return server


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package as installed."""
    site = installed(PAGE, tmp_path_factory.mktemp("site"), "lab_bench")
    assert all(len(path.read_text(encoding="utf-8").splitlines()) < MOST_LINES for path in site.rglob("*.py"))
    return site


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    rig = Rig()
    with served(rig.amplifier) as amplifier, served(rig.probe) as probe:
        (tmp_path / "bench.toml").write_text(
            f'[source]\nkind = "lab_amplifier"\nhost = "127.0.0.1"\nport = {amplifier.server_address[1]}\n'
            f'[sensor]\nkind = "lab_probe"\nhost = "127.0.0.1"\nport = {probe.server_address[1]}\nrate_Hz = 50\n'
            "[guard]\nheartbeat_s = 1.0\nframe_age_s = 0.8\nshutdown_limit_s = 2.0\n"
        )
        yield rig
        rig.silent = False


@pytest.mark.slow
def test_a_foreign_source_and_a_foreign_sensor_are_checked_and_driven(site: Path, rig: Rig, tmp_path: Path):
    pytest.importorskip("pyvisa_py", reason="needs the extra bench")
    done = bender(site, tmp_path, "bench", "check", "--bench", "bench.toml", "--out", "check")
    assert done.returncode == 0, done.stdout + done.stderr
    said = json.loads((tmp_path / "check" / "check.json").read_text())
    words = " ".join(finding["found"] for finding in said["findings"])
    assert "our laboratory amplifier 7" in words
    assert "it has no current limit" in words
    moved = re.search(r"([-+.\d]+) µm/V", words)
    assert moved is not None
    assert float(moved[1]) == pytest.approx(0.5, abs=0.02)
    done = bender(site, tmp_path, "hil", "--bench", "bench.toml", "--profile", "staircase", "--out", "stairs")
    assert done.returncode == 0, done.stdout + done.stderr
    assert rig.highest_V == 50.0
    assert not rig.on
    assert rig.level_V == 0.0


@pytest.mark.slow
def test_a_foreign_sensor_that_stalls_and_an_amplifier_that_is_deaf(site: Path, rig: Rig, tmp_path: Path):
    pytest.importorskip("pyvisa_py", reason="needs the extra bench")

    def spoil() -> None:
        while rig.highest_V < 15.0:
            time.sleep(0.01)
        rig.deaf = rig.silent = True

    thread = threading.Thread(target=spoil, daemon=True)
    thread.start()
    done = bender(site, tmp_path, "hil", "--bench", "bench.toml", "--profile", "staircase", "--out", "stairs")
    # it is on, and cannot be switched off: that has to be said
    assert rig.on
    assert done.returncode == 3, done.stdout + done.stderr
    assert "OUTPUT STATE UNKNOWN" in done.stderr
