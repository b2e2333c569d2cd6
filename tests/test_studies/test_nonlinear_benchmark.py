"""`bender benchmark nonlinear`: splits, what is judged, and files that are not there."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from bender_cli.main import main
from bender_studies.benchmarks import nonlinear
from bender_studies.benchmarks.nonlinear import Benchmark, Part, Rows


def write(path: Path, seed: int, gain: float = 2.0, rows: int = 240) -> np.ndarray:
    """A file of held levels and their readings one row later, with noise of 0.1; returns what was read."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-5.0, 5.0, 40), 6)[:rows]
    u[0] = 0.0
    y = gain * np.concatenate([[0.0], u[:-1]]) + rng.normal(0.0, 0.1, rows)
    table = np.column_stack([0.01 * np.arange(rows), u, y])
    np.savetxt(path, table, delimiter=",", header="time_s,u,y", comments="", fmt="%.9g")
    return y


ONE = Benchmark(
    "one", "mV", 1000.0, (Rows("fit.csv", slice(0, 200)),),
    (Part("rest", Rows("fit.csv"), 200, ((3.5, "somebody"),)), Part("other", Rows("test.csv"), 20, ())), "hold",
)  # fmt: skip
AWAY = Benchmark("away", "V", 1.0, (Rows("away.csv"),), (Part("all", Rows("away.csv"), 0, ()),), "hold")


@pytest.mark.slow
def test_parts_are_judged_by_a_free_run_with_nothing_refitted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    write(tmp_path / "fit.csv", 1)
    # the gain of the test part is another one: nothing hides that
    read = write(tmp_path / "test.csv", 2, gain=2.5)
    monkeypatch.setattr(nonlinear, "BENCHMARKS", (ONE, AWAY))
    out = tmp_path / "out"
    assert main(["benchmark", "nonlinear", "--first-only", "--data", str(tmp_path), "--out", str(out)]) == 0
    rest, other = json.loads((out / "nonlinear.json").read_text(encoding="utf-8"))
    assert rest["linear"] == pytest.approx(100.0, rel=0.3)
    assert other["linear"] == pytest.approx(1000.0 * math.sqrt(0.2**2 * np.mean(read[20:] ** 2) + 0.01), rel=0.1)
    assert rest["ours"] is None
    assert rest["numbers"] >= 2
    said = capsys.readouterr()
    assert "3.5 somebody" in said.out
    assert "away: skipped" in said.err
    assert "away.csv" in said.err


def test_official_splits_share_no_rows():
    # what is judged of a file that is also fitted comes after the rows that are fitted
    for benchmark in nonlinear.BENCHMARKS:
        fitted = {x.file: x.rows.stop for x in benchmark.fits}
        for part in benchmark.parts:
            last = fitted.get(part.run.file)
            assert part.run.file not in fitted or (last is not None and part.judged_from >= last)
