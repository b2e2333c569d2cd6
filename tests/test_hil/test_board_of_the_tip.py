import subprocess
import sys
from pathlib import Path

from bender_hil.emulator.tip_board import TipReader, TipWriter

WRITER = """
import sys, time
from bender_hil.emulator.tip_board import TipWriter
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


def test_a_new_board_shows_the_tip_at_rest(tmp_path: Path):
    with TipWriter(tmp_path / "board") as writer, TipReader(tmp_path / "board") as reader:
        assert reader.at()[1:] == (0.0, 0.0)
        writer.publish(1.0, 2.0, 3.0)
        assert reader.at() == (1.0, 2.0, 3.0)
