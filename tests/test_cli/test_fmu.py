import zipfile
from pathlib import Path

import pytest

from bender_cli.main import main


@pytest.fixture
def broken_fmu(tmp_path: Path) -> Path:
    path = tmp_path / "broken.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", "<fmiModelDescription fmiVersion='2.0'/>")
    return path


def test_findings_are_printed_explained_and_counted(broken_fmu: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["fmu", "check", str(broken_fmu)]) == 1
    lines = capsys.readouterr().out.splitlines()
    found = [k for k, line in enumerate(lines) if f"{broken_fmu}: error: " in line]
    assert any("modelName" in lines[k] for k in found)
    for k in found:
        assert lines[k + 1].startswith("    why: ")
        assert lines[k + 2].startswith("    do:  ")
    assert f"{len(found)} findings" in lines[-1]
    assert any("left out: trial run: for co-simulation only" in line for line in lines)


def test_built_fmus_are_without_findings(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["fmu", "build", "--model", "beam", "--out", str(tmp_path / "new")]) == 0
    written = capsys.readouterr().out.splitlines()
    assert [Path(line).name for line in written] == ["PiezoBender.fmu", "PidController.fmu", "ClosedLoop.ssp"]
    for line in written[:2]:
        assert main(["fmu", "check", line]) == 0
        assert capsys.readouterr().out.splitlines()[-1] == f"{line}: no findings"


def test_an_unknown_model_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["fmu", "build", "--model", "no_such", "--out", str(tmp_path / "new")]) == 2
    assert "no_such" in capsys.readouterr().err
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize(
    ("name", "content"), [("missing.fmu", None), ("text.fmu", b"no zip"), ("folder.fmu", "folder")]
)
def test_what_is_no_fmu_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, content: bytes | str | None
):
    path = tmp_path / name
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content is not None:
        path.mkdir()
    assert main(["fmu", "check", str(path)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"bender: {path}: found no ")
    assert len(err.splitlines()) == 1


def test_archive_without_a_model_description_is_refused(tmp_path: Path):
    path = tmp_path / "empty.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("readme.txt", "")
    assert main(["fmu", "check", str(path)]) == 2


def test_the_loop_takes_the_gains_of_a_tuning(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    gains = tmp_path / "gains.toml"
    text = "sampling_period_s = 0.02\n[parallel]\nproportional_V_per_um = 0.5\nintegral_V_per_um_s = 6.5\n"
    gains.write_text(text, encoding="utf-8")
    assert main(["fmu", "build", "--gains", str(gains), "--out", str(tmp_path / "new")]) == 0
    with zipfile.ZipFile(tmp_path / "new" / "ClosedLoop.ssp") as archive:
        structure = archive.read("SystemStructure.ssd").decode()
    assert 'value="6.5"' in structure
    assert 'stepSize="0.02"' in structure
    gains.write_text("nothing = 1\n", encoding="utf-8")
    assert main(["fmu", "build", "--gains", str(gains), "--out", str(tmp_path / "other")]) == 2
    assert not (tmp_path / "other").exists()
