"""Long text tables are read in blocks: the same numbers and the same complaints as cell by cell."""

from pathlib import Path

import numpy as np
import pytest

from bender_loop.errors import InputError
from bender_loop.records.record import Record, read_record, write_record
from bender_loop.tables import text_blocks, text_layout

ROWS = 3000


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(text_blocks, "BLOCK_CHARACTERS", 5000)
    monkeypatch.setattr(text_layout, "LONG_CHARACTERS", 20_000)


def record() -> Record:
    rng = np.random.default_rng(4)
    displacement = rng.normal(size=ROWS)
    displacement[[5, 1234, ROWS - 1]] = np.nan
    return Record(np.arange(ROWS) / 30.0, 50.0 * rng.random(ROWS), displacement)


def same(one: Record, other: Record) -> bool:
    return all(
        np.array_equal(x, y, equal_nan=True)
        for x, y in zip(one.columns().values(), other.columns().values(), strict=True)
    )


def test_a_record_in_blocks_has_the_same_bits(tmp_path: Path):
    write_record(tmp_path / "a.csv", record())
    told: list[tuple[int, int, str]] = []
    found = read_record(tmp_path / "a.csv", progress=lambda *x: told.append(x))
    assert same(found, record())
    count = told[0][1]
    assert count > 10
    assert [x for x in told if x[2] == "time_s"] == [(k, count, "time_s") for k in range(count)]


def test_empty_readings_are_lost_frames(tmp_path: Path):
    write_record(tmp_path / "a.csv", record())
    text = (tmp_path / "a.csv").read_text(encoding="utf-8").replace(",nan", ",")
    (tmp_path / "a.csv").write_text(text.replace("\n", "\r\n"), encoding="utf-8", newline="")
    assert same(read_record(tmp_path / "a.csv"), record())


@pytest.mark.parametrize(
    ("broken", "said"),
    [
        (",0,0", ", column time_s: found '', expected a number"),
        *((f"83.3,{x},0", f", column voltage_V: found '{x}'") for x in ("1_0", "0x10", "1;2")),
        *((x, ": found") for x in ("1,2", "1,2,3,4", "", " ")),
    ],
)
def test_a_bad_line_far_below_is_named(tmp_path: Path, broken: str, said: str):
    write_record(tmp_path / "a.csv", record())
    lines = (tmp_path / "a.csv").read_text(encoding="utf-8").splitlines()
    lines[2500] = broken
    (tmp_path / "a.csv").write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(InputError, match=f"line 2501{said}"):
        read_record(tmp_path / "a.csv")


def test_a_long_spreadsheet_export_goes_in_untouched(tmp_path: Path):
    rows = record()
    lines = ["Messung vom 3.4.2026", "Zeit [ms];Spannung [V];Weg [µm]"]
    for t, u, d in zip(rows.time_s, rows.voltage_V, rows.displacement_um, strict=True):
        lines.append(";".join("" if np.isnan(x) else repr(float(x)).replace(".", ",") for x in (1e3 * t, u, d)))
    (tmp_path / "b.csv").write_text("\r\n".join(lines), encoding="cp1252", newline="")
    told: list[str] = []
    found = read_record(tmp_path / "b.csv", tell=told.append)
    assert np.allclose(found.time_s, rows.time_s, rtol=1e-15, atol=0.0)
    assert np.array_equal(found.displacement_um, rows.displacement_um, equal_nan=True)
    assert "delimiter semicolon, decimal comma, cp1252, names in line 2" in told[0]


@pytest.mark.parametrize("remark", ["# pause", "3.000,5;1.234.567,0;2,5"])
def test_what_a_block_cannot_be_read_with_is_read_line_by_line(tmp_path: Path, remark: str):
    lines = ["t;u;y", *(f"{k},5;{k},25;{k},75" for k in range(ROWS))]
    if remark.startswith("#"):
        lines.insert(1500, remark)
    else:
        lines[-1] = remark
    (tmp_path / "b.csv").write_text("\n".join(lines), encoding="utf-8")
    found = read_record(tmp_path / "b.csv", columns="t,u,y")
    assert len(found) == ROWS
    assert found.voltage_V[10] == 10.25
    assert remark.startswith("#") or found.voltage_V[-1] == 1234567.0
