"""A hysteresis model learned from the records of a unit."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bender_fleet.work.job import UnitResult
from bender_fleet.work.reading import Reading
from bender_plant.model import Model


@dataclass(frozen=True, slots=True)
class IdentifyWork:
    """Learn a model for a unit; `seed` is of the resampling."""

    model: Model
    reading: Reading
    seed: int = 1

    def do(self, paths: Sequence[Path], names: Sequence[str]) -> UnitResult:
        """Return the figures of the model and its files; see `job.Work`."""
        from bender_identify.identification import identify
        from bender_identify.records.experiment import experiment_of
        from bender_identify.report.files import contents
        from bender_identify.settings import Settings

        settings = Settings()
        records = self.reading.records(paths)
        experiments = [
            experiment_of(record, Path(name).name, settings, self.reading.hold, self.reading.untimed)
            for record, name in zip(records, names, strict=True)
        ]
        outcome = identify(experiments, self.model, settings, np.random.default_rng(self.seed), [], lambda _: None)
        best = outcome.written
        row = {
            "learned": best.candidate.title,
            "equation": best.candidate.equation,
            "held_out_percent": float(best.held_out.error_percent),
            "floor_percent": float(outcome.floor_percent),
            "has_model": True,
        }
        files = contents(outcome, "model")
        return UnitResult(row, (), {k: v.encode() if isinstance(v, str) else v for k, v in files.items()})
