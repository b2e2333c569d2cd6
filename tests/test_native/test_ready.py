"""The plant FMU that the commands run."""

from pathlib import Path

import numpy as np
import pytest
from few import few
from native_hosts import own_way

from bender_export.build import ensure_plant_fmu
from bender_loop.errors import InputError
from bender_loop.fmu.plant import FmuPlant
from bender_loop.shell.run import Run, running
from bender_native import compilers, ready
from bender_native.build import native_reference_fmu
from bender_native.compilers import compiled, own_compiler, own_platform
from bender_native.ready import ready_plant_fmu
from bender_plant.model import load_model

needs_compiler = pytest.mark.skipif(own_compiler() is None, reason="no C compiler on this machine")


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for module in (ready, compilers):
        monkeypatch.setattr(module, "cache_folder", lambda: tmp_path / "cache")
    return tmp_path / "cache"


def readings_um(fmu: Path) -> list[float]:
    with FmuPlant(fmu) as plant:
        plant.reset()
        return [plant.step(20.0 + 15.0 * float(np.sin(k / 3.0)), 0.01) for k in range(300)]


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("model", few(["paper", "beam", "bench"], 0))
def test_it_is_that_of_pythonfmu_to_the_last_bit(model: str):
    native = ready_plant_fmu(model)
    assert native.name.startswith("PiezoBender-native-")
    assert readings_um(native) == readings_um(ensure_plant_fmu(model))


@needs_compiler
def test_it_is_built_once_and_anew_for_another_model(monkeypatch: pytest.MonkeyPatch, own_cache: Path):
    first = ready_plant_fmu("paper")
    assert ready_plant_fmu(load_model("beam")) != first
    monkeypatch.setattr(ready, "native_plant_fmu", None)
    assert ready_plant_fmu("paper") == first
    assert len(list(own_cache.glob("*.fmu"))) == 2


@needs_compiler
def test_what_a_first_build_waits_for_has_a_name():
    way = own_way(2)
    with running(Run("bender fmu build --native")) as run:
        native_reference_fmu(way)
    assert run.doing.startswith(f"compiling StaircaseReference for {way.platforms[0].name} with ")


@pytest.mark.slow
@needs_compiler
def test_a_file_that_is_no_fmu_any_more_is_made_anew(own_cache: Path):
    path = ready_plant_fmu("paper")
    whole = path.read_bytes()
    path.write_bytes(whole[:1000])
    assert ready_plant_fmu("paper").read_bytes() == whole


@pytest.mark.parametrize("trouble", ["no compiler", "a compiler that fails", "no folder"])
def test_pythonfmu_stands_in(trouble: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    if trouble == "no compiler":
        monkeypatch.setattr(ready, "own_compiler", lambda: None)
    elif trouble == "a compiler that fails":
        monkeypatch.setenv("CC", "false")
    else:
        (tmp_path / "cache").write_text("a file")
    assert ready_plant_fmu("paper") == ensure_plant_fmu("paper")


def test_no_such_model(own_cache: Path):
    with pytest.raises(InputError, match="nosuch"):
        ready_plant_fmu("nosuch")
    assert not own_cache.exists()


@needs_compiler
def test_the_same_sources_are_compiled_once(monkeypatch: pytest.MonkeyPatch):
    target = own_platform()
    assert target is not None
    one, two = ({"x.c": f"int number(void) {{ return {x}; }}".encode()} for x in (1, 2))
    first = compiled(one, "x", target, own=True)
    assert compiled(two, "x", target, own=True) != first
    monkeypatch.setattr(compilers, "_compiled", None)
    assert compiled(one, "x", target, own=True) == first


@needs_compiler
def test_what_cannot_be_cached_is_compiled_all_the_same(tmp_path: Path):
    target = own_platform()
    assert target is not None
    (tmp_path / "cache").write_text("a file")
    assert compiled({"x.c": b"int one(void) { return 1; }"}, "x", target, own=True)
