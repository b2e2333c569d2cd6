"""The FMU of a model, or any FMU, driven with the records of a unit."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bender_fleet.work.diagnose import ForeignModel
from bender_fleet.work.job import UnitResult
from bender_fleet.work.reading import Reading
from bender_plant.model import Model

if TYPE_CHECKING:
    from bender_loop.fmu.plant import FmuPlant
    from bender_loop.fmu.process.watched import WatchedPlant


@dataclass(frozen=True, slots=True)
class CompareWork:
    """Compare a unit's records with a model, all of them laid end to end."""

    model: Model | ForeignModel
    reading: Reading

    def do(self, paths: Sequence[Path], names: Sequence[str]) -> UnitResult:
        """Return the figures of the comparison; see `job.Work`."""
        from bender_loop.records.compare import compare, require_readings
        from bender_loop.records.replay import replay
        from bender_loop.records.sizes import check_sizes

        records = self.reading.records(paths)
        for name, record in zip(names, records, strict=True):
            check_sizes(name, record, self.reading.untimed)
            require_readings(record.displacement_um)
        with self._opened() as plant:
            played = [replay(plant, x, input_hold=self.reading.hold, untimed=self.reading.untimed) for x in records]
        figures = compare(
            np.concatenate([x.displacement_um for x in records]), np.concatenate([x.simulated_um for x in played])
        )
        row = {
            "before_um": figures.before.rms_um,
            "recalibrated_um": figures.recalibrated.rms_um,
            "after_percent": figures.recalibrated.nrmse_percent,
            "gain": figures.recalibration.gain,
            "offset_um": figures.recalibration.offset_um,
        }
        told = {"records": list(names), "start": [x.start for x in played], **asdict(figures)}
        text = json.dumps(told, indent=2, allow_nan=False) + "\n"
        return UnitResult(row, (), {"comparison.json": text.encode()})

    def _opened(self) -> "FmuPlant | WatchedPlant":
        from bender_loop.fmu.plant import FmuPlant
        from bender_loop.fmu.process.watched import WatchedPlant
        from bender_native.ready import ready_plant_fmu

        if isinstance(self.model, Model):
            return FmuPlant(ready_plant_fmu(self.model))
        given = self.model
        plant = WatchedPlant(Path(given.path), input_name=given.input, output_name=given.output)
        return plant.with_parameters(dict(given.parameters))
