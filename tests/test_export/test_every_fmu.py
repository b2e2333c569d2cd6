"""Every built-in model, transducer and effect as an FMU: checked, simulated, restored; every importer at hand."""

import json
import subprocess
import sys
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from effect_examples import EXAMPLES
from few import few
from fmu_hosts import (
    IMPORTERS,
    WITHIN_M,
    assert_fmutool_finds_nothing,
    assert_no_check_finds_anything,
    hosted,
    largest_difference,
)
from plant_runs import kernel_outputs_m

from bender_export.archive import packed
from bender_export.build import controller_fmu, plant_fmu, reference_fmu
from bender_loop.fmu.check.check import check
from bender_plant.blocks import BLOCKS
from bender_plant.model import BUILT_IN, BlockSettings, Model, load_model

HERE = Path(__file__).parent
STAIRS = [(12.0 * (k // 6 % 4), 0.012) for k in range(48)]
InChild = Callable[[Sequence[Path], Sequence[tuple[float, float]]], list[list[list[float]]]]


def _models() -> dict[str, Model]:
    models = {name: load_model(name) for name in BUILT_IN}
    beam = load_model("beam")
    for block in BLOCKS.values():
        if block.transducer:
            kept = tuple(settings for settings in beam.blocks if not BLOCKS[settings.id].transducer)
            bare = Model(block.id, beam.beam, (*kept, _default(block.id)))
            models[f"transducer_{block.id}"] = bare
    for block_id, parameters in EXAMPLES:
        name = f"effect_{block_id}_{parameters.get('form', '')}".rstrip("_")
        models[name] = load_model("paper").with_block(block_id, **parameters)
    return models


def _default(block_id: str) -> BlockSettings:
    return BlockSettings(block_id, BLOCKS[block_id].parameters())


MODELS = _models()


QUICK = ["paper", "beam", "bench", "transducer_bouc_wen", "effect_saturation_knee", "effect_creep"]
"""These are built in every run of the tests, the others for `make test-all`."""
THESE_AND_ALL = pytest.mark.parametrize(
    "names", [QUICK, pytest.param(list(MODELS), marks=pytest.mark.slow)], ids=["some", "all"]
)
Fmus = Callable[[Sequence[str]], list[Path]]


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> Fmus:
    """Return a function that builds FMUs, each once."""
    folder = tmp_path_factory.mktemp("every")

    def built(names: Sequence[str]) -> list[Path]:
        paths = [folder / f"{name}.fmu" for name in names]
        for name, path in zip(names, paths, strict=True):
            if not path.exists():
                path.write_bytes(plant_fmu(MODELS[name]))
        return paths

    return built


def test_every_effect_is_among_them() -> None:
    neutral = {"bending_modes", "calibration"}
    covered = {settings.id for model in MODELS.values() for settings in model.blocks}
    assert set(BLOCKS) - covered == set()
    effects = {block.id for block in BLOCKS.values() if not block.transducer} - neutral
    assert effects <= {block_id for block_id, _ in EXAMPLES}


@pytest.mark.parametrize(
    "name", ["controller", "reference", *few(MODELS, *(list(MODELS).index(name) for name in QUICK))]
)
def test_no_check_finds_anything(fmus: Fmus, name: str, tmp_path: Path) -> None:
    if name in MODELS:
        (path,) = fmus([name])
    else:
        path = tmp_path / f"{name}.fmu"
        path.write_bytes(controller_fmu() if name == "controller" else reference_fmu())
    assert_no_check_finds_anything(path)


@pytest.mark.slow
def test_fmutool_finds_nothing(fmus: Fmus) -> None:
    assert_fmutool_finds_nothing(fmus(list(MODELS)))


@pytest.mark.slow
@pytest.mark.parametrize("kind", few(["plant", "controller", "reference"], 0))
def test_the_whole_check_with_its_trial_run_finds_nothing(kind: str, tmp_path: Path) -> None:
    makers = {"plant": lambda: plant_fmu(load_model("paper")), "controller": controller_fmu, "reference": reference_fmu}
    path = tmp_path / f"{kind}.fmu"
    path.write_bytes(makers[kind]())
    report = check(path)
    assert report.findings == ()
    assert "trial run" in report.ran


@THESE_AND_ALL
def test_every_fmu_gives_the_numbers_of_its_kernel(fmus: Fmus, names: list[str], in_child: InChild) -> None:
    together = in_child(fmus(names), STAIRS)
    for name, outputs in zip(names, together, strict=True):
        assert largest_difference(outputs, kernel_outputs_m(MODELS[name], STAIRS)) <= WITHIN_M, name
        assert max(abs(row[1]) for row in outputs) > 1e-8, name


@THESE_AND_ALL
def test_states_of_every_fmu_go_on_to_the_last_bit(fmus: Fmus, names: list[str]) -> None:
    job = json.dumps({"fmus": [str(path) for path in fmus(names)], "seed": 1, "points": 2})
    done = subprocess.run(
        [sys.executable, str(HERE / "state_laws.py")],
        input=job, capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == []


def test_a_repacked_fmu_is_the_same(fmus: Fmus) -> None:
    (path,) = fmus(["paper"])
    data = path.read_bytes()
    with zipfile.ZipFile(path) as archive:
        assert packed({name: archive.read(name) for name in archive.namelist()}) == data


STEP_S = 0.01
SCENARIOS = {"step": [10.0] * 120, "staircase": [10.0 * (k // 20 % 6) for k in range(240)]}
UNEVEN = [(20.0 * (k % 3), 0.003 + 0.0071 * (k * k % 11)) for k in range(80)]


@pytest.mark.parametrize("script", IMPORTERS)
@pytest.mark.parametrize("scenario", few(SCENARIOS, 0))
def test_every_importer_gives_the_numbers_of_fmpy(
    script: str, scenario: str, plant_fmu: Path, in_child: InChild, tmp_path: Path
) -> None:
    voltages = SCENARIOS[scenario]
    (expected,) = in_child([plant_fmu], [(voltage_V, STEP_S) for voltage_V in voltages])
    found = hosted(script, {"fmu": str(plant_fmu), "voltages": voltages, "step_s": STEP_S}, tmp_path)
    assert largest_difference(found, [outputs[0] for outputs in expected]) <= WITHIN_M
    assert max(found) > 1e-6


def test_a_record_with_uneven_steps_through_fmpy(plant_fmu: Path, in_child: InChild) -> None:
    (found,) = in_child([plant_fmu], UNEVEN)
    assert largest_difference(found, kernel_outputs_m(load_model("paper"), UNEVEN)) <= WITHIN_M
