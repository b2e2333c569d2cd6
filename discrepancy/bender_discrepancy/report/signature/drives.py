"""The drives that show effects best, and a plant simulated under one of them with and without an effect."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bender_compiled.simulation import Drive, Simulator
from bender_effects.catalogue import FULL_VOLTAGE_V, Effect, FULL_STROKE_um
from bender_loop.records.acting_voltage import acting_V
from bender_loop.records.compare import Comparison, compare
from bender_plant.blocks import BLOCKS
from bender_plant.composite_beam import static_gain_um_per_V
from bender_plant.model import BlockSettings, Model, ModelError, load_model

Array = NDArray[np.float64]

CAMERA_NOISE_um = 0.06
VIBROMETER_NOISE_um = 0.02
CAMERA_Hz = 30.0
RAMP_PART = 0.6
SETTLE_s = 2.0
"""Of the time before a sweep: the rest is for settling."""


@dataclass(frozen=True, slots=True)
class ShownDrive:
    """A voltage to play, and how it is read.

    Attributes:
        words: what is played, for a caption.
        time_s: (n,) instants of the readings.
        voltage_V: (n,) commands, each from its row on.
        linear: the voltage runs straight from row to row (a function generator) instead of being held (a supply).
        noise_um: what the sensor that reads this fast usually has.
        parts: the rows of each sweep, for views that look at frequencies.
        band_Hz: the frequencies that the sweeps run through.
    """

    words: str
    time_s: Array
    voltage_V: Array
    linear: bool
    noise_um: float
    parts: tuple[slice, ...] = ()
    band_Hz: tuple[float, float] = (0.0, np.inf)

    @property
    def acting_V(self) -> Array:
        """The command in force when each row was read."""
        return acting_V(self.time_s, self.time_s, self.voltage_V, self.linear)


@dataclass(frozen=True, slots=True)
class Signature:
    """What an effect leaves: readings with and without it under one drive, in um, and the residual.

    Attributes:
        drive: what was played.
        with_um: (n,) the reading of the plant that has the effect, as a measurement would give it.
        without_um: (n,) the reading of the model that lacks it.
        comparison: of the two, before and after gain and offset are recalibrated.
        residual_um: (n,) with minus recalibrated without.
    """

    drive: ShownDrive
    with_um: Array
    without_um: Array
    comparison: Comparison
    residual_um: Array


def nominal_model() -> Model:
    """Return the plant of the pictures: the paper's beam and stroke, linear and with one mode.

    It has no memory and no curvature of its own, so what its readings show is the effect's.
    """
    paper = load_model("paper")
    if paper.beam is None:
        raise ModelError("paper: found no [beam], expected one to take the static gain from")
    factor = FULL_STROKE_um / FULL_VOLTAGE_V / static_gain_um_per_V(paper.beam)
    kept = tuple(settings for settings in paper.blocks if not BLOCKS[settings.id].transducer)
    transducer = BLOCKS["linear_transduction"]
    return replace(
        paper, name="nominal", blocks=(*kept, BlockSettings(transducer.id, transducer.parameters(gain_factor=factor)))
    )


def simulate(effect: Effect) -> Signature:
    """Simulate the nominal plant under the drive of an effect, with the effect's example values and without."""
    model = nominal_model()
    drive = DRIVES[effect.drive]()
    simulator = Simulator(Drive.of_rows(drive.time_s, drive.voltage_V, linear=drive.linear))
    without_um = simulator.run(model).reading_um
    with_um = simulator.run(model.with_block(effect.block.id, **effect.example)).reading_um
    comparison = compare(with_um, without_um)
    return Signature(drive, with_um, without_um, comparison, with_um - comparison.recalibration.apply(without_um))


def _rows(duration_s: float, rate_Hz: float) -> Array:
    return np.arange(round(duration_s * rate_Hz) + 1) / rate_Hz


def _ramps(words: str, turns_V: Sequence[float], rate_V_per_s: float, linear: bool = True) -> ShownDrive:
    instants = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(turns_V)) / rate_V_per_s)])
    time_s = _rows(float(instants[-1]), CAMERA_Hz)
    return ShownDrive(words, time_s, np.interp(time_s, instants, turns_V), linear, CAMERA_NOISE_um)


def _holds(
    words: str, levels_V: Sequence[float], hold_s: float, rate_Hz: float, noise_um: float = CAMERA_NOISE_um
) -> ShownDrive:
    time_s = _rows(hold_s * len(levels_V), rate_Hz)
    which = np.minimum((time_s / hold_s + 1e-9).astype(int), len(levels_V) - 1)
    return ShownDrive(words, time_s, np.asarray(levels_V, dtype=float)[which], False, noise_um)


def _sweeps(
    words: str,
    levels_V: Sequence[float],
    amplitude_V: float,
    band_Hz: tuple[float, float],
    sweep_s: float,
    rate_Hz: float,
) -> ShownDrive:
    """Sweep sines upwards on an exponential scale about each level, after a ramp to it has settled."""
    low, high = band_Hz
    octaves = np.log(high / low)
    within_s = _rows(SETTLE_s + sweep_s, rate_Hz)[:-1]
    t = np.maximum(within_s - SETTLE_s, 0.0)
    phase = 2.0 * np.pi * low * sweep_s / octaves * np.expm1(octaves * t / sweep_s)
    swing_V = amplitude_V * np.sin(phase)
    ramp = np.minimum(within_s / (RAMP_PART * SETTLE_s), 1.0)
    steps_V = np.diff(levels_V, prepend=0.0)
    voltage_V = np.concatenate([v - (1.0 - ramp) * step + swing_V for v, step in zip(levels_V, steps_V, strict=True)])
    first, size = round(SETTLE_s * rate_Hz), within_s.size
    parts = tuple(slice(k * size + first, (k + 1) * size) for k in range(len(levels_V)))
    return ShownDrive(words, np.arange(voltage_V.size) / rate_Hz, voltage_V, True, VIBROMETER_NOISE_um, parts, band_Hz)


DRIVES: dict[str, Callable[[], ShownDrive]] = {
    "slow_triangle": lambda: _ramps("a triangle of 0 to 50 V in 40 s, 30 frames/s", (0, 50, 0), 2.5),
    "small_triangle": lambda: _ramps(
        "triangles of 0 to 6 V in steps of 10 mV, 30 frames/s", (0, 6, 0, 6, 0), 0.3, linear=False
    ),
    "bipolar_triangle": lambda: _ramps("triangles of both signs, 5 V/s, 30 frames/s", (0, 50, -50, 50, 0), 5.0),
    "ladder": lambda: _ramps(
        "a falling ladder of triangles about 25 V, 5 V/s, 30 frames/s", (0, 50, 0, 42, 8, 35, 15, 29, 21, 25), 5.0
    ),
    "cycles": lambda: _ramps("triangles of 0 to 50 V for 170 s, 30 frames/s", (0, *(50, 0) * 17), 10.0),
    "steps": lambda: _holds(
        "steps up and down, held for 1 s, read 1 000 times/s",
        (0, 20, 0, 40, 10, 50, 0),
        1.0,
        1000.0,
        VIBROMETER_NOISE_um,
    ),
    "fast_steps": lambda: _holds(
        "steps of 10 to 50 V, read 2 000 times/s",
        (0, 10, 0, 30, 0, 50, 0),
        0.4,
        2000.0,
        VIBROMETER_NOISE_um,
    ),
    "long_holds": lambda: _holds("steps up and down, held for 100 s, 30 frames/s", (30, 10, 45, 0), 100.0, CAMERA_Hz),
    "staircase_2997": lambda: _holds(
        "a staircase of 0 to 50 V, held for 10 s, 29.97 frames/s", (*range(0, 50, 6), *range(48, -1, -6)), 10.0, 29.97
    ),
    "slow_chirp": lambda: _sweeps(
        "a sweep of 25 ± 10 V from 0.1 to 10 Hz, read 200 times/s", (25,), 10.0, (0.1, 10.0), 40.0, 200.0
    ),
    "resonance_chirp": lambda: _sweeps(
        "a sweep of 25 ± 0.5 V from 20 to 300 Hz, read 4 000 times/s", (25,), 0.5, (20.0, 300.0), 8.0, 4000.0
    ),
    "high_chirp": lambda: _sweeps(
        "a sweep of 25 ± 0.5 V from 40 to 1 000 Hz, read 8 000 times/s", (25,), 0.5, (40.0, 1000.0), 6.0, 8000.0
    ),
    "chirps_at_levels": lambda: _sweeps(
        "sweeps of ± 0.2 V from 60 to 180 Hz about 5, 25 and 45 V, read 4 000 times/s",
        (5, 25, 45),
        0.2,
        (60.0, 180.0),
        4.0,
        4000.0,
    ),
}
"""By the names that the catalogue uses."""
