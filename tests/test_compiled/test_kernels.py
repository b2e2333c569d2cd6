"""Generated code: what it borrows and allocates, read from disk, compiled in a process beside this one."""

import errno
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
from few import few
from numba.core.caching import IndexDataCacheFile
from numpy.typing import NDArray

from bender_compiled import background_compilation, kernels, stored_code
from bender_compiled.background_compilation import compile_blocks, compile_in_background
from bender_compiled.kernels import block_run, uncut_run
from bender_compiled.parallel_map import THREADS
from bender_compiled.simulation import Drive, Simulator, constants_of, initial_of
from bender_compiled.stored_code import StoredCode
from bender_plant.blocks import BLOCKS
from bender_plant.model import load_model

PAPER = load_model("paper")
TIME: NDArray[np.float64] = np.asarray(np.arange(60) * 0.05, dtype=np.float64)
VOLTAGE: NDArray[np.float64] = np.asarray(20.0 * (1.0 - np.cos(3.0 * TIME)), dtype=np.float64)
SIGNALS = (TIME, np.full(60, 0.05), *(VOLTAGE,) * 6)


def held_from_a_list(
    state: tuple[float, ...], constants: tuple[float, ...], time_s: float, h: float, y0: float, ym: float, y1: float
) -> tuple[tuple[float, ...], float, float, float]:
    """A kernel of somebody who collects what it gives in a list."""
    shown = [constants[0] * y for y in (y0, ym, y1)]
    return state, shown[0], shown[1], shown[2]


def test_a_kernel_that_needs_memory_gives_what_it_gives_uncompiled(monkeypatch: pytest.MonkeyPatch) -> None:
    other = replace(BLOCKS["calibration"], id="other", step=held_from_a_list)
    monkeypatch.setitem(BLOCKS, "other", other)
    gain = PAPER.with_block("calibration", gain=0.9)
    through_list = Simulator(Drive.of_rows(TIME, VOLTAGE)).run(gain.with_block("other", gain=1.7)).reading_um
    assert np.allclose(through_list, 1.7 * Simulator(Drive.of_rows(TIME, VOLTAGE)).run(gain).reading_um, rtol=1e-12)


NOWHERE = """
import sys
from pathlib import Path

from bender_compiled import kernels
from bender_compiled.kernels import grid_run

kernels.kernels_folder = lambda: Path(sys.argv[1]) / "kernels"
print(Path(sys.modules[grid_run().__module__].__file__).parent)
"""


@pytest.mark.slow
def test_where_the_cache_cannot_be_written_code_lasts_as_long_as_the_process(tmp_path: Path) -> None:
    """A file stands where the folder would be: even one who may write everywhere cannot make it."""
    in_the_way = tmp_path / "cache"
    in_the_way.write_text("", encoding="utf-8")
    words = [sys.executable, "-c", NOWHERE, str(in_the_way)]
    said = subprocess.run(words, check=True, capture_output=True, text=True)
    folder = Path(said.stdout.strip())
    assert folder.name.startswith("bender-kernels-")
    assert not folder.exists()
    assert in_the_way.read_text(encoding="utf-8") == ""


@pytest.mark.parametrize(
    ("block_id", "parameters"),
    [
        ("rate_independent_hysteresis", {"thresholds_V": (1.0, 3.0), "weights_um_per_V": (0.1, 0.2)}),
        ("creep", {"gains": (0.1, 0.2), "time_constants_s": (0.5, 5.0)}),
    ],
)
def test_arrays_are_given_back_as_they_were(block_id: str, parameters: dict[str, tuple[float, ...]]) -> None:
    block = BLOCKS[block_id]
    constants = constants_of(block, block.parameters(**parameters), PAPER)
    state = initial_of(block, constants)
    arrays = [state, *(x for x in constants if isinstance(x, np.ndarray))]
    before = [x.copy() for x in arrays], [sys.getrefcount(x) for x in arrays]
    for _ in range(50):
        if block.corner is None:
            uncut_run(block_id)(state, constants, *SIGNALS)
        else:
            block_run(block_id)(state, constants, *SIGNALS, 500)
    assert all(np.array_equal(x, y) for x, y in zip(arrays, before[0], strict=True))
    assert [sys.getrefcount(x) for x in arrays] == before[1]


IN_A_NEW_PROCESS = """
import sys
from pathlib import Path

import numpy as np

from bender_compiled import kernels, stored_code
from bender_compiled.simulation import Drive, Simulator
from bender_plant.model import load_model

kernels.kernels_folder = lambda: Path(sys.argv[1])
if sys.argv[2] == "declared":
    stored_code.KNOWN = (0, 0)
time = np.arange(80) * 0.05
drive = Drive.of_rows(time, 20.0 * (1.0 - np.cos(3.0 * time)))
model = load_model("paper").with_block("slew_limit", slew_rate_V_per_s=30.0)
model = model.with_block("creep", gains=(0.1,), time_constants_s=(1.0,))
np.save(sys.argv[3], Simulator(drive).run(model).reading_um)
print("numba.np.linalg" in sys.modules)
"""


def run(folder: Path, how: str) -> tuple[bytes, bool]:
    """Simulate in a process of its own; returns the readings, and whether all was declared."""
    place = folder / f"{how}.npy"
    words = [sys.executable, "-c", IN_A_NEW_PROCESS, str(folder / "kernels"), how, str(place)]
    said = subprocess.run(words, check=True, capture_output=True, text=True)
    return place.read_bytes(), said.stdout.strip() == "True"


@pytest.mark.slow
@pytest.mark.skipif(numba.version_info.short != stored_code.KNOWN, reason="another numba reads as it always does")
def test_stored_code_gives_the_same_numbers_without_declarations(tmp_path: Path) -> None:
    compiled, declared_to_compile = run(tmp_path, "compiled")
    stored, declared_to_read = run(tmp_path, "stored")
    declared, as_ever = run(tmp_path, "declared")
    assert compiled == stored == declared
    assert (declared_to_compile, declared_to_read, as_ever) == (True, False, True)


@pytest.fixture
def compiled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[], Any]:
    """Return what imports a compiled function anew, with the cache in a folder of its own."""
    monkeypatch.setattr(kernels, "kernels_folder", lambda: tmp_path)
    return lambda: kernels._generated.__wrapped__("grid", _TEXT).grid


_TEXT = (
    kernels.sources([])
    + "\n\nfrom numba import njit\n\n"
    + """
@njit(cache=True, nogil=True)
def grid(x):
    return 2.0 * x
"""
)


@pytest.mark.parametrize("known", few([True, False], 0))
@pytest.mark.parametrize("kind", ["nbc", "nbi"])
@pytest.mark.parametrize("left", few([0, 20, 400], 1))
def test_a_file_that_was_cut_short_is_compiled_anew(
    known: bool, kind: str, left: int, compiled: Callable[[], Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stored_code, "KNOWN", numba.version_info.short if known else (0, 0))
    assert compiled()(1.5) == 3.0
    (cut,) = tmp_path.rglob(f"*.{kind}")
    cut.write_bytes(cut.read_bytes()[:left])
    again = compiled()
    assert type(again._cache) is StoredCode
    assert again(1.5) == 3.0
    stored = compiled()
    assert stored(1.5) == 3.0
    assert (sum(again.stats.cache_hits.values()), sum(stored.stats.cache_hits.values())) == (0, 1)


def test_what_cannot_be_written_is_compiled_all_the_same(
    compiled: Callable[[], Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "no space left on device")

    assert compiled()(1.5) == 3.0
    (index,) = tmp_path.rglob("*.nbi")
    index.write_bytes(b"")
    monkeypatch.setattr(IndexDataCacheFile, "flush", full)
    monkeypatch.setattr(IndexDataCacheFile, "save", full)
    assert compiled()(1.5) == 3.0


LAGGED = PAPER.with_block("sensor_lag", time_constant_s=0.01)


def test_what_the_first_model_lacks_is_compiled_from_the_last_one_on() -> None:
    limited, heavier = (
        PAPER.with_block(name, **values)
        for name, values in (("slew_limit", {"slew_rate_V_per_s": 100.0}), ("tip_mass", {"frequency_ratio": 0.9}))
    )
    assert compile_blocks([PAPER, LAGGED, heavier, limited, LAGGED]) == ["sensor_lag", "slew_limit"]
    assert compile_blocks([LAGGED, LAGGED]) == []


@pytest.mark.slow
def test_a_process_leaves_kernels_on_disk_for_this_one(tmp_path: Path) -> None:
    places = {"XDG_CACHE_HOME": tmp_path, "LOCALAPPDATA": tmp_path, "NUMBA_CACHE_DIR": tmp_path / "numba"}
    words = [sys.executable, "-m", background_compilation.__name__]
    subprocess.run(
        words, input=pickle.dumps([PAPER, LAGGED]), env={**os.environ, **{k: str(v) for k, v in places.items()}},
        check=True, timeout=120,
    )  # fmt: skip
    assert [x.name.rsplit("_", 1)[0] for x in tmp_path.rglob("bender_kernel_*.py")] == ["bender_kernel_sensor_lag"]
    assert list(tmp_path.rglob("*.nbc"))


@pytest.fixture
def begun(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The processes that are begun, in a folder without kernels on a machine of two cores."""
    found: list[Any] = []
    popen = subprocess.Popen

    def kept(*words: Any, **how: Any) -> "subprocess.Popen[bytes]":
        found.append(popen(*words, **how))
        return found[-1]

    monkeypatch.setattr(subprocess, "Popen", kept)
    monkeypatch.setattr(background_compilation, "kernels_folder", lambda: tmp_path)
    monkeypatch.setenv(THREADS, "2")
    return found


@pytest.mark.parametrize("cores", [1, 2])
def test_no_process_is_begun_where_kernels_are_there_or_no_core_is_free(
    cores: int, begun: list[Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # kernels of blocks that none of the models has are of no use here
    there = {"learned_hysteresis", "calibration", "linear_modes", "sensor_lag"} if cores > 1 else set[str]()
    for name in there:
        (tmp_path / f"bender_kernel_{name}_0.py").touch()
    monkeypatch.setenv(THREADS, str(cores))
    with compile_in_background(lambda: [PAPER, LAGGED]):
        assert begun == []


def test_the_process_ends_with_the_block(begun: list[Any]) -> None:
    def interrupted() -> None:
        with compile_in_background(lambda: [PAPER, LAGGED]):
            assert begun[0].poll() is None
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert begun[0].returncode is not None


@pytest.mark.usefixtures("begun")
def test_where_no_process_can_be_begun_this_one_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    refused: list[object] = []

    def none_left(*words: object, **_: object) -> None:
        refused.append(words)
        raise BlockingIOError("no more processes")

    monkeypatch.setattr(subprocess, "Popen", none_left)
    with compile_in_background(lambda: [PAPER, LAGGED]):
        assert len(refused) == 1


PARSED_AT_ONCE = """
import gc, threading, time
from bender_compiled.kernels import _compilable
from bender_plant.blocks.creep import step
failures = []

def work():
    try:
        for _ in range(100):
            _compilable(step, "")
    except BaseException as error:
        failures.append(repr(error))

# whoever comes between two steps of the parser, as the finaliser of any library may
gc.set_threshold(20)
gc.callbacks.append(lambda *_: time.sleep(1e-4))
threads = [threading.Thread(target=work) for _ in range(6)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
gc.callbacks.clear()
print(failures)
"""


def test_kernels_are_written_by_several_threads_at_once() -> None:
    done = subprocess.run([sys.executable, "-c", PARSED_AT_ONCE], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
