import io
import re
from pathlib import Path

import pytest

from bender_loop.shell.progress import LARGE_BYTES, Progress, heartbeat, print_table
from bender_loop.shell.run import Run, running


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


class _Clock:
    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


def test_pipe_gets_a_plain_line_at_most_every_two_seconds():
    stream, clock = io.StringIO(), _Clock()
    with Progress("tuning", stream, clock=clock) as progress:
        for done in range(10):
            clock.now_s = 0.5 * done
            progress.update(done, 10, f"best {done}")
    assert stream.getvalue().splitlines() == ["tuning: 4/10, best 4", "tuning: 8/10, best 8"]


def test_unknown_total_is_left_out():
    stream, clock = io.StringIO(), _Clock()
    with Progress("reading", stream, clock=clock) as progress:
        clock.now_s = 3.0
        progress.update(7)
    assert stream.getvalue() == "reading: 7\n"


def test_terminal_gets_a_bar_that_shows_text_with_brackets_as_it_is(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("TERM", "xterm")
    stream = _Terminal()
    with Progress("tuning", stream) as progress:
        progress.update(3, 10, "[red]x")
    assert "3/10" in stream.getvalue()
    assert "[red]x" in stream.getvalue()


def test_plain_table_is_aligned_and_free_of_escapes():
    stream = io.StringIO()
    print_table("gap", ["model", "rms_um"], [["paper", 12.34567], ["beam", None]], stream)
    assert stream.getvalue().splitlines() == [
        "gap",
        "model  rms_um",
        "-----  ------",
        "paper   12.35",
        "beam        -",
    ]


COLOUR = re.compile(r"\x1b\[(?:\d+;)*(?:3\d|9\d)[;m]")


@pytest.mark.parametrize("no_color", [False, True])
def test_terminal_honours_no_color(monkeypatch: pytest.MonkeyPatch, no_color: bool):
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.delenv("NO_COLOR", raising=False)
    if no_color:
        monkeypatch.setenv("NO_COLOR", "1")
    stream = _Terminal()
    with Progress("tuning", stream) as progress:
        progress.update(3, 10)
    assert bool(COLOUR.search(stream.getvalue())) is not no_color


def test_terminal_table_shows_brackets_as_they_are(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("TERM", "xterm-256color")
    stream = _Terminal()
    print_table("gap [all]", ["model", "rms_um"], [["[b]paper", 1.5]], stream)
    assert "[b]paper" in stream.getvalue()
    assert "gap [all]" in stream.getvalue()


def test_table_refuses_a_ragged_row():
    with pytest.raises(ValueError, match="expected 2 cells"):
        print_table("gap", ["model", "rms_um"], [["paper"]], io.StringIO())


@pytest.mark.parametrize(
    ("size", "said"), [(LARGE_BYTES, f"reading large.csv, {LARGE_BYTES / 1e6:.0f} MB"), (1000, "")]
)
def test_a_large_file_is_said_before_it_is_read(tmp_path: Path, size: int, said: str):
    path = tmp_path / "large.csv"
    with path.open("wb") as file:
        file.truncate(size)
    with running(Run("bender diagnose large.csv")) as run, heartbeat("bender diagnose", [None, "text", [path]]):
        assert run.doing == said
