import importlib.util
import os
import subprocess
import sys
import zipfile
from pathlib import Path
from types import ModuleType

import pytest

from bender_export.archive import guid_of

SCRIPT = Path(__file__).parents[2] / "build_fmu.py"


@pytest.fixture
def script(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The script, with a checkout of its own."""
    spec = importlib.util.spec_from_file_location("build_fmu_script", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "ROOT", tmp_path / "checkout")
    return module


def test_it_writes_both_fmus_and_their_loop(
    script: ModuleType, tmp_path: Path, plant_fmu: Path, controller_fmu: Path
) -> None:
    assert script.main([]) == 0
    written = sorted((tmp_path / "checkout" / "fmu").iterdir())
    assert [path.name for path in written] == ["ClosedLoop.ssp", "PidController.fmu", "PiezoBender.fmu"]
    assert [path.read_bytes() for path in written[1:]] == [controller_fmu.read_bytes(), plant_fmu.read_bytes()]
    with zipfile.ZipFile(written[0]) as loop:
        assert loop.read("resources/PiezoBender.fmu") == plant_fmu.read_bytes()


@pytest.mark.slow
def test_another_model_goes_to_another_place(script: ModuleType, tmp_path: Path, beam_fmu: Path) -> None:
    out = tmp_path / "new" / "mine.fmu"
    assert script.main(["--model", "beam", "--out", str(out)]) == 0
    assert guid_of(out) == guid_of(beam_fmu)
    assert out.with_suffix(".ssp").is_file()
    assert [path.name for path in (tmp_path / "checkout" / "fmu").iterdir()] == ["PidController.fmu"]


@pytest.mark.parametrize(
    ("model", "out", "words"),
    [
        ("no_such.toml", "plant.fmu", ["no_such.toml", "expected"]),
        ("broken.toml", "plant.fmu", ["broken.toml", "beam.length_m", "-1.0", "expected"]),
        ("paper", "a_file/plant.fmu", ["a_file"]),
        ("paper", "plant.toml", ["plant.toml", "'.toml'", ".fmu"]),
        ("paper", "checkout/fmu/../fmu/PidController.fmu", ["place of the controller FMU", "another name"]),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(
    script: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str], model: str, out: str, words: list[str]
) -> None:
    (tmp_path / "a_file").write_text("", encoding="utf-8")
    source = SCRIPT.parent / "plant_src" / "bender_plant" / "models" / "paper.toml"
    text = source.read_text(encoding="utf-8").replace("length_m = 0.0125", "length_m = -1.0")
    (tmp_path / "broken.toml").write_text(text, encoding="utf-8")
    before = sorted(tmp_path.iterdir())
    given = model if model == "paper" else str(tmp_path / model)
    assert script.main(["--model", given, "--out", str(tmp_path / out)]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    for word in words:
        assert word in said.err
    assert sorted(tmp_path.iterdir()) == before


def test_bad_usage_is_one_line(script: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        script.main(["--no-such-option"])
    assert left.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_exit_status_reaches_the_shell() -> None:
    done = subprocess.run(
        [sys.executable, str(SCRIPT), "--model", "no_such_model"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "Traceback" not in done.stderr


def test_a_checkout_that_cannot_be_written_gets_its_controller_beside_the_plant(
    script: ModuleType, tmp_path: Path
) -> None:
    (tmp_path / "checkout").write_text("no folder", encoding="utf-8")
    assert script.main(["--model", "beam", "--out", str(tmp_path / "new" / "mine.fmu")]) == 0
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == ["PidController.fmu", "mine.fmu", "mine.ssp"]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="pipes report their reader's end otherwise there")
def test_a_reader_that_leaves_is_no_traceback(tmp_path: Path) -> None:
    command = [sys.executable, str(SCRIPT), "--model", "beam", "--out", str(tmp_path / "mine.fmu")]
    reading, writing = os.pipe()
    os.close(reading)
    try:
        done = subprocess.run(command, stdout=writing, stderr=subprocess.PIPE, text=True, check=False, timeout=120)
    finally:
        os.close(writing)
    assert (done.returncode, done.stderr) == (141, "")
    assert (tmp_path / "mine.fmu").is_file()
