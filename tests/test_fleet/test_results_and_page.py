"""Parts, tables and the page, without a cluster."""

import base64
import hashlib
import json
import re
from pathlib import Path

import pytest

from bender_fleet.page.page import write_page
from bender_fleet.results.folder import open_folder, refuse_others
from bender_fleet.results.parts import Part, find_part, part_path, write_part
from bender_fleet.results.tables import Planned, write_tables
from bender_fleet.sources.units import Unit
from bender_fleet.work.diagnose import rows
from bender_fleet.work.job import Job, run_job
from bender_loop.errors import InputError
from bender_studies.fleet.stand_in import Sleeping

pq = pytest.importorskip("pyarrow.parquet")
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
        "recalibrated": {"gain": {"before": 1.0, "after": 0.9}}, "next_experiment": {"why": "because"},
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
