"""`bender fleet` from its words to its exit status, without a cluster: sources, parts, tables, the page."""

import base64
import hashlib
import importlib.util
import json
import os
import re
import socket
from importlib.machinery import ModuleSpec
from pathlib import Path

import pytest
from fleet_stand_in import Sleeping, task
from hypothesis import given
from hypothesis import strategies as st

from bender_cli.main import main
from bender_fleet.page.page import write_page
from bender_fleet.results.folder import open_folder, refuse_others
from bender_fleet.results.parts import Part, find_part, part_path, write_part
from bender_fleet.results.tables import Planned, write_tables
from bender_fleet.run import largest_first, plan
from bender_fleet.sources.keys import folder_name, key_of
from bender_fleet.sources.places import bytes_of
from bender_fleet.sources.units import Unit, find_units
from bender_fleet.work.diagnose import rows
from bender_fleet.work.job import Job, run_job
from bender_loop.errors import InputError
from bender_loop.records.record import read_record
from bender_proving.fleet import BAD_BATCH, BAD_EFFECT, BREAKS, FleetSettings, draw_unit, write_fleet

pytest.importorskip("distributed")
pq = pytest.importorskip("pyarrow.parquet")


ROWS = "time_s,voltage_V,displacement_um\n0,0,0\n1,1,1\n"


@pytest.fixture
def record(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "records").mkdir()
    (tmp_path / "records/u1.csv").write_text(ROWS, encoding="utf-8")
    return "records"


def _refused(words: list[str], capsys: pytest.CaptureFixture[str], out: Path) -> str:
    assert main(["fleet", *words, "--out", str(out)]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len([x for x in lines if x.startswith("bender:")]) == 1
    assert not out.exists()
    return lines[-1]


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (["diagnose", "nowhere"], "found no records"),
        (["diagnose", "records", "--model", "none"], "none"),
        (["diagnose", "records", "--model", "paper", "--fmu", "x.fmu"], "only one"),
        (["diagnose", "records", "--fmu", "missing.fmu"], "cannot be read"),
        (["diagnose", "records", "--input", "u"], "without --fmu"),
        (["diagnose", "records", "--confidence", "2"], "confidence"),
        (["diagnose", "records", "--workers", "0"], "--workers"),
        (["diagnose", "records", "--memory", "0.01"], "--memory"),
        (["diagnose", "records", "--scheduler", "here:8786"], "tcp://"),
        (["diagnose", "records", "--scheduler", "tls://127.0.0.1:1"], "--tls-ca"),
        (["diagnose", "records", "--scheduler", "tcp://127.0.0.1:1", "--workers", "2"], "--workers"),
        (["diagnose", "records", "--scheduler-file", "none.json"], "no file none.json"),
        (["diagnose", "records", "--tls-ca", "x"], "--tls-cert"),
        (["compare", "records", "--delimiter", "long"], "delimiter"),
        (["example", "--units", "0"], "--units"),
        (["tune", "records"], "fleet.json"),
    ],
)
def test_bad_usage_ends_with_one_line_and_writes_nothing(
    words: list[str], found: str, record: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert found in _refused(words, capsys, tmp_path / "out")


def test_a_manifest_with_a_model_that_is_not_there(
    record: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    manifest = tmp_path / "m.csv"
    manifest.write_text("unit,record,model\nu1,records/u1.csv,none.toml\n", encoding="utf-8")
    assert "none.toml" in _refused(["diagnose", str(manifest)], capsys, tmp_path / "out")


@pytest.mark.filterwarnings("default")
def test_a_scheduler_that_does_not_answer(
    record: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bender_fleet.cluster.connect.WAIT_S", 1.0)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    assert "no scheduler answers" in _refused(["diagnose", record, "--scheduler", address], capsys, tmp_path / "out")


def test_without_the_extra_the_command_says_how_to_get_it(
    record: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    known = importlib.util.find_spec

    def without(name: str, package: str | None = None) -> ModuleSpec | None:
        return None if name == "distributed" else known(name, package)

    monkeypatch.setattr(importlib.util, "find_spec", without)
    assert "pip install dask distributed" in _refused(["diagnose", record], capsys, tmp_path / "out")


def test_output_that_is_not_of_a_fleet_stays_as_it_is(
    record: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out/mine.txt").write_text("mine", encoding="utf-8")
    assert main(["fleet", "diagnose", record, "--out", str(tmp_path / "out")]) == 2
    assert main(["fleet", "example", "--units", "1", "--out", str(tmp_path / "out")]) == 2
    assert [x.name for x in (tmp_path / "out").iterdir()] == ["mine.txt"]
    assert "not of a fleet" in capsys.readouterr().err


def test_the_example_is_the_same_for_a_seed_and_hides_what_it_says(tmp_path: Path) -> None:
    settings = FleetSettings(3, seed=4, seconds=20.0)
    for folder in ("a", "b"):
        write_fleet(settings, tmp_path / folder)
    for path in (tmp_path / "a").rglob("*.csv"):
        assert path.read_bytes() == (tmp_path / "b" / path.relative_to(tmp_path / "a")).read_bytes()
    truth = json.loads((tmp_path / "a/truth.json").read_text(encoding="utf-8"))
    units = [draw_unit(settings, k) for k in range(3)]
    assert [[x["id"] for x in truth["units"][u.name]["effects"]] for u in units] == [
        list(u.case.effect_ids) for u in units
    ]
    manifest = (tmp_path / "a/manifest.csv").read_text(encoding="utf-8")
    assert not any(x in manifest for u in units for x in u.case.effect_ids)


@pytest.mark.slow
def test_the_bad_batch_has_its_effect_and_broken_files_cannot_be_read(tmp_path: Path) -> None:
    drawn = [draw_unit(FleetSettings(40, seconds=20.0), k) for k in range(16)]
    bad = [u for u in drawn if u.batch == BAD_BATCH]
    assert bad
    assert all(BAD_EFFECT in u.case.effect_ids for u in bad)
    for name, spoil in BREAKS:
        path = tmp_path / f"{name}.csv"
        path.write_text("time_s,voltage_V,displacement_um\n" + "".join(f"{k},{k % 7},{k % 5}\n" for k in range(60)))
        spoil(path)
        if name in ("cut", "sensor"):
            record = read_record(path)
            assert len(record) < 40 or len(set(record.displacement_um)) == 1
        else:
            with pytest.raises(InputError):
                read_record(path)


@pytest.mark.filterwarnings("default")
def test_a_small_fleet_from_words_to_page_and_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "records").mkdir()
    example = Path(__file__).parents[2] / "examples/record.csv"
    lines = example.read_text(encoding="utf-8").splitlines()
    for k in range(2):
        rows = "\n".join(lines[: 1200 + 10 * k]) + "\n"
        (tmp_path / f"records/u{k}.csv").write_text(rows, encoding="utf-8")
    (tmp_path / "records/u2.csv").write_text("time_s,displacement_um\n0,0\n1,1\n", encoding="utf-8")
    words = ["fleet", "compare", "records", "--workers", "1", "--out", "out", "--json", "--quiet"]
    assert main(words) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["units"], told["new"], told["done"], told["broken"]) == (3, 3, 2, 1)
    rows = {x["unit"]: x for x in pq.read_table("out/units.parquet").to_pylist()}
    assert rows["u0"]["recalibrated_um"] < rows["u0"]["before_um"]
    assert "voltage_V" in rows["u2"]["reason"]
    assert (
        json.loads(Path("out/units/u0/comparison.json").read_text(encoding="utf-8"))["recalibrated"]["rms_um"]
        == (rows["u0"]["recalibrated_um"])
    )
    before = {x: x.stat().st_mtime_ns for x in Path("out/units").rglob("*.parquet")}
    (tmp_path / "records/u2.csv").write_text("\n".join(lines[:1300]) + "\n", encoding="utf-8")
    assert main(words) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["new"], told["kept"], told["done"]) == (1, 2, 3)
    after = {x: x.stat().st_mtime_ns for x in Path("out/units").rglob("*.parquet")}
    assert sum(after.get(x) == t for x, t in before.items()) == 2
    assert "3 units" in Path("out/fleet.html").read_text(encoding="utf-8")


EVIL = "</script><script>alert(1)</script>"


def _part(key: str = "k1", run: str = "r1", **row: object) -> Part:
    return Part(key, run, "done", "", 0.5, {"verdict": "named", "effects": ["creep"], "gain": 1.01, **row}, ())


def test_a_part_is_read_as_it_was_written_and_replaces_the_one_before(tmp_path: Path) -> None:
    write_part(tmp_path, "u1", _part(), {"a.json": b"1", "b.json": b"2"})
    write_part(tmp_path, "u1", _part("k2"), {"a.json": b"3"})
    found = find_part(tmp_path, "u1", "k2")
    assert found is not None
    assert (found.status, found.row["gain"], found.row["effects"]) == ("done", 1.01, ["creep"])
    assert find_part(tmp_path, "u1", "k1") is None
    assert find_part(tmp_path, "u1", "k2", run="another") is None
    assert sorted(x.name for x in (tmp_path / "units/u1").iterdir()) == ["a.json", "k2.parquet"]
    assert (tmp_path / "units/u1/a.json").read_bytes() == b"3"


def test_a_damaged_part_is_none(tmp_path: Path) -> None:
    write_part(tmp_path, "u1", _part(), {})
    path = part_path(tmp_path, "u1", "k1")
    path.write_bytes(path.read_bytes()[:-20])
    assert find_part(tmp_path, "u1", "k1") is None


def test_tables_hold_every_unit_with_what_the_manifest_says_now(tmp_path: Path) -> None:
    unit = Unit("u1", ("a.csv",), None, "2026-03-01", "B1", (("operator", "Kim"), ("gain", "high")))
    write_part(tmp_path, "u1", _part(), {})
    write_part(tmp_path, "u2", Part("k1", "r", "broken", "no such column", 0.0, {}, ()), {})
    planned = [Planned(unit, "u1", "k1", "paper"), Planned(Unit("u2", ("b.csv",)), "u2", "k1", "paper")]
    planned.append(Planned(Unit("u3", ("c.csv",)), "u3", "k1", "paper"))
    assert write_tables(tmp_path, "diagnose", planned) == {"done": 1, "broken": 1}
    one, two = pq.read_table(tmp_path / "units.parquet").to_pylist()
    assert (one["gain"], one["manifest_gain"], one["operator"], one["date"].isoformat()) == (
        1.01,
        "high",
        "Kim",
        "2026-03-01",
    )
    assert (two["status"], two["reason"], two["gain"], two["operator"]) == ("broken", "no such column", None, None)


def test_directories_of_others_are_refused(tmp_path: Path) -> None:
    refuse_others(tmp_path / "new", "diagnose")
    (tmp_path / "mine.txt").touch()
    with pytest.raises(InputError, match="not of a fleet"):
        refuse_others(tmp_path, "diagnose")
    open_folder(tmp_path / "fleet", {"action": "compare"})
    refuse_others(tmp_path / "fleet", "compare")
    with pytest.raises(InputError, match="results of bender fleet compare"):
        refuse_others(tmp_path / "fleet", "diagnose")
    (tmp_path / "fleet/fleet.json").write_text("[]", encoding="utf-8")
    with pytest.raises(InputError, match=r"fleet\.json"):
        refuse_others(tmp_path / "fleet", "diagnose")


def test_the_page_escapes_names_and_runs_no_script_but_its_own(tmp_path: Path) -> None:
    planned = []
    for k, name in enumerate((EVIL, "unit-2", "unit-3")):
        write_part(tmp_path, f"u{k}", _part(sentence=f"{name} lacks creep"), {})
        planned.append(Planned(Unit(name, ("a.csv",), None, None, EVIL), f"u{k}", "k1", "paper"))
    open_folder(tmp_path, {"action": "diagnose", "units": 4})
    write_tables(tmp_path, "diagnose", planned)
    page = write_page(tmp_path, "diagnose").read_text(encoding="utf-8")
    assert EVIL not in page
    assert "1 were not reached" in page
    scripts = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    digests = [base64.b64encode(hashlib.sha256(x.encode()).digest()).decode() for x in scripts]
    assert re.findall(r"script-src 'sha256-([^']+)'", page) == digests
    data = json.loads(re.findall(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)[0])
    assert data["unit"][0] == EVIL
    assert [data["verdict"]["of"][k] for k in data["verdict"]["at"]] == ["named"] * 3
    assert not re.search(r'(?:src|href)="(?:https?:)?//', page)


def test_rows_of_a_diagnosis_keep_its_numbers() -> None:
    gap = {"rms_um": 1.0, "nrmse_percent": 2.0}
    told = {
        "verdict": "ambiguous", "complete": False, "sentence": "s", "model": None, "warnings": ["w"],
        "effects": [{"id": "creep", "stage": "material", "share_of_gap": 0.5, "evidence": "e",
                     "rivals": [{"id": "ageing", "delta_bic": 1.0}],
                     "parameters": {"share": {"value": 0.1, "std": None, "unit": "1"}}}],
        "gap": {"before": gap, "recalibrated": gap, "after": gap, "noise_floor_um": 0.06},
        "recalibrated": {"gain": {"before": 1.0, "after": 0.9}},
        "next_experiment": {"why": "because", "profile": "profile.csv"},
    }  # fmt: skip
    row, (effect,) = rows(told)
    assert (row["gain"], row["offset_um"], row["next_experiment"], row["has_model"]) == (0.9, 0.0, "because", False)
    assert (effect["certain"], effect["rivals"]) == (False, ["ageing"])
    assert effect["parameters"] == [{"name": "share", "value": 0.1, "std": None, "unit": "1"}]


def test_a_job_that_was_done_is_not_done_again_unless_a_new_run_asks(tmp_path: Path) -> None:
    log = tmp_path / "log"
    log.mkdir()
    work = Sleeping(0.0, log=str(log))

    def job(run: str, *, again: bool = False) -> Job:
        return Job("u", "u", "k", run, ("none-7",), work, str(tmp_path), again=again)

    for one in (job("r1"), job("r1"), job("r2"), job("r3", again=True), job("r3", again=True)):
        run_job(one)
    assert len(list(log.iterdir())) == 2


def test_a_fault_in_one_unit_is_a_row(tmp_path: Path) -> None:
    told = run_job(Job("u", "u", "k", "r", ("no-number",), Sleeping(0.0), str(tmp_path)))
    part = find_part(tmp_path, "u", "k")
    assert told.status == "failed"
    assert part is not None
    assert "ValueError" in part.reason


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


@pytest.mark.skipif(os.name == "nt", reason="devices of POSIX")
@pytest.mark.parametrize("what", ["/dev/zero", "pipe"])
def test_a_record_that_has_no_end_counts_as_missing(tmp_path: Path, what: str) -> None:
    place = tmp_path / what
    if what == "pipe":
        os.mkfifo(place)
    assert key_of([str(place)], {}) == key_of([str(tmp_path / "gone")], {})


@given(st.lists(st.text(min_size=1, max_size=120), min_size=2, max_size=20, unique=True))
def test_units_have_folders_of_their_own_on_every_file_system(names: list[str]) -> None:
    folders = [folder_name(x) for x in names]
    assert len({x.casefold() for x in folders}) == len(names)
    assert all(x and len(x) < 100 and x.isascii() and "/" not in x and "." not in x for x in folders)


def test_large_records_are_handed_out_first_and_others_as_they_came(tmp_path: Path) -> None:
    for name, count in (("a", 5), ("b", 50), ("c", 5), ("d", 500)):
        (tmp_path / f"{name}.csv").write_text(ROWS * count, encoding="utf-8")
    found = find_units([str(tmp_path)])
    work = task(Sleeping(0.0))
    _, _, sizes = plan(found, lambda _: work)
    assert sizes == [len(ROWS) * x for x in (5, 50, 5, 500)]
    assert [found[k].name for k in largest_first(range(4), sizes)] == ["d", "b", "a", "c"]
    assert bytes_of(str(tmp_path / "gone.csv")) == 0
