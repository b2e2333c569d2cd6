"""The gap, measured: as given, recalibrated, and with the corrected FMU driven with the records in a child process."""

import math
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bender_compiled.simulation import Simulator
from bender_export.build import build_plant_fmu
from bender_loop.record import Record
from bender_plant.model import Model

from .correct import Gap, driven, gap
from .diagnose import Diagnosis
from .hypothesis import Calibration
from .observations import Array
from .playable import playable


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """The gap at three stages, and the readings that it was measured with.

    Attributes:
        before: the model as given.
        recalibrated: after calibration alone.
        after: the corrected FMU.
        floor_um: what no model could go below: the noise, and the step of coarse readings.
        before_um: (n,) readings of every record, as given.
        recalibrated_um: after calibration alone.
        after_um: of the corrected FMU.
    """

    before: Gap
    recalibrated: Gap
    after: Gap
    floor_um: float
    before_um: list[Array]
    recalibrated_um: list[Array]
    after_um: list[Array]


def measure(diagnosis: Diagnosis, model: Model, calibration: Calibration, fmu: Path) -> Measured:
    """Build the FMU of the corrected model at a path, drive it with the records, and compare on held-out rows.

    Args:
        diagnosis: of the records.
        model: corrected, with the offset of the first record in it.
        calibration: gain and offsets in the corrected model, one offset for each record.
        fmu: where it is written.

    Raises:
        RunError: the FMU could not be driven.
        InputError: the FMU could not be written.
    """
    bench = diagnosis.bench
    given = [Simulator(x.drive).run(diagnosis.base).reading_um for x in bench.observations]
    alone = diagnosis.found.base.calibration
    recalibrated = [alone.gain * y + offset for y, offset in zip(given, alone.offsets_um, strict=True)]
    build_plant_fmu(model, fmu)
    played = [playable(x.drive) for x in bench.observations]
    linear = any(x.drive.linear for x in bench.observations)
    readings = _driven(diagnosis, model, fmu, [record for record, _ in played], linear)
    first = calibration.offsets_um[0]
    after = [
        y[rows] + (offset - first)
        for y, (_, rows), offset in zip(readings, played, calibration.offsets_um, strict=True)
    ]
    measured = [np.where(x.usable, x.measured_um, np.nan) for x in bench.observations]
    judged = [x.judging for x in bench.observations]
    before, alone_left, left = (gap(measured, simulated, judged) for simulated in (given, recalibrated, after))
    floor = math.hypot(diagnosis.found.noise_um, diagnosis.sensor_step_um / math.sqrt(12.0))
    return Measured(before, alone_left, left, floor, given, recalibrated, after)


def _driven(diagnosis: Diagnosis, model: Model, fmu: Path, records: list[Record], linear: bool) -> list[Array]:
    """Drive the FMU with every record; records after the first one get it with surroundings of their own."""
    best = diagnosis.best.hypothesis
    if not best.has_surroundings:
        return driven(fmu, records, linear)
    found = driven(fmu, records[:1], linear)
    with tempfile.TemporaryDirectory() as folder:
        for k, record in enumerate(records[1:], 1):
            other = best.around(model, k)
            found += driven(build_plant_fmu(other, Path(folder) / f"{k}.fmu"), [record], linear)
    return found
