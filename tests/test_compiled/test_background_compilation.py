"""Kernels compiled in a process beside this one: which ones, when, and that nothing is left running."""

import os
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

from bender_compiled import background_compilation
from bender_compiled.background_compilation import compile_blocks, compile_in_background
from bender_compiled.parallel_map import THREADS
from bender_plant.model import load_model

PAPER = load_model("paper")
LAGGED = PAPER.with_block("sensor_lag", time_constant_s=0.01)
LIMITED = PAPER.with_block("slew_limit", slew_rate_V_per_s=100.0)
HEAVIER = PAPER.with_block("tip_mass", frequency_ratio=0.9)


def test_what_the_first_model_lacks_is_compiled_from_the_last_one_on() -> None:
    assert compile_blocks([PAPER, LAGGED, HEAVIER, LIMITED, LAGGED]) == ["sensor_lag", "slew_limit"]
    assert compile_blocks([LAGGED, LAGGED]) == []


def test_modes_with_a_load_are_compiled_beside_those_without() -> None:
    rubbing = PAPER.with_block("coulomb_friction", level_um=0.1)
    assert compile_blocks([PAPER, rubbing, LAGGED]) == ["sensor_lag", "bending_modes"]


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


@pytest.mark.parametrize("cores", [1, 2])
def test_no_process_is_begun_where_kernels_are_there_or_no_core_is_free(
    cores: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # kernels of blocks that none of the models has are of no use here
    there = {"learned_hysteresis", "calibration", "linear_modes", "sensor_lag"} if cores > 1 else set[str]()
    for name in there:
        (tmp_path / f"bender_kernel_{name}_0.py").touch()
    monkeypatch.setattr(background_compilation, "kernels_folder", lambda: tmp_path)
    monkeypatch.setenv(THREADS, str(cores))
    begun: list[object] = []
    monkeypatch.setattr(subprocess, "Popen", lambda *words, **_: begun.append(words))
    with compile_in_background(lambda: [PAPER, LAGGED]):
        assert begun == []


def test_the_process_ends_with_the_block(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(background_compilation, "kernels_folder", lambda: tmp_path / "none")
    monkeypatch.setenv(THREADS, "2")
    begun: list[subprocess.Popen[bytes]] = []
    popen = subprocess.Popen

    def kept(*words: object, **how: object) -> "subprocess.Popen[bytes]":
        begun.append(popen(*words, **how))  # pyright: ignore[reportArgumentType, reportCallIssue]
        return begun[-1]

    monkeypatch.setattr(subprocess, "Popen", kept)

    def interrupted() -> None:
        with compile_in_background(lambda: [PAPER, LAGGED]):
            assert begun[0].poll() is None
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert begun[0].returncode is not None


def test_where_no_process_can_be_begun_this_one_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(background_compilation, "kernels_folder", lambda: tmp_path / "none")
    monkeypatch.setenv(THREADS, "2")
    refused: list[object] = []

    def none_left(*words: object, **_: object) -> None:
        refused.append(words)
        raise BlockingIOError("no more processes")

    monkeypatch.setattr(subprocess, "Popen", none_left)
    done: list[str] = []
    with compile_in_background(lambda: [PAPER, LAGGED]):
        done.append("the block")
    assert (len(refused), done) == (1, ["the block"])
