"""Generated code: what it borrows, what it allocates, and that a block of one's own may do as it likes."""

import errno
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numba.core.options import DefaultOptions
from numpy.typing import NDArray

from bender_compiled import kernels, simulation
from bender_compiled.kernels import block_run, uncut_run
from bender_compiled.simulation import Drive, Simulator, constants_of, initial_of
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


@pytest.mark.slow
def test_without_the_private_option_of_numba_kernels_give_the_same(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    model = PAPER.with_block("rate_independent_hysteresis", thresholds_V=(1.0, 3.0), weights_um_per_V=(0.1, 0.2))
    borrowed = Simulator(Drive.of_rows(TIME, VOLTAGE)).run(model).reading_um
    monkeypatch.delattr(DefaultOptions, "_nrt")
    monkeypatch.setattr(kernels, "kernels_folder", lambda: tmp_path)
    monkeypatch.setattr(kernels, "_HEAD", kernels._HEAD + "# another text is another module\n")
    monkeypatch.setattr(simulation, "block_run", block_run.__wrapped__)
    counted = Simulator(Drive.of_rows(TIME, VOLTAGE)).run(model).reading_um
    module = next(x for x in sys.modules if x.startswith("bender_kernel_") and _was_made_in(x, tmp_path))
    assert sys.modules[module].BORROWING == {}
    assert np.array_equal(counted, borrowed)


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


def test_a_module_that_could_not_be_written_leaves_no_part_of_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path, *_: object, **__: object) -> None:
        path.touch()
        raise OSError(errno.ENOSPC, "no space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(OSError, match="no space"):
        kernels._written(tmp_path / "module.py", "text")
    assert list(tmp_path.iterdir()) == []


def _was_made_in(name: str, folder: Path) -> bool:
    made = sys.modules[name].__file__
    return made is not None and Path(made).parent == folder


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
