"""The corrected FMU where PythonFMU has no binary."""

from pathlib import Path

import pytest

from bender_discrepancy.conclusion.measurement import gap
from bender_discrepancy.conclusion.measurement.gap import _build
from bender_export.build import build_plant_fmu
from bender_loop.fmu.plant import FmuPlant
from bender_native.compilers import own_compiler
from bender_plant.model import load_model


@pytest.mark.slow
@pytest.mark.skipif(own_compiler() is None, reason="no C compiler on this machine")
def test_where_pythonfmu_cannot_run_the_corrected_fmu_has_no_python(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    model = load_model("paper").with_block("transport_delay", delay_s=0.0123)
    usual = build_plant_fmu(model, tmp_path / "usual.fmu")
    monkeypatch.setattr(gap, "unsupported", lambda: "no binary here")
    native = _build(model, tmp_path / "native.fmu")
    readings = []
    for fmu in (usual, native):
        with FmuPlant(fmu) as plant:
            plant.reset()
            readings.append([plant.step(10.0 * (k % 4), 0.01) for k in range(80)])
    assert readings[0] == readings[1]
    assert native.read_bytes() != usual.read_bytes()
