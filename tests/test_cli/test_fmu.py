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


def test_findings_are_printed_and_counted(broken_fmu: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["fmu", "check", str(broken_fmu)]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert "modelName" in lines[0]
    assert lines[-1].endswith(f"{len(lines) - 1} findings")


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
