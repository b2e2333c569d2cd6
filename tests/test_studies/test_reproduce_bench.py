"""The experiments of the reproduction: simulated through the FMU, and on the emulated bench where it can run."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bender_export.build import ensure_plant_fmu
from bender_identify.paper.simulated_bouc_wen import simulated
from bender_loop.control.pid import Gains
from bender_plant.model import load_model
from bender_studies.reproduction import bench as bench_module
from bender_studies.reproduction.bench import SimulatedBench, open_bench
from bender_studies.reproduction.emulated import EmulatedBench, why_not
from bender_studies.reproduction.shared_work import sine_V

REAL_TIME = """
import sys
from pathlib import Path
import numpy as np
from bender_studies.reproduction.emulated import EmulatedBench
from bender_export.build import ensure_plant_fmu
from bender_loop.control.pid import Gains
bench = EmulatedBench({"bench": ensure_plant_fmu("bench")}, np.random.default_rng(0), Path(sys.argv[1]))
trace = bench.step("ours", Gains(0.0, 10.0), 10.0, 2.0)
print(len(trace.time_s), float(trace.displacement_um[-5:].mean()), trace.diverged)
levels = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 4.0, 3.0, 2.0, 1.0, 0.0])
volts, reading = bench.settled(bench.record_staircase(levels, 4), levels, 4)
print(volts.tolist() == levels.tolist(), float(reading.max()))
"""


@pytest.fixture(scope="module")
def fmus() -> dict[str, Path]:
    return {name: ensure_plant_fmu(name) for name in ("paper", "bench")}


@pytest.fixture
def simulated_bench(fmus: dict[str, Path]) -> SimulatedBench:
    return SimulatedBench(fmus["paper"], fmus["bench"], np.random.default_rng(0), "a reason")


def test_a_simulated_sine_is_equation_30_read_late(simulated_bench: SimulatedBench) -> None:
    record = simulated_bench.record_sine(sine_V, 6.0)
    late = np.maximum(record.time_s - simulated_bench.delay_s, 0.0)
    fine = np.linspace(0.0, 6.0, 3001)
    truth = np.interp(late, fine, simulated(load_model("paper"), sine_V, fine))
    assert np.std(record.displacement_um[1:] - truth[1:]) == pytest.approx(bench_module.NOISE_UM, rel=0.2)
    assert record.voltage_V == pytest.approx(sine_V(record.time_s))


def test_a_simulated_staircase_is_read_at_the_end_of_each_step(simulated_bench: SimulatedBench) -> None:
    levels = np.array([0.0, 10.0, 20.0, 10.0, 0.0])
    record = simulated_bench.record_staircase(levels, 60)
    volts, reading = simulated_bench.settled(record, levels, 60)
    assert volts.tolist() == levels.tolist()
    assert reading[0] == pytest.approx(0.0, abs=0.3)
    assert reading[2] > reading[1] > 5.0
    assert "a reason" in simulated_bench.how


def test_a_simulated_loop_arrives(simulated_bench: SimulatedBench) -> None:
    trace = simulated_bench.step("ours", Gains(0.0, 10.0), 10.0, 4.0)
    assert trace.displacement_um[-1] == pytest.approx(10.0, abs=0.3)


def test_the_bench_is_the_emulated_one_unless_something_is_missing(
    fmus: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(0)
    monkeypatch.setattr(bench_module, "why_not", lambda: "")
    assert isinstance(open_bench(fmus, rng, tmp_path), EmulatedBench)
    monkeypatch.setattr(bench_module, "why_not", lambda: "cv2 is missing")
    assert "cv2 is missing" in open_bench(fmus, rng, tmp_path).how


def test_rendered_and_tracked_frames_show_the_tip(fmus: dict[str, Path], tmp_path: Path) -> None:
    if why_not():
        pytest.skip(f"the emulated bench cannot run here: {why_not()}")
    bench = EmulatedBench(fmus, np.random.default_rng(0), tmp_path)
    record = bench.record_sine(sine_V, 3.0)
    fine = np.linspace(0.0, 3.0, 3001)
    truth = np.interp(record.time_s - bench.delay_s, fine, simulated(load_model("paper"), sine_V, fine))
    assert np.isfinite(record.displacement_um).all()
    assert record.displacement_um[2:] == pytest.approx(truth[2:], abs=0.1)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_the_emulated_bench_runs_in_real_time(tmp_path: Path) -> None:
    if why_not():
        pytest.skip(f"the emulated bench cannot run here: {why_not()}")
    done = subprocess.run(
        [sys.executable, "-c", REAL_TIME, str(tmp_path)], capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr
    step, stairs = (line.split() for line in done.stdout.splitlines())
    assert int(step[0]) > 30
    assert float(step[1]) == pytest.approx(10.0, abs=1.0)
    assert step[2] == "False"
    assert stairs[0] == "True"
    assert 2.0 < float(stairs[1]) < 8.0
    assert {path.name for path in (tmp_path / "bench").iterdir()} == {"step-ours", "staircase"}
