"""Files, folders and streams that grow, are replaced, or begin anew."""

import io
import json
import os
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from bender_hil.log.read_run import GUARD, RUN
from bender_loop.errors import InputError
from bender_watch.follow.heading import Naming
from bender_watch.follow.sources import Arrival, Source

HEAD = "time_s,voltage_V,displacement_um\n"


def text(first: int, last: int, reading: float = 1.0) -> str:
    return "".join(f"{k},1,{reading}\n" for k in range(first, last))


class _EndError(Exception):
    pass


def followed(path: Path, *acts: Callable[[], object], position: dict[str, object] | None = None) -> list[Arrival]:
    """Follow a path; at every pause the next act is done, and behind the last one the watch ends."""
    waiting = iter(acts)

    def wait(seconds: float) -> None:
        del seconds
        act = next(waiting, None)
        if act is None:
            raise _EndError
        act()

    source, found = Source([path], Naming(), follow=True, position=position or {}, wait=wait), []
    with pytest.raises(_EndError):
        found.extend(x for x in source.arrivals() if x.rows is not None or x.refused)
    return found


def told(arrivals: list[Arrival]) -> list[tuple[bool, list[float]]]:
    return [(x.begins, x.rows.time_s.tolist()) for x in arrivals if x.rows is not None]


def test_a_file_that_grows(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(HEAD + text(0, 2) + "2,1,")

    def more() -> None:
        with path.open("a") as file:
            file.write("1.0\n3,1,1\n")

    assert told(followed(path, more)) == [(True, [0.0, 1.0]), (False, [2.0, 3.0])]


@pytest.mark.skipif(os.name == "nt", reason="an open file keeps its name there")
def test_a_log_that_is_rotated_loses_no_row(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(HEAD + text(0, 3))

    def rotate() -> None:
        with path.open("a") as file:
            file.write(text(3, 5))
        path.rename(tmp_path / "a.csv.1")

    def begin() -> None:
        path.write_text(HEAD + text(5, 7))

    assert told(followed(path, rotate, begin)) == [(True, [0.0, 1.0, 2.0]), (False, [3.0, 4.0]), (True, [5.0, 6.0])]


@pytest.mark.parametrize("rows", [2, 40])
def test_a_file_that_is_written_over_is_another_record(rows: int, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(HEAD + text(0, 10))
    found = told(followed(path, lambda: path.write_text(HEAD + text(0, rows, 2.0))))
    assert found[1] == (True, [float(k) for k in range(rows)])


def test_a_watch_goes_on_in_the_same_file_and_not_in_another_one_of_its_name(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(HEAD + text(0, 10))
    position = json.loads(json.dumps(followed(path)[-1].position))
    with path.open("a") as file:
        file.write(text(10, 12))
    assert told(followed(path, position=position)) == [(False, [10.0, 11.0])]
    path.write_text(HEAD + text(3, 30, 2.0))
    assert told(followed(path, position=position))[0][0]


def test_a_note_in_a_folder_is_passed_over(tmp_path: Path) -> None:
    (tmp_path / "a_note.txt").write_text("look at the clamp\n" * 500)
    (tmp_path / "b.csv").write_text(HEAD + text(0, 3))
    found = followed(tmp_path)
    assert "a_note.txt" in found[0].refused
    assert told(found) == [(True, [0.0, 1.0, 2.0])]
    with pytest.raises(InputError, match=r"a_note\.txt"):
        list(Source([tmp_path], Naming(), follow=False).arrivals())


@pytest.mark.parametrize(
    ("again", "expected"),
    [
        (text(0, 8), [(False, [5.0, 6.0, 7.0])]),
        (text(7, 9), [(False, [7.0, 8.0])]),
        (text(0, 8, 2.0), [(True, [float(k) for k in range(8)])]),
    ],
    ids=["the same once more", "what comes behind it", "another one"],
)
def test_a_stream_that_is_given_again(
    again: str, expected: list[tuple[bool, list[float]]], monkeypatch: pytest.MonkeyPatch
) -> None:
    def streamed(content: str, position: dict[str, object]) -> list[Arrival]:
        buffer = io.BytesIO((HEAD + content).encode())
        monkeypatch.setattr("sys.stdin", SimpleNamespace(buffer=buffer))
        return list(Source([], Naming(), follow=True, position=position).arrivals())

    position = json.loads(json.dumps(streamed(text(0, 5), {})[-1].position))
    assert told(streamed(again, position)) == expected


def test_a_folder_becomes_a_run_when_its_journals_come(tmp_path: Path) -> None:
    def begun() -> None:
        ticks = [{"kind": "tick", "sequence": k, "measured_um": 1.0} for k in range(3)]
        times = [{"grabbed_s": 5.0 + k, "sent_s": 5.0 + k, "setpoint_um": None} for k in range(3)]
        run = [{"kind": "start", "delay_s": 0.0}, *(x | y for x, y in zip(ticks, times, strict=True)), {"kind": "stop"}]
        guard = [{"kind": "applied", "sequence": k, "voltage_V": 2.0, "command_time_s": 5.0 + k} for k in range(3)]
        for name, entries in ((GUARD, guard), (RUN, run)):
            (tmp_path / name).write_text("".join(json.dumps({"n": 0, "t": 0.0, **x}) + "\n" for x in entries))

    source = Source([tmp_path], Naming(), follow=True, wait=lambda _: begun())
    assert told([x for x in source.arrivals() if x.rows is not None]) == [(True, [0.0, 1.0, 2.0])]
