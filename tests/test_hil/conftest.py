"""An emulated supply in a process of its own, one for the tests of a module."""

from collections.abc import Iterator

import pytest
from emulated_bench import emulated_supply

from bender_emulator.start import EmulatedSupply


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EmulatedSupply]:
    with emulated_supply(tmp_path_factory.mktemp("supply")) as supply:
        yield supply


@pytest.fixture
def supply(running: EmulatedSupply) -> EmulatedSupply:
    running.power_on()
    return running
