"""Other makers' sources, compiled on request."""

import zipfile
from pathlib import Path

import fmpy
import pytest
from few import few

from bender_cli.main import main
from bender_loop.errors import InputError, RunError
from bender_loop.fmu.check.check import check
from bender_loop.fmu.file import read_description
from bender_loop.fmu.plant import FmuPlant
from bender_native.build import Way, native_plant_fmu
from bender_native.compilers import own_compiler
from bender_native.foreign import compile_fmu
from bender_native.ready import ready_plant_fmu
from bender_plant.model import load_model

REFERENCE = Path(__file__).parents[3] / "shared" / "data" / "reference-fmus"
pytestmark = pytest.mark.skipif(own_compiler() is None, reason="no C compiler on this machine")


def without_binaries(fmu: Path, out: Path, **changed: str | None) -> Path:
    """Write a copy without binaries; entries named in `changed` get another text, or go."""
    with zipfile.ZipFile(fmu) as old, zipfile.ZipFile(out, "w") as new:
        for name in old.namelist():
            if not name.startswith("binaries/") and changed.get(name, "") is not None:
                new.writestr(name, changed.get(name) or old.read(name))
    return out


@pytest.fixture
def sources_only(tmp_path: Path) -> Path:
    path = tmp_path / "plant.fmu"
    path.write_bytes(native_plant_fmu(load_model("paper"), Way(2)))
    return path


@pytest.mark.parametrize("fmi", few([2, 3], 0))
def test_our_own_sources_give_the_numbers_of_the_ready_one(fmi: int, tmp_path: Path):
    bare = tmp_path / "bare.fmu"
    bare.write_bytes(native_plant_fmu(load_model("paper"), Way(fmi)))
    found = []
    for fmu in (compile_fmu(bare, tmp_path / "whole.fmu"), ready_plant_fmu("paper")):
        with FmuPlant(fmu) as plant:
            plant.reset()
            found.append([plant.step(20.0 * (k // 10 % 2), 0.01) for k in range(100)])
    assert found[0] == found[1]


@pytest.mark.slow
def test_the_commands_say_so_and_do_it(
    sources_only: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.chdir(sources_only.parent)
    assert main(["tune", "--fmu", "plant.fmu"]) == 2
    assert "bender fmu compile plant.fmu" in capsys.readouterr().err
    assert main(["fmu", "check", "plant.fmu"]) == 1
    assert "bender fmu compile FILE" in capsys.readouterr().out
    assert main(["fmu", "compile", "plant.fmu"]) == 0
    assert "plant-here.fmu" in capsys.readouterr().out
    assert check(Path("plant-here.fmu")).findings == ()


@pytest.mark.skipif(not REFERENCE.is_dir(), reason="the Reference-FMUs are not beside the checkout")
@pytest.mark.parametrize(
    "name", few([f"fmi{n}/{x}.fmu" for n in (2, 3) for x in ("Dahlquist", "VanDerPol", "Feedthrough")], 0)
)
def test_reference_fmus(name: str, tmp_path: Path):
    bare = without_binaries(REFERENCE / name, tmp_path / "bare.fmu")
    with pytest.raises(InputError, match="it carries sources: bender fmu compile"):
        read_description(bare)
    whole = compile_fmu(bare, tmp_path / "whole.fmu")
    ours = fmpy.simulate_fmu(str(whole), stop_time=2.0, fmi_type="CoSimulation")
    theirs = fmpy.simulate_fmu(str(REFERENCE / name), stop_time=2.0, fmi_type="CoSimulation")
    assert ours.dtype == theirs.dtype
    for column in ours.dtype.names or ():
        assert ours[column] == pytest.approx(theirs[column], rel=1e-12)


@pytest.mark.slow
def test_what_cannot_be_compiled(sources_only: Path, tmp_path: Path):
    out = tmp_path / "out.fmu"
    for other, error, words in (
        ({"sources/model.c": "this is no C\n"}, RunError, "cannot be compiled"),
        ({"sources/model.c": None}, InputError, "found no file sources/model.c"),
    ):
        bare = without_binaries(sources_only, tmp_path / "bare.fmu", **other)
        with pytest.raises(error, match=words):
            compile_fmu(bare, out)
    text = zipfile.ZipFile(sources_only).read("modelDescription.xml").decode()
    for before, after, words in (
        ('<File name="model.c"', '<File name="../model.c"', "expected a name inside"),
        ('<File name="model.c"', '<File name="-o"', "expected a name inside"),
    ):
        bare = without_binaries(
            sources_only, tmp_path / "bare.fmu", **{"modelDescription.xml": text.replace(before, after)}
        )
        with pytest.raises(InputError, match=words):
            compile_fmu(bare, out)
    with pytest.raises(InputError, match="expected another name"):
        compile_fmu(sources_only, sources_only)
    assert not out.exists()


def test_without_sources(tmp_path: Path):
    bare = tmp_path / "bare.fmu"
    bare.write_bytes(native_plant_fmu(load_model("paper"), Way(2)))
    with zipfile.ZipFile(bare) as old, zipfile.ZipFile(tmp_path / "none.fmu", "w") as new:
        text = old.read("modelDescription.xml").decode()
        begin, end = text.index("<SourceFiles>"), text.index("</SourceFiles>") + len("</SourceFiles>")
        new.writestr("modelDescription.xml", text[:begin] + text[end:])
    with pytest.raises(InputError, match="found no list of sources"):
        compile_fmu(tmp_path / "none.fmu", tmp_path / "out.fmu")
