"""Units from directories, globs, manifests and URLs; keys; names of folders."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_fleet.run import largest_first, plan
from bender_fleet.sources.keys import folder_name, key_of
from bender_fleet.sources.places import bytes_of
from bender_fleet.sources.units import find_units
from bender_loop.errors import InputError
from bender_studies.fleet.stand_in import Sleeping, task

pytest.importorskip("pyarrow")
ROWS = "time_s,voltage_V,displacement_um\n0,0,0\n1,1,1\n"


def _manifest(folder: Path, text: str) -> str:
    path = folder / "manifest.csv"
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_each_file_of_a_directory_is_a_unit_and_others_are_left_out(tmp_path: Path) -> None:
    for name in ("b.csv", "a.csv", "notes.md"):
        (tmp_path / name).write_text(ROWS, encoding="utf-8")
    assert [x.name for x in find_units([str(tmp_path)])] == ["a", "b"]
    assert [x.name for x in find_units([str(tmp_path / "a*.csv")])] == ["a"]


def test_records_of_a_unit_come_together_and_keep_their_columns(tmp_path: Path) -> None:
    text = "unit,record,date,batch,operator\nu1,a.csv,2026-03-02,B1,Kim\nu2,b.csv,,,Lee\nu1,c.csv,2026-03-01,B1,Kim\n"
    one, two = find_units([_manifest(tmp_path, text)])
    assert one.records == (str(tmp_path / "a.csv"), str(tmp_path / "c.csv"))
    assert (one.date, one.batch, one.more) == ("2026-03-01", "B1", (("operator", "Kim"),))
    assert (two.date, two.batch, two.model) == (None, None, None)


def test_a_parquet_manifest_says_the_same_as_a_csv_one(tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table({"unit": ["u1"], "record": ["a.csv"], "date": ["2026-03-02"]}), tmp_path / "m.parquet")
    text = "unit,record,date\nu1,a.csv,2026-03-02\n"
    assert find_units([str(tmp_path / "m.parquet")]) == find_units([_manifest(tmp_path, text)])


def test_records_behind_a_url_are_found() -> None:
    import fsspec

    memory = fsspec.filesystem("memory")
    memory.pipe("/fleet-test/u1.csv", ROWS.encode())
    (unit,) = find_units(["memory://fleet-test"])
    assert unit.name == "u1"
    before = key_of(unit.records, {})
    memory.pipe("/fleet-test/u1.csv", ROWS.replace("1,1,1", "1,1,2000").encode())
    assert key_of(unit.records, {}) != before


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("unit,file\nu1,a.csv\n", "column record: no such column"),
        ("record,name\na.csv,u1\n", "column unit: no such column"),
        ("unit,record\n", "no rows"),
        ("unit,record\n,a.csv\n", "line 2, column unit"),
        ("unit,record,date\nu1,a.csv,last May\n", "column date: found 'last May'"),
        ("unit,record\nu1,a.csv,b.csv\n", "line 2: found 3 cells"),
        ("unit,record,unit\nu1,a.csv,u2\n", "column unit: found it twice"),
        ("unit,record\nu1,a.csv\nu1,a.csv\n", "again"),
        ("unit,record,batch\nu1,a.csv,B1\nu1,b.csv,B2\n", "line 3, column batch: found B2"),
    ],
)
def test_a_wrong_manifest_is_refused_by_row_and_column(text: str, word: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"manifest\.csv") as refused:
        find_units([_manifest(tmp_path, text)])
    assert word in str(refused.value)


def test_nothing_and_the_same_name_twice_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="found no records"):
        find_units([str(tmp_path)])
    for folder in ("x", "y"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "same.csv").write_text(ROWS, encoding="utf-8")
    with pytest.raises(InputError, match="different names"):
        find_units([str(tmp_path / "*" / "*.csv")])
    with pytest.raises(InputError, match="found unit same again"):
        find_units([str(tmp_path / "x"), str(tmp_path / "y")])


def test_a_key_follows_content_and_settings_and_not_the_path(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).write_text(ROWS, encoding="utf-8")
    same = [key_of([str(tmp_path / x)], {"m": 1}) for x in "ab"]
    assert same[0] == same[1]
    assert key_of([str(tmp_path / "a")], {"m": 2}) != same[0]
    (tmp_path / "a").write_text(ROWS + "2,2,2\n", encoding="utf-8")
    assert key_of([str(tmp_path / "a")], {"m": 1}) != same[0]
    assert key_of([str(tmp_path / "gone")], {"m": 1}) not in same


@given(st.lists(st.text(min_size=1, max_size=120), min_size=2, max_size=20, unique=True))
def test_units_have_folders_of_their_own_on_every_file_system(names: list[str]) -> None:
    folders = [folder_name(x) for x in names]
    assert len({x.casefold() for x in folders}) == len(names)
    assert all(x and len(x) < 100 and x.isascii() and "/" not in x and "." not in x for x in folders)


def test_large_records_are_handed_out_first_and_others_as_they_came(tmp_path: Path) -> None:
    for name, rows in (("a", 5), ("b", 50), ("c", 5), ("d", 500)):
        (tmp_path / f"{name}.csv").write_text(ROWS * rows, encoding="utf-8")
    found = find_units([str(tmp_path)])
    work = task(Sleeping(0.0))
    _, _, sizes = plan(found, lambda _: work)
    assert sizes == [len(ROWS) * x for x in (5, 50, 5, 500)]
    assert [found[k].name for k in largest_first(range(4), sizes)] == ["d", "b", "a", "c"]
    assert bytes_of(str(tmp_path / "gone.csv")) == 0
