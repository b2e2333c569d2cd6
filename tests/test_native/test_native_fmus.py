"""FMUs without Python through every checker and importer at hand."""

from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from effect_examples import EXAMPLES
from few import few
from fmpy import simulate_fmu
from fmu_hosts import (
    IMPORTERS,
    assert_fmutool_finds_nothing,
    assert_no_check_finds_anything,
    hosted,
    largest_difference,
    stepped_in_child,
)
from native_hosts import own_way
from plant_runs import kernel_outputs_m

from bender_export.system import loop_of
from bender_loop.control.pid import Gains, Limits, PidState, step
from bender_loop.fmu.check.check import check
from bender_native.build import native_controller_fmu, native_plant_fmu, native_reference_fmu
from bender_native.compilers import own_compiler, own_platform
from bender_plant.model import BUILT_IN, Model, load_model

pytestmark = pytest.mark.skipif(
    own_compiler() is None or own_platform() is None, reason="no C compiler on this machine, or no name for it"
)
STEP_S = 0.01
WITHIN_M = 1e-15
STAIRS_V = [10.0 * (k // 20 % 6) for k in range(240)]


def _much() -> Model:
    """As a diagnosis may leave it: several effects, of all stages."""
    model = load_model("beam")
    examples = dict(EXAMPLES)
    for block_id in (
        "supply_quantisation", "transport_delay", "source_resistance", "rate_independent_hysteresis", "creep",
        "sensor_lag", "sensor_quantisation",
    ):  # fmt: skip
        model = model.with_block(block_id, **examples[block_id])
    return model


MODELS = {**{name: load_model(name) for name in BUILT_IN}, "much": _much()}


def kernel_m(model: Model) -> list[float]:
    return [reading for reading, _ in kernel_outputs_m(model, [(voltage_V, STEP_S) for voltage_V in STAIRS_V])]


Fmus = Callable[[Sequence[str]], list[Path]]


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> Fmus:
    """Return a function that builds FMUs, each once."""
    folder = tmp_path_factory.mktemp("native")

    def built(names: Sequence[str]) -> list[Path]:
        paths = [folder / f"{name}.fmu" for name in names]
        for name, path in zip(names, paths, strict=True):
            if not path.exists():
                path.write_bytes(native_plant_fmu(MODELS[name], own_way(2), own=True))
        return paths

    return built


@pytest.mark.parametrize("name", few(MODELS, list(MODELS).index("bench")))
def test_no_check_finds_anything(fmus: Fmus, name: str) -> None:
    (path,) = fmus([name])
    assert_no_check_finds_anything(path)


@pytest.mark.parametrize("names", few([["bench"], list(MODELS)], 0), ids=["one", "all"])
def test_fmutool_finds_nothing(fmus: Fmus, names: list[str]) -> None:
    assert_fmutool_finds_nothing(fmus(names))


@pytest.mark.parametrize("fmi", few([2, 3], 1))
@pytest.mark.parametrize("kind", few(["plant", "controller", "reference"], 0))
def test_the_whole_check_with_its_trial_run_finds_nothing(kind: str, fmi: int, tmp_path: Path) -> None:
    makers: dict[str, Callable[[], bytes]] = {
        "plant": lambda: native_plant_fmu(load_model("paper"), own_way(fmi), own=True),
        "controller": lambda: native_controller_fmu(own_way(fmi)),
        "reference": lambda: native_reference_fmu(own_way(fmi)),
    }
    path = tmp_path / f"{kind}.fmu"
    path.write_bytes(makers[kind]())
    report = check(path)
    assert report.findings == ()
    assert "trial run" in report.ran


def test_the_controller_starts_with_the_gains_of_a_tuning(tmp_path: Path) -> None:
    path = tmp_path / "controller.fmu"
    path.write_bytes(native_controller_fmu(own_way(2), loop_of(Gains(0.25, 7.0), Limits(0.0, 95.0), 0.02)))
    found = simulate_fmu(
        str(path), stop_time=0.02, step_size=0.02, output_interval=0.02, start_values={"setpoint": 8e-6}
    )
    assert found["command"][-1] == step(Gains(0.25, 7.0), Limits(0.0, 95.0), PidState(), 8.0, 0.0, 0.02)[1]


@pytest.mark.parametrize("script", IMPORTERS)
@pytest.mark.parametrize("name", few(["bench", "much"], 0))
def test_every_importer_gives_the_numbers_of_the_kernel(script: str, name: str, fmus: Fmus, tmp_path: Path) -> None:
    (path,) = fmus([name])
    found = hosted(script, {"fmu": str(path), "voltages": STAIRS_V, "step_s": STEP_S}, tmp_path)
    assert largest_difference(found, kernel_m(MODELS[name])) <= WITHIN_M
    assert max(found) > 1e-6


@pytest.mark.slow
def test_fmpy_gives_the_numbers_of_the_kernel_with_all_of_them_in_one_process(fmus: Fmus) -> None:
    together = stepped_in_child(fmus(list(MODELS)), [(voltage_V, STEP_S) for voltage_V in STAIRS_V])
    for model, outputs in zip(MODELS.values(), together, strict=True):
        assert largest_difference([reading for reading, *_ in outputs], kernel_m(model)) <= WITHIN_M
