"""A record of a hidden bench as a camera makes it: light over an exposure, a picture, the tip in it, a time stamp.

The clock is virtual: nothing is waited for. Instants are those of the runner: a frame is stamped when it was grabbed,
its age is taken off, and the command that rests on it acts after that.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from bender_emulator.microscope import Scene
    from bender_hil.vision import Tracker
    from bender_loop.records.record import Record
    from bender_proving import Case

Array = NDArray[np.float64]

FRAMES_PER_S = 30.0
DURATION_S = 20.0
"""The excitation of the other cases, eight times as quick: every picture is drawn and searched."""
EXPOSURES_S = (0.002, 0.02)
"""A frame has to be read out and answered before the next exposure begins."""
READOUT_S = 0.004
"""From the end of an exposure to the grabbed frame, on the average: known, as `camera.delay_s` says it."""
STAMP_S = 0.0003
"""Standard deviation of a time stamp: the thread that grabs frames is woken late."""
ANSWER_S = (0.002, 0.006)
"""From the grabbed frame to the command on the wire."""
INSTANTS = 240
"""At so many instants within an exposure the tip is drawn: the mean of a swing of two periods is true to 1e-4 of it."""
WIDTH_PX, HEIGHT_PX, REST_PX = 256, 160, (176.0, 50.0)
"""The part of the sensor that is read out: room for the whole stroke."""
DUST, SPECKS = 1, 1
"""As many on the area as on the whole sensor."""
ZERO_FRAMES = 15
WIPED = 10
"""Times that dirt on the tip is wiped away before a bench is given up."""


@dataclass(frozen=True, slots=True)
class CameraRecord:
    """What the camera gave.

    Attributes:
        record: as it is written.
        seen_um: (n,) the mean of the tip over each exposure, without noise: what an ideal camera would have read.
    """

    record: "Record"
    seen_um: Array


def camera_record(case: "Case", exposure_s: float, rng: np.random.Generator) -> CameraRecord:
    """Play the case's excitation and record it through the emulated camera.

    Args:
        case: what is hidden; read by a camera.
        exposure_s: how long the shutter is open.
        rng: of stamps, answers, dirt and the sensor's noise.
    """
    from bender_loop.records.record import Record
    from bender_proving.records.excitations import rich

    voltage_V = rich("camera", rng, DURATION_S).voltage_V
    middle_s = np.arange(voltage_V.size) / FRAMES_PER_S
    late_s = np.minimum(rng.exponential(STAMP_S, voltage_V.size), 0.1 / FRAMES_PER_S)
    grabbed_s = middle_s + 0.5 * exposure_s + READOUT_S - STAMP_S + late_s
    acting_s = grabbed_s + rng.uniform(*ANSWER_S, voltage_V.size)
    places_um = exposed_um(case, middle_s, exposure_s, acting_s, voltage_V)
    displacement_um = found_um(places_um, rng)
    time_s = grabbed_s - (0.5 * exposure_s + READOUT_S)
    origin_s = time_s[0]
    record = Record(
        np.round(time_s - origin_s, 7),
        voltage_V,
        displacement_um,
        command_time_s=np.round(acting_s - origin_s, 7),
        exposure_s=np.full_like(time_s, exposure_s),
    )
    return CameraRecord(record, places_um.mean(axis=1))


def exposed_um(case: "Case", middle_s: Array, exposure_s: float, acting_s: Array, voltage_V: Array) -> Array:
    """Return where the tip is while the shutter is open, (n, 240): equal parts of every exposure."""
    from bender_proving.chain import Commands, readings_um

    parts = (np.arange(INSTANTS) + 0.5) / INSTANTS - 0.5
    instants_s = (middle_s[:, None] + exposure_s * parts).ravel()
    tip_um = readings_um(Commands(instants_s, acting_s, voltage_V), case.effects).reshape(-1, INSTANTS)
    return case.gain * tip_um + case.offset_um


def exposed_record(case: "Case", exposure_s: float) -> "Record":
    """Return a case's own record with readings that are means over an exposure, read without a picture.

    A command that answers a reading acts after the shutter has closed.
    """
    from bender_loop.records.record import Record
    from bender_proving import NOISE_UM, Bench

    bench = Bench(case)
    plan = bench.excitation()
    played, rows = plan.commands, plan.recorded
    acting_s = played.act_s + 0.5 * exposure_s
    seen_um = exposed_um(case, played.read_s, exposure_s, acting_s, played.voltage_V).mean(axis=1)[rows]
    noise_um = case.gain * NOISE_UM[case.sensor] * bench.noise().standard_normal(seen_um.size)
    return Record(
        plan.time_s[rows],
        plan.voltage_V[rows],
        seen_um + noise_um,
        command_time_s=acting_s[rows],
        exposure_s=np.full_like(seen_um, exposure_s),
    )


def found_um(places_um: Array, rng: np.random.Generator) -> Array:
    """Return what the tracker reads off the pictures of (n, 240) places, nan where it finds no tip.

    Raises:
        RunError: dirt hid the tip at rest however often it was wiped away.
    """
    scene, tracker = _zeroed(rng)
    return np.array([tracker.locate(scene.render_places(x)).displacement_um for x in places_um])


def _zeroed(rng: np.random.Generator) -> "tuple[Scene, Tracker]":
    """Return a scene and a tracker that has found its tip at rest; where dirt hides the tip, it is wiped away."""
    from bender_emulator.microscope import Scene, SceneSettings
    from bender_loop.errors import RunError

    rest_x_px, rest_y_px = REST_PX
    settings = SceneSettings(WIDTH_PX, HEIGHT_PX, rest_x_px=rest_x_px, rest_y_px=rest_y_px, dust=DUST, specks=SPECKS)
    for _ in range(WIPED):
        scene = Scene(settings, rng)
        tracker = _tracker(settings.um_per_px)
        try:
            tracker.zero([scene.render(0.0) for _ in range(ZERO_FRAMES)])
        except RunError:
            continue
        return scene, tracker
    raise RunError(f"the tip at rest was hidden by dirt {WIPED} times, expected a picture that shows it")


def _tracker(um_per_px: float) -> "Tracker":
    from bender_hil.calibration import Calibration
    from bender_hil.vision import Tracker, TrackerSettings

    return Tracker(TrackerSettings(), Calibration.told(um_per_px, WIDTH_PX, HEIGHT_PX))
