"""Plants of the loop's tests: a first-order lag in closed form, and the same as an FMU."""

import math
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from pythonfmu.builder import FmuBuilder

SLAVE = Path(__file__).parent / "slaves" / "bender_loop_test_lag.py"


class Lag:
    """tau y' + y = gain u + offset, read with a static share of the input; exact for a held input."""

    def __init__(self, gain_um_per_V: float = 0.5, tau_s: float = 0.1, feedthrough: float = 0.0, rest_um: float = 0.0):
        self.gain, self.tau_s, self.feedthrough, self.rest_um = gain_um_per_V, tau_s, feedthrough, rest_um
        self.reset()

    def reset(self) -> None:
        self.time_s = self.lagged = self.voltage_V = 0.0
        self.steps: list[tuple[float, float]] = []

    def read(self) -> float:
        return self.rest_um + (1.0 - self.feedthrough) * self.lagged + self.feedthrough * self.gain * self.voltage_V

    def step(self, voltage_V: float, step_s: float) -> float:
        self.steps.append((voltage_V, step_s))
        self.voltage_V = voltage_V
        self.lagged += -math.expm1(-step_s / self.tau_s) * (self.gain * voltage_V - self.lagged)
        self.time_s += step_s
        return self.read()

    def close(self) -> None:
        pass


@pytest.fixture(scope="session")
def lag_fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Gain 1 um/V and 0.1 s unless set; outputs in m: y, doubled, held (the input), clock (start of the step)."""
    folder = tmp_path_factory.mktemp("lag_fmu")
    return Path(FmuBuilder.build_FMU(SLAVE, dest=folder, canGetAndSetFMUstate=True, needsExecutionTool=False))


Edit = Callable[..., Path]


@pytest.fixture
def edited(lag_fmu: Path, tmp_path: Path) -> Edit:
    """Makes a copy of the FMU with texts of its modelDescription.xml replaced, entries renamed, binaries spoilt."""

    def edit(
        *changes: tuple[str, str],
        rename: Callable[[str], str | None] = lambda name: name,
        binary: bytes | None = None,
    ) -> Path:
        copy = tmp_path / "edited.fmu"
        with zipfile.ZipFile(lag_fmu) as source, zipfile.ZipFile(copy, "w") as target:
            for name in source.namelist():
                data = source.read(name)
                if name == "modelDescription.xml":
                    data = _changed(data.decode(), changes).encode()
                if name.startswith("binaries/") and binary is not None:
                    data = binary
                new_name = rename(name)
                if new_name is not None:
                    target.writestr(new_name, data)
        return copy

    return edit


def _changed(text: str, changes: tuple[tuple[str, str], ...]) -> str:
    for old, new in changes:
        assert old in text, f"{old!r} is not in the model description, so the case tests nothing"
        text = text.replace(old, new)
    return text


@pytest.fixture(scope="session")
def lag() -> type[Lag]:
    return Lag
