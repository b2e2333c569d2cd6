"""What tests of the bench share: a running emulated supply, orders for a guard, a link that is a script."""

import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from bender_emulator.microscope.control import clear_faults
from bender_emulator.settings import SupplyEmulation
from bender_emulator.start import EmulatedSupply
from bender_hil.emulated import EmulatedBench
from bender_hil.guard.settings import GuardOrders, GuardSettings
from bender_hil.guard.start import GuardProcess
from bender_hil.supply.capability import MODELS
from bender_hil.supply.patience import Patience
from bender_hil.supply.select import SupplySettings
from bender_loop.shell.messages import ClosedError
from bender_vision.scale import Calibration

QUICK = GuardSettings(shutdown_limit_s=0.8, discharge_limit_s=1.0, heartbeat_s=1.0, frame_age_s=1.0)
"""Limits that end quickly, and are patient with a busy machine where timing is not what is tested."""
PATIENT = "[guard]\nheartbeat_s = 1.0\nframe_age_s = 1.0\n"
"""Of a bench file: patient with a machine that does other things at the same time."""


@contextlib.contextmanager
def emulated_supply(folder: Path, link: str = "tcp", model: str = "9115") -> Iterator[EmulatedSupply]:
    """An emulated supply in its own process, with the plant `bench` behind it."""
    from bender_export.build import ensure_plant_fmu

    capability = MODELS[model]
    settings = SupplyEmulation(
        fmu=str(ensure_plant_fmu("bench")),
        board=str(folder / "tip_board"),
        model=model,
        maximum_V=capability.maximum_V,
        maximum_A=capability.maximum_A,
        answer_end=capability.dialect.read_end,
        link=link,
        terminal_path=str(folder / "tty"),
    )
    with EmulatedSupply(settings) as supply:
        yield supply


def orders(resource: str, folder: Path, limits: GuardSettings = QUICK, model: str = "9115") -> GuardOrders:
    """Orders of a guard on that supply."""
    supply = SupplySettings(resource, model=model, baud=57600, timeout_s=0.15)
    return GuardOrders(supply, str(folder / "guard.jsonl"), limits)


def write_as_hardware(folder: Path, bench: EmulatedBench, guard: str = PATIENT) -> Path:
    """A bench file as for hardware, whose addresses happen to be the emulator's; nothing of the bench is at fault."""
    bench.supply.power_on()
    clear_faults(bench.control_port)
    folder.mkdir(exist_ok=True)
    Calibration.of_scale(1.5).save(folder / "calibration.toml")
    path = folder / "bench.toml"
    path.write_text(
        f'[supply]\nresource = "{bench.resource}"\n'
        f'[camera]\nsource = "{bench.stream}"\ncalibration = "calibration.toml"\nzero_frames = 5\n{guard}'
    )
    return path


def wait_for(is_so: Callable[[], bool], limit_s: float = 10.0) -> None:
    """Wait until something is so; an AssertionError where it does not become so in time."""
    end_s = time.perf_counter() + limit_s
    while not is_so():
        assert time.perf_counter() < end_s, f"not within {limit_s:g} s"
        time.sleep(0.005)


def wait_until_off(supply: EmulatedSupply, limit_s: float = 5.0) -> float:
    """Wait for the truth to be off; returns when it was switched off, as `time.perf_counter`."""
    end_s = time.perf_counter() + limit_s
    while (truth := supply.truth())["is_on"]:
        if time.perf_counter() > end_s:
            raise AssertionError(f"the output is still on after {limit_s:g} s")
        time.sleep(0.002)
    return float(truth["switched_off_s"])


def drive(guard: GuardProcess, ticks: int, top_V: float = 30.0, tip: float | None = None) -> None:
    """Command a rise of 3 V a tick up to `top_V`, for so many ticks or until the guard ends the run."""
    with contextlib.suppress(ClosedError):
        for tick in range(ticks):
            if guard.has_tripped():
                return
            level_V = min(top_V, 3.0 * tick)
            guard.command(tick, level_V, time.perf_counter(), 0.4 * level_V if tip is None else tip)
            time.sleep(0.02)


def assert_off(supply: EmulatedSupply) -> None:
    """The truth behind the terminals: switched off, and nothing there."""
    truth = supply.truth()
    assert not truth["is_on"]
    assert truth["output_V"] < 1.0


@dataclass
class ScriptedLink:
    """A link whose dialogue is known beforehand: (what is sent, what is answered or None)."""

    dialogue: Sequence[tuple[str, str | None]]
    place: int = 0
    opened: int = 0
    sent: list[str] = field(default_factory=list)
    patience: Patience = field(default_factory=Patience)

    def open(self) -> None:
        self.opened += 1

    def write(self, text: str) -> float:
        self._next(text, has_answer=False)
        return time.perf_counter()

    def query(self, text: str) -> str:
        answer = self._next(text, has_answer=True)
        assert answer is not None
        return answer

    def answer(self, text: str) -> str:
        raise AssertionError(f"{text!r} was answered with one line only")

    def drain(self) -> None:
        pass

    def close(self) -> None:
        pass

    def finish(self) -> None:
        assert self.place == len(self.dialogue), f"never sent: {self.dialogue[self.place :]}"

    def _next(self, text: str, *, has_answer: bool) -> str | None:
        assert self.place < len(self.dialogue), f"{text!r} was sent after the end of the dialogue"
        expected, answer = self.dialogue[self.place]
        assert (text, has_answer) == (expected, answer is not None), f"line {self.place}"
        self.place += 1
        self.sent.append(text)
        return answer
