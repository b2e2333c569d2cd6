"""`bender fleet` from its words to its exit status: what is refused leaves nothing behind; one small fleet for real."""

import importlib.util
import json
import socket
from importlib.machinery import ModuleSpec
from pathlib import Path

import pytest

pytest.importorskip("distributed")
pq = pytest.importorskip("pyarrow.parquet")

from bender_cli.main import main  # noqa: E402
from bender_loop.records.record import read_record  # noqa: E402
from bender_proving.fleet import BAD_BATCH, BAD_EFFECT, FleetSettings, draw_unit, write_fleet  # noqa: E402

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


def test_a_wrong_manifest_and_a_model_in_it_that_is_not_there(
    record: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    manifest = tmp_path / "m.csv"
    manifest.write_text("unit,file\nu1,records/u1.csv\n", encoding="utf-8")
    assert "column record: no such column" in _refused(["diagnose", str(manifest)], capsys, tmp_path / "out")
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
    from bender_loop.errors import InputError
    from bender_proving.fleet import BREAKS

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
