from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from fmu_hosts import loaded, stepped_in_child

from bender_export import build
from bender_export.build import build_plant_fmu
from bender_plant.model import load_model

_SCRIPT = Path(__file__).with_name("running_fmu.py")


@pytest.fixture(scope="session")
def plant_fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_plant_fmu(load_model("paper"), tmp_path_factory.mktemp("fmu") / "paper.fmu")


@pytest.fixture(scope="session")
def beam_fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_plant_fmu(load_model("beam"), tmp_path_factory.mktemp("fmu") / "beam.fmu")


@pytest.fixture(scope="session")
def controller_fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("fmu") / "controller.fmu"
    path.write_bytes(build.controller_fmu())
    return path


@pytest.fixture(scope="session")
def running_fmu() -> Any:
    """Return the class that runs an FMU in this process."""
    return loaded(_SCRIPT).RunningFmu


@pytest.fixture(scope="module")
def paper(plant_fmu: Path, running_fmu: Any) -> Iterator[Any]:
    with running_fmu(plant_fmu) as running:
        yield running


@pytest.fixture
def plant(paper: Any) -> Any:
    """The plant of the paper at rest, with a clean log."""
    paper.slave.reset()
    paper.begin({})
    paper.messages.clear()
    return paper


@pytest.fixture(scope="session")
def in_child() -> Callable[[Sequence[Path], Sequence[tuple[float, float]]], list[list[list[float]]]]:
    """Return a function that steps FMUs side by side in a child process: [fmu][step][output]."""
    return stepped_in_child
