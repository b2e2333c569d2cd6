"""The experiments on the emulated bench of `bender_hil`, the only file here that knows it.

Staircase and steps run in real time: SCPI to an emulated supply, frames from an emulated microscope, the tip found in
them, the guard in between. The emulated supply has one polarity, so the paper's sine of +-10 V from a function
generator drives the FMU itself; its frames are drawn by the same microscope and read by the same tracker.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bender_identify.records.voltage_path import even_times
from bender_loop.control.pid import Gains, Limits
from bender_loop.control.plant import restart
from bender_loop.control.references import Step
from bender_loop.control.trace import Trace
from bender_loop.errors import InputError, RunError
from bender_loop.records.record import Record, read_record
from bender_tuner.task.session import open_guarded

if TYPE_CHECKING:
    from bender_hil.runner.program import Program

Array = NDArray[np.float64]
Voltage = Callable[[Array], Array]

NEEDED = ("bender_emulator.microscope.scene", "bender_hil.runner.run", "bender_vision.tracker", "pyvisa_py")
FRAME_S, ZERO_FRAMES = 1.0 / 30.0, 15
SUBSTEPS = 32
PATIENCE_S = 0.5
"""Silence of camera or controller that the guard allows: nothing real is at stake, and a busy machine that stalls must
not pass for a loop that ran away."""
SLEW_SHARE = 0.9
"""The controller keeps to this share of the guard's bound of the slew."""


def why_not() -> str:
    """What keeps the emulated bench from running here; empty where nothing does."""
    try:
        for module in NEEDED:
            import_module(module)
        import_module("bender_loop.shell.opencv").import_cv2()
    except ImportError as error:
        return f"{error.name or error} is missing"
    except InputError as error:
        return str(error)
    return ""


@dataclass(eq=False)
class EmulatedBench:
    """The emulated bench.

    Attributes:
        fmus: plant FMUs by the names of their models, `paper` and `bench`.
        rng: draws the pixels' noise of the sine's frames; the bench in real time has its own.
        out: directory of the runs.
    """

    fmus: Mapping[str, Path]
    rng: np.random.Generator
    out: Path

    how = "the emulated bench in real time: SCPI supply, rendered frames, tracked tip"
    how_sine = (
        "frames rendered by the emulated microscope, tip tracked in them; the emulated supply has one polarity, so "
        "the sine drives the FMU itself"
    )

    @property
    def delay_s(self) -> float:
        """Half the exposure of a frame."""
        from bender_hil.emulated import EmulationSettings

        return 0.5 * EmulationSettings().exposure_s

    def record_sine(self, voltage: Voltage, duration_s: float) -> Record:
        """The sine through the FMU, its frames drawn and tracked; a frame without a tip is lost."""
        from bender_emulator.microscope.scene import Scene
        from bender_emulator.microscope.settings import SceneSettings
        from bender_vision.scale import Calibration
        from bender_vision.settings import TrackerSettings
        from bender_vision.tracker import Tracker

        settings, exposure_s = SceneSettings(), 2.0 * self.delay_s
        scene = Scene(settings, self.rng)
        tracker = Tracker(
            TrackerSettings(), Calibration.of_scale(settings.um_per_px, settings.width_px, settings.height_px)
        )
        tracker.zero(scene.render(0.0) for _ in range(ZERO_FRAMES))
        fine_s, tip_um = self._moved(voltage, duration_s)
        time_s = even_times(FRAME_S, round(duration_s / FRAME_S) + 1)
        middle_s = np.maximum(time_s - self.delay_s, 0.0)
        places = np.interp(middle_s, fine_s, tip_um)
        speeds = np.interp(middle_s, fine_s, np.gradient(tip_um, fine_s))
        tips = [
            tracker.locate(scene.render(place, speed, exposure_s))
            for place, speed in zip(places.tolist(), speeds.tolist(), strict=True)
        ]
        readings = [np.nan if tip.lost is not None else tip.displacement_um for tip in tips]
        return Record(time_s, voltage(time_s), np.array(readings))

    def record_staircase(self, levels_V: Array, dwell_frames: int) -> Record:
        """The staircase in real time."""
        from bender_hil.runner.program import OpenLoop
        from bender_hil.runner.voltages import Voltages

        dwell_s = dwell_frames * FRAME_S
        times = tuple((dwell_s * np.arange(levels_V.size)).tolist())
        return self._run("staircase", OpenLoop(Voltages(times, tuple(levels_V.tolist()), dwell_s * levels_V.size)))[0]

    def settled(self, record: Record, levels_V: Array, dwell_frames: int) -> tuple[Array, Array]:
        """Voltages and the means of their last frames."""
        from bender_hil.log.figures import settled_levels

        del levels_V, dwell_frames
        return settled_levels(record)

    def step(self, name: str, gains: Gains, setpoint_um: float, duration_s: float) -> Trace:
        """The loop in real time; a run that the guard ends counts as one that ran away."""
        from bender_hil.guard.settings import GuardSettings
        from bender_hil.runner.program import ClosedLoop

        guard = GuardSettings()
        limits = Limits(0.0, guard.maximum_V)
        loop = ClosedLoop(Step(setpoint_um), gains, limits, SLEW_SHARE * guard.slew_V_per_s, duration_s)
        record, whole = self._run(f"step-{name}", loop)
        seen = np.isfinite(record.displacement_um)
        reading = record.displacement_um[seen]
        setpoints = np.full(reading.size, setpoint_um)
        return Trace(record.time_s[seen], setpoints, reading, reading, record.voltage_V[seen], diverged=not whole)

    def _run(self, name: str, program: "Program") -> tuple[Record, bool]:
        """One run; returns its record, and whether it came to its planned end."""
        from bender_hil.bench_file import emulated_bench
        from bender_hil.log.read_run import GUARD, RUN
        from bender_hil.runner.run import run

        directory = self.out / "bench" / name
        for journal in (RUN, GUARD):
            (directory / journal).unlink(missing_ok=True)
        bench = emulated_bench()
        bench = replace(bench, guard=replace(bench.guard, heartbeat_s=PATIENCE_S, frame_age_s=PATIENCE_S))
        result = run(bench, program, directory, fmu=lambda model: self.fmus[model])
        if result.interrupted:
            raise KeyboardInterrupt
        if result.record is None:
            raise RunError(f"the run {name} on the emulated bench was too short for a record: {result.ended.sentence}")
        return read_record(result.record), result.ended.code is None

    def _moved(self, voltage: Voltage, duration_s: float) -> tuple[Array, Array]:
        """Times and tip of the plant behind a generator, in steps held at the voltage of their middle."""
        step_s = FRAME_S / SUBSTEPS
        middles = even_times(step_s, round(duration_s / step_s)) + 0.5 * step_s
        with open_guarded(self.fmus["paper"]) as (plant, _):
            tip = [restart(plant)]
            tip += [plant.step(volts, step_s) for volts in voltage(middles).tolist()]
        return even_times(step_s, len(tip)), np.array(tip)
