"""Files are whole or not there."""

import os
from pathlib import Path

import pytest

from bender_loop.errors import InputError
from bender_loop.shell.files import prepare_directory, write_atomically


@pytest.mark.parametrize(("data", "stored"), [("µm\r\nend", "µm\r\nend".encode()), (b"\x00\xff", b"\x00\xff")])
def test_data_arrive_unchanged(tmp_path, data, stored):
    path = tmp_path / "out.txt"
    write_atomically(path, data)
    assert path.read_bytes() == stored


def test_an_old_file_is_replaced(tmp_path):
    path = tmp_path / "out.txt"
    path.write_text("a much longer text that was here before")
    write_atomically(path, "new")
    assert path.read_text() == "new"
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
