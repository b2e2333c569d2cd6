"""What the paper did on its bench: a sine from a function generator, a staircase and steps from a supply, a camera.

`open_bench` asks whether the emulated bench can run here and otherwise simulates the same through the FMU.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bender_identify.records.voltage_path import even_times
from bender_loop.control.closed_loop import simulate
from bender_loop.control.pid import Gains, Limits
from bender_loop.control.plant import restart
from bender_loop.control.references import Step
from bender_loop.control.sampling import Sampling
from bender_loop.control.trace import Trace
from bender_loop.records.record import Record
from bender_studies.reproduction.emulated import EmulatedBench, Voltage, why_not
from bender_tuner.task.session import open_guarded

Array = NDArray[np.float64]

FRAMES_PER_S = 30.0
EXPOSURE_S, NOISE_UM, SLEW_V_PER_S = 0.004, 0.05, 225.0
SUBSTEPS = 32
LIMITS = Limits(0.0, 50.0)


class Bench(Protocol):
    """Where the experiments run."""

    @property
    def how(self) -> str:
        """What it is, a few words for the page."""
        ...

    @property
    def how_sine(self) -> str:
        """The same for the sine of the function generator."""
        ...

    @property
    def delay_s(self) -> float:
        """How much older than its frame a reading is."""
        ...

    def record_sine(self, voltage: Voltage, duration_s: float) -> Record:
        """The tip under a smooth voltage from the function generator, frame by frame, from rest."""
        ...

    def record_staircase(self, levels_V: Array, dwell_frames: int) -> Record:
        """The tip under voltages from the supply, each held for some frames, from rest."""
        ...

    def settled(self, record: Record, levels_V: Array, dwell_frames: int) -> tuple[Array, Array]:
        """Voltages of a staircase and the readings at their ends, both (levels,)."""
        ...

    def step(self, name: str, gains: Gains, setpoint_um: float, duration_s: float) -> Trace:
        """The closed loop from rest to a set-point."""
        ...


def open_bench(fmus: Mapping[str, Path], rng: np.random.Generator, out: Path) -> Bench:
    """The emulated bench where it can run, else its simulation, which says why."""
    obstacle = why_not()
    return SimulatedBench(fmus["paper"], fmus["bench"], rng, obstacle) if obstacle else EmulatedBench(fmus, rng, out)


@dataclass(eq=False)
class SimulatedBench:
    """The experiments through the FMU: 30 Hz, 4 ms of exposure, 0.05 um of noise, commands of 225 V/s at most.

    Attributes:
        generator_fmu: the plant behind a function generator, which follows at once.
        supply_fmu: the plant behind a supply that takes 20 ms.
        rng: draws the noise.
        obstacle: what keeps the emulated bench from running.
    """

    generator_fmu: Path
    supply_fmu: Path
    rng: np.random.Generator
    obstacle: str

    delay_s = 0.5 * EXPOSURE_S

    @property
    def how(self) -> str:
        """That it is no bench, and why."""
        return f"simulated through the FMU, the emulated bench cannot run here ({self.obstacle})"

    @property
    def how_sine(self) -> str:
        """The same."""
        return self.how

    def record_sine(self, voltage: Voltage, duration_s: float) -> Record:
        """The sine in steps of a millisecond, each held at the voltage of its middle."""
        camera = self._camera()
        frames = camera.ticks(duration_s)
        middles = even_times(camera.plant_step_s, frames * SUBSTEPS) + 0.5 * camera.plant_step_s
        time_s = even_times(camera.period_s, frames + 1)
        readings = self._frames(self.generator_fmu, voltage(middles).reshape(frames, SUBSTEPS), camera)
        return Record(time_s, voltage(time_s), readings)

    def record_staircase(self, levels_V: Array, dwell_frames: int) -> Record:
        """The staircase, with every frame of it."""
        camera = self._camera()
        held_V = np.repeat(levels_V, dwell_frames)
        readings = self._frames(self.supply_fmu, np.repeat(held_V[:, None], SUBSTEPS, axis=1), camera)
        time_s = even_times(camera.period_s, held_V.size + 1)
        return Record(time_s, np.append(held_V, held_V[-1]), readings)

    def settled(self, record: Record, levels_V: Array, dwell_frames: int) -> tuple[Array, Array]:
        """The last frame of every level, taken before the next voltage acts."""
        return levels_V, record.displacement_um[dwell_frames * np.arange(1, levels_V.size + 1)]

    def step(self, name: str, gains: Gains, setpoint_um: float, duration_s: float) -> Trace:
        """The loop with one frame of latency."""
        del name
        camera = self._camera(latency_frames=1)
        with open_guarded(self.supply_fmu) as (plant, _):
            return simulate(
                plant, gains, LIMITS, Step(setpoint_um), camera, duration_s, self.rng, slew_V_per_s=SLEW_V_PER_S
            )

    def _frames(self, fmu: Path, volts: Array, camera: Sampling) -> Array:
        """Readings (frames + 1,) under the voltages (frames, substeps) between them."""
        weights = camera.exposure_weights()
        with open_guarded(fmu) as (plant, _):
            readings = [restart(plant)]
            for held in volts.tolist():
                outputs = [plant.step(voltage_V, camera.plant_step_s) for voltage_V in held]
                readings.append(float(weights @ np.array(outputs)))
        return np.array(readings) + NOISE_UM * self.rng.standard_normal(len(readings))

    def _camera(self, latency_frames: int = 0) -> Sampling:
        return Sampling(FRAMES_PER_S, latency_frames, EXPOSURE_S, NOISE_UM, substeps=SUBSTEPS)
