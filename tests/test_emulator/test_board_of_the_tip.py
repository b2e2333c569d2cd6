import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from bender_emulator.tip_board import TipReader, TipWriter

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


def test_a_board_is_read_after_each_turn_of_its_lines(tmp_path: Path):
    with TipWriter(tmp_path / "board") as writer, TipReader(tmp_path / "board") as reader:
        for k in range(1, 100):
            writer.publish(float(k), 2.0 * k, 3.0 * k)
            assert reader.at() == (k, 2.0 * k, 3.0 * k)


def test_a_new_board_shows_the_tip_at_rest(tmp_path: Path):
    with TipWriter(tmp_path / "board") as writer, TipReader(tmp_path / "board") as reader:
        assert reader.at()[1:] == (0.0, 0.0)
        writer.publish(1.0, 2.0, 3.0)
        assert reader.at() == (1.0, 2.0, 3.0)
