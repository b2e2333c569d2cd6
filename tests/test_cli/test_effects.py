import json
from pathlib import Path

import pytest

from bender_cli.main import main
from bender_effects.catalogue import EFFECTS


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)


def test_the_list_has_every_effect_and_writes_nothing(capsys: pytest.CaptureFixture[str], tmp_path: Path):
    assert main(["effects"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[3 : 3 + len(EFFECTS)]] == list(EFFECTS)
    assert not list(tmp_path.iterdir())


def test_one_effect_is_explained_and_drawn(capsys: pytest.CaptureFixture[str], tmp_path: Path):
    assert main(["effects", "creep"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert "docs/effects/creep.md" in out
    assert all(name in out for name in ("charge_leakage", "time_constants_s", "gains", "decades"))
    picture = tmp_path / "results" / "effect-creep" / "signature.png"
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert [path.name for path in picture.parent.iterdir()] == ["signature.png"]


def test_a_calibration_goes_where_it_is_told(capsys: pytest.CaptureFixture[str], tmp_path: Path):
    assert main(["effects", "offset", "--out", "here"]) == 0
    assert "block calibration" in capsys.readouterr().out
    assert (tmp_path / "here" / "signature.png").is_file()


def test_json_of_one_and_of_all(capsys: pytest.CaptureFixture[str], tmp_path: Path):
    assert main(["effects", "stiffening", "--json"]) == 0
    one = json.loads(capsys.readouterr().out)
    assert (one["id"], one["stage"], one["page"]) == ("stiffening", "structure", "docs/effects/stiffening.md")
    assert one["parameters"]["cubic_1_per_um2"]["unit"] == "1/um2"
    assert main(["effects", "--json"]) == 0
    everything = json.loads(capsys.readouterr().out)
    assert [entry["id"] for entry in everything] == list(EFFECTS)
    assert one in everything
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["crep"], "found 'crep', expected 'creep'"),
        (["Backlash"], "'backlash'"),
        (["lag"], "'supply_fall_lag' or 'sensor_lag'"),
        (["supply-fall-lag"], "'supply_fall_lag'"),
        (["xyzzy"], "expected one of supply_quantisation, transport_delay"),
        ([""], "expected one of supply_quantisation, transport_delay"),
        (["--out", "here"], "--out: found here without an effect"),
        (["creep", "--json", "--out", "here"], "--out: found here together with --json"),
        (["new"], "effects new: expected an id and a stage"),
        (["new", "reading_ceiling"], "effects new: expected an id and a stage"),
        (["new", "reading_ceiling", "--stage", "reading"], "--stage: found 'reading', expected one of supply"),
        (["new", "Reading", "--stage", "sensor"], "found 'Reading', expected an id of small letters"),
        (["new", "creep", "--stage", "material"], "found 'creep', which is a block already"),
        (["new", "reading_ceiling", "--stage", "sensor", "--json"], "effects new: expected an id and a stage"),
        (["creep", "saturation"], "NEW_ID: found 'saturation', expected it with new only"),
        (["creep", "--stage", "sensor"], "--stage: found 'sensor', expected it with new only"),
        (["creep", "--write-docs"], "--write-docs: expected nothing beside it"),
    ],
)
def test_what_is_unknown_is_refused_with_what_is_near(
    words: list[str], complaint: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
):
    assert main(["effects", *words]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert len(err.splitlines()) == 1
    assert complaint in err
    assert not list(tmp_path.iterdir())


def test_a_place_that_cannot_be_written_is_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    assert main(["effects", "offset", "--out", "file"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("bender: file: ")


def test_an_installed_package_has_no_pages_to_write(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("bender_effects.checkout.root_of_checkout", lambda: None)
    for words in (["--write-docs"], ["new", "reading_ceiling", "--stage", "sensor"]):
        assert main(["effects", *words]) == 2
        assert "found an installed package without docs/effects/index.md" in capsys.readouterr().err
