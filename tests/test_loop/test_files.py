"""Files are written whole or not at all and read within bounds; progress; extras that are missing."""

import argparse
import io
import json
import os
import re
import socket
import time
from pathlib import Path

import pytest

from bender_loop.errors import InputError
from bender_loop.shell.extras import install_command, require
from bender_loop.shell.files import (
    keep_earlier,
    prepare_directory,
    read_text_file,
    results_folder,
    write_atomically,
    write_result,
)
from bender_loop.shell.progress import LARGE_BYTES, Progress, heartbeat, print_table
from bender_loop.shell.run import Run, doing, running


@pytest.mark.parametrize(("data", "stored"), [("µm\r\nend", "µm\r\nend".encode()), (b"\x00\xff", b"\x00\xff")])
def test_data_replace_an_old_file_unchanged(tmp_path, data, stored):
    path = tmp_path / "out.txt"
    path.write_text("a much longer text that was here before")
    write_atomically(path, data)
    assert path.read_bytes() == stored
    assert os.listdir(tmp_path) == ["out.txt"]


@pytest.mark.parametrize("failure", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch, failure):
    path = tmp_path / "out.txt"
    path.write_text("old")

    def fail(*_: object) -> None:
        raise failure

    monkeypatch.setattr(os, "replace", fail)
    expected = InputError if isinstance(failure, OSError) else KeyboardInterrupt
    with pytest.raises(expected):
        write_atomically(path, "new")
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["out.txt"]


def test_impossible_places_are_bad_input(tmp_path):
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "missing" / "out.txt", tmp_path / "file" / "out.txt", tmp_path):
        with pytest.raises(InputError, match="cannot be written"):
            write_atomically(path, "new")
    assert os.listdir(tmp_path) == ["file"]


def test_a_directory_is_made_with_its_parents_and_left_empty(tmp_path):
    path = tmp_path / "a" / "b"
    assert prepare_directory(path) == path == prepare_directory(path)
    assert os.listdir(path) == []


def test_impossible_directories_are_bad_input(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(InputError, match="cannot be used as output directory"):
            prepare_directory(path)

    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "touch", refuse)
    with pytest.raises(InputError, match="Permission denied"):
        prepare_directory(tmp_path)


def test_text_arrives_with_its_line_ends_and_without_a_byte_order_mark(tmp_path):
    path = tmp_path / "in.txt"
    path.write_bytes("\ufeffµm\r\nend".encode())
    assert read_text_file(path, 100, "a text") == "µm\r\nend"
    path.write_bytes(b"x" * 100)
    assert read_text_file(path, 100, "a text") == "x" * 100
    path.write_bytes(b"")
    assert read_text_file(path, 0, "a text") == ""


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"x" * 101, "found more than 100 bytes"),
        (b"ab\x00c", "byte 2 is NUL"),
        (b"ab\xffc", "byte 2 is not UTF-8"),
        ("x".encode("utf-16"), "is NUL"),
    ],
)
def test_text_that_is_none_or_too_much_is_refused(tmp_path, data, words):
    path = tmp_path / "in.txt"
    path.write_bytes(data)
    with pytest.raises(InputError, match=words) as caught:
        read_text_file(path, 100, "a text")
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "name",
    ["missing", "a\x00b", "a\nb", "x" * 5000, "", ".", "\udcff", "missing/deeper"],
    ids=lambda name: ascii(name)[:12],
)
def test_a_path_that_cannot_be_read_is_bad_input_in_one_line(tmp_path, name):
    with pytest.raises(InputError, match="expected a text") as caught:
        read_text_file(tmp_path / name, 100, "a text")
    assert str(caught.value).isprintable()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="named pipes and devices of Unix")
def test_a_pipe_a_device_and_a_socket_are_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to("/dev/zero")
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(tmp_path / "socket"))
        start_s = time.perf_counter()
        for path in (tmp_path / "pipe", tmp_path / "link", tmp_path / "socket", Path("/dev/zero")):
            with pytest.raises(InputError, match="a regular file"):
                read_text_file(path, 100, "a text")
    assert time.perf_counter() - start_s < 1.0


def test_results_of_an_earlier_run_are_overwritten_only_when_asked(tmp_path: Path):
    (tmp_path / "demo").mkdir()
    asked, forced = (argparse.Namespace(out=tmp_path / "demo", force=x) for x in (False, True))
    assert results_folder(asked) == asked.out
    (asked.out / "index.html").touch()
    assert results_folder(forced) == asked.out
    with pytest.raises(InputError, match=r"demo: holds the results of an earlier run.*--force"):
        results_folder(asked)


def test_results_without_a_name_get_one_where_nothing_is_yet(tmp_path: Path):
    for name in ("compare-a.b", "compare-a.b-2", "compare-a.b-3"):
        asked = argparse.Namespace(out=None, force=False, usual_out=tmp_path / "compare-a.b")
        assert results_folder(asked) == asked.out == tmp_path / name
        asked.out.mkdir()


def test_results_of_another_question_are_kept_and_those_of_the_same_one_replaced(tmp_path: Path):
    out = tmp_path / "results"
    out.mkdir()
    for command, kept in (("bender compare a", 0), ("bender compare a", 0), ("bender compare b", 1), ("bender c", 2)):
        with running(Run(command, quiet=True)):
            keep_earlier(out, "r.json", ["picture.png", "other.png"])
            write_result(out / "r.json", {"by": command})
            (out / "picture.png").write_text(command)
        assert len(list(out.glob("earlier*"))) == kept
    assert [json.loads(x.read_text())["by"] for x in sorted(out.glob("*/r.json"))] == [
        "bender compare a",
        "bender compare b",
    ]
    assert (out / "earlier" / "picture.png").read_text() == "bender compare a"
    assert (out / "picture.png").read_text() == "bender c"


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("total", "shown"),
    [(10, ["tuning: 4/10, best 4", "tuning: 8/10, best 8"]), (None, ["tuning: 4, best 4", "tuning: 8, best 8"])],
)
def test_pipe_gets_a_plain_line_at_most_every_two_seconds(total: int | None, shown: list[str]):
    stream, now_s = io.StringIO(), 0.0
    with Progress("tuning", stream, clock=lambda: now_s) as progress:
        for done in range(10):
            now_s = 0.5 * done
            progress.update(done, total, f"best {done}")
    assert stream.getvalue().splitlines() == shown


COLOUR = re.compile(r"\x1b\[(?:\d+;)*(?:3\d|9\d)[;m]")


@pytest.mark.parametrize("no_color", [False, True])
def test_terminal_gets_a_bar_and_a_table_that_show_brackets_and_honour_no_color(
    monkeypatch: pytest.MonkeyPatch, no_color: bool
):
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.delenv("NO_COLOR", raising=False)
    if no_color:
        monkeypatch.setenv("NO_COLOR", "1")
    bar, table = _Terminal(), _Terminal()
    with Progress("tuning", bar) as progress:
        progress.update(3, 10, "[red]x")
    print_table("gap [all]", ["model", "rms_um"], [["[b]paper", 1.5]], table)
    assert bool(COLOUR.search(bar.getvalue())) is not no_color
    assert all(x in bar.getvalue() for x in ("3/10", "[red]x"))
    assert all(x in table.getvalue() for x in ("[b]paper", "gap [all]"))


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


@pytest.mark.parametrize("columns", [60, 80, 120])
def test_a_table_of_sentences_is_no_wider_than_the_terminal(columns: int, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("COLUMNS", str(columns))
    found, advice = " ".join(["another supply answers there"] * 5), " ".join(["correct its address"] * 7)
    rows = [["source", "failed", found, advice], ["sensor", "fine", "laser", ""]]
    stream, wide = io.StringIO(), io.StringIO()
    print_table("check", ["what", "state", "found", "what to do"], rows, stream, of_sentences=True)
    print_table("check", ["what", "state", "found", "what to do"], rows, wide)
    lines = stream.getvalue().splitlines()
    assert max(map(len, lines)) <= columns
    assert sorted(stream.getvalue().replace("-", "").split()) == sorted(wide.getvalue().replace("-", "").split())
    assert max(map(len, wide.getvalue().splitlines())) > 200
    assert len([line for line in lines if line.startswith(("source", "sensor"))]) == 2


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


def test_an_extra_is_installed_by_what_an_index_has():
    assert "nicegui" in install_command("live").split()
    assert "piezo-bender" not in install_command("formats")
    assert '".[nonsense]" in the checkout' in install_command("nonsense")


def test_what_is_missing_is_refused_with_the_command_that_brings_it():
    require("json", "live", "this")
    with pytest.raises(InputError, match=r"this needs no_such_module.*python -m pip install .*pyarrow"):
        require("no_such_module", "formats", "this")


def test_work_that_is_named_is_what_a_silence_is_filled_with():
    with running(Run("bender bench check")) as run, heartbeat("bender bench"):
        doing("dry run at 0 V")
        assert run.doing == "dry run at 0 V"
    doing("nothing runs, and nothing is said")
