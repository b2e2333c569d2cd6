"""An emulated bench that stands beside an investigation, as hardware does: it outlives the programs that drive it.

Its supply and its microscope come back at the addresses that they had, so that a bench file goes on holding after
either was lost. What the supply really gives, and every level that it has taken, is asked behind its terminals.
"""

import contextlib
import time
from pathlib import Path
from types import TracebackType
from typing import Self

from bender_emulator.microscope.settings import SceneSettings
from bender_hil.emulated import EmulatedBench, EmulationSettings
from bender_loop.shell.messages import ClosedError
from bender_vision.scale import Calibration

FRAMES_PER_S = 30.0
Arrival = tuple[float, float]


class StandingBench:
    """Supply and microscope; a context manager that ends both.

    Args:
        settings: of the bench.
        fmu: the plant.

    Attributes:
        arrivals: levels that the supply has taken, of every life of it: time of `time.perf_counter`, V.

    Raises:
        InputError, RunError: a process does not start.
    """

    def __init__(self, settings: EmulationSettings, fmu: Path) -> None:
        self._settings, self._fmu = settings, fmu
        self._bench = EmulatedBench(settings, fmu, FRAMES_PER_S)
        self._ports = _port(self._bench.resource.removesuffix("::SOCKET")), _port(self._bench.stream)
        self.arrivals: list[Arrival] = []
        self._seen = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bench.close()

    def write_bench_file(self, path: Path, guard: str) -> None:
        """Write the bench file, as for hardware, and the calibration that it names.

        Args:
            path: of the bench file.
            guard: lines of its table `[guard]`.
        """
        scene = SceneSettings.from_table(self._settings.scene)
        Calibration.of_scale(scene.um_per_px, scene.width_px, scene.height_px).save(path.with_name("calibration.toml"))
        path.write_text(
            f'[supply]\nresource = "{self._bench.resource}"\nmodel = "{self._settings.supply}"\n'
            f'[camera]\nsource = "{self._bench.stream}"\ncalibration = "calibration.toml"\n'
            f"frames_per_s = {FRAMES_PER_S}\n[guard]\n{guard}"
        )

    def process(self, name: str) -> int:
        """Return the process id of the "supply" or the "microscope"."""
        return (self._bench.supply.process if name == "supply" else self._bench.microscope).pid

    def is_on(self) -> bool:
        """Whether the output is on; a supply that has gone gives nothing."""
        try:
            return bool(self._bench.supply.truth()["is_on"])
        except ClosedError:
            return False

    def note_arrivals(self) -> None:
        """Keep what the supply has taken since it was asked last."""
        with contextlib.suppress(ClosedError):
            told = self._bench.supply.console.ask({"do": "arrivals"})["arrivals"]
            self.arrivals += [(float(t), float(v)) for t, v in told[self._seen :]]
            self._seen = len(told)

    def revive(self) -> None:
        """Start what was lost, at the same addresses, with the tip at rest.

        Raises:
            RunError: it does not start.
        """
        self.note_arrivals()
        self._bench.close()
        time.sleep(0.2)
        self._bench = EmulatedBench(self._settings, self._fmu, FRAMES_PER_S, self._ports)
        self._seen = 0


def _port(address: str) -> int:
    return int(address.rpartition(":")[2])
