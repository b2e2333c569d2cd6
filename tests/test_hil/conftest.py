"""An emulated supply, or a whole emulated bench, in processes of its own, one for the tests of a module."""

from collections.abc import Iterator

import pytest
from emulated_bench import emulated_supply

from bender_emulator.start import EmulatedSupply
from bender_export.build import ensure_plant_fmu
from bender_hil.emulated import EmulatedBench, EmulationSettings


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EmulatedSupply]:
    with emulated_supply(tmp_path_factory.mktemp("supply")) as supply:
        yield supply


@pytest.fixture
def supply(running: EmulatedSupply) -> EmulatedSupply:
    running.make_ready()
    return running


@pytest.fixture(scope="module")
def bench() -> Iterator[EmulatedBench]:
    with EmulatedBench(EmulationSettings(), ensure_plant_fmu("bench"), 30.0) as running:
        yield running
