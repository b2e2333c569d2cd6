"""Rows from journals that grow: the same as from the finished run."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bender_hil.log.read_run import GUARD, RUN, read_run
from bender_hil.log.to_record import to_record
from bender_loop.errors import InputError
from bender_loop.records.record import Record
from bender_watch.follow.rows import Rows
from bender_watch.follow.run import RunRows, is_run


def entries(count: int) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Ticks of the controller, a frame lost among them, and what the guard did: one superseded, one in parts."""
    run = [{"kind": "start", "delay_s": 0.002}]
    guard: list[dict[str, Any]] = []
    for k in range(count):
        read = None if k == 3 else 0.5 * k
        time_s = 10.0 + k / 30.0
        run.append(
            {
                "kind": "tick",
                "sequence": k,
                "grabbed_s": time_s,
                "sent_s": time_s + 0.003,
                "measured_um": read,
                "setpoint_um": None,
            }
        )
        if k == 7:  # the slew limit leads there in two parts
            guard.append({"kind": "applied", "sequence": k, "voltage_V": 6.7, "command_time_s": time_s + 0.004})
            guard.append({"kind": "applied", "sequence": k, "voltage_V": 7.0, "command_time_s": time_s + 0.020})
        elif k != 5:
            guard.append({"kind": "applied", "sequence": k, "voltage_V": float(k), "command_time_s": time_s + 0.004})
    return [*run, {"kind": "stop"}], guard


def columns_of(record: Record | Rows) -> NDArray[np.float64]:
    assert record.command_time_s is not None
    return np.column_stack([record.time_s, record.voltage_V, record.displacement_um, record.command_time_s])


def write(path: Path, rows: list[dict[str, Any]], upto: int) -> None:
    lines = [json.dumps({"n": n, "t": 0.0, **x}) + "\n" for n, x in enumerate(rows)]
    path.write_text("".join(lines[:upto]), encoding="utf-8")


def test_a_run_that_grows_gives_the_rows_of_its_record(tmp_path: Path) -> None:
    run, guard = entries(12)
    rows, parts = RunRows(tmp_path), []
    for upto in (2, 5, 6, 9, 14):
        write(tmp_path / RUN, run, upto)
        write(tmp_path / GUARD, guard, max(upto - 2, 0))
        found = rows.further()
        if found is not None:
            parts.append(columns_of(found))
    assert is_run(tmp_path)
    assert rows.ended
    record = to_record(read_run(tmp_path))
    assert record is not None
    whole = columns_of(record)
    ours = np.concatenate(parts)
    assert len(parts) > 2
    assert np.allclose(ours, whole[: len(ours)], atol=1e-12, equal_nan=True)
    assert len(ours) == len(whole)


@pytest.mark.parametrize(
    ("run_line", "guard_line"),
    [
        ('{"grabbed_s": 1.0}', ""),
        ("7", ""),
        ('{"kind": "tick"}', ""),
        ('{"kind": "tick"}\n{"kind": "tick", "grabbed_s": "late"}', ""),
        ('{"kind": "start", "delay_s": "soon"}', ""),
        ("", '{"kind": "applied"}'),
        ("", "[1, 2]"),
        ("{", ""),
        ("[" * 100_000, ""),
    ],
)
def test_a_damaged_journal_is_bad_input(run_line: str, guard_line: str, tmp_path: Path) -> None:
    (tmp_path / RUN).write_text(run_line + "\n", encoding="utf-8")
    (tmp_path / GUARD).write_text(guard_line + "\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"expected the journals? of a run"):
        RunRows(tmp_path).further()
