"""Machine code from disk: what reading it leaves out, that the numbers are the same, and files that are not whole."""

import errno
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
from few import few
from numba.core.caching import IndexDataCacheFile

from bender_compiled import kernels, stored_code
from bender_compiled.kernels import grid_run
from bender_compiled.stored_code import StoredCode

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


def test_the_cutting_into_sub_steps_is_stored() -> None:
    numbers = np.array([0.0, 0.1]), np.array([0.0]), np.array([1.0]), np.array([0.0])
    count, begin, *_ = grid_run()(*numbers, 10.0, 0.01, 0.05, 2.0, 0.0, 1e9, 1e9, 99)
    assert count > 0
    assert begin[0] == 0.0
    assert type(getattr(grid_run(), "_cache", None)) is StoredCode
