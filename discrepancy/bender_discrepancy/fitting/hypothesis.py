"""A hypothesis: a model with some effects in it, and how well it fits with gain and offset solved for."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from bender_compiled.simulation import Simulator
from bender_discrepancy.effects.form import Form, Values
from bender_discrepancy.records.observations import Array, Observations
from bender_plant.model import Model, ModelError

# how much longer the sub-steps of fits and of scans are than those of the FMU: some nanometres, some tens of them
COARSER = 3.0
ROUGH = 8.0
COARSE_TURNS = 6


@dataclass(frozen=True, slots=True)
class Part:
    """One effect of a hypothesis: the form it takes and its numbers."""

    form: Form
    values: Values


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """The effects that are taken to be missing; none is the model as given."""

    parts: tuple[Part, ...] = ()

    @property
    def effects(self) -> tuple[str, ...]:
        """The ids of the effects, in the order of adding."""
        return tuple(part.form.effect for part in self.parts)

    @property
    def free_count(self) -> int:
        """Free numbers of all effects."""
        return sum(len(part.values) for part in self.parts)

    def values(self) -> Values:
        """All free numbers, one effect after the other."""
        return tuple(x for part in self.parts for x in part.values)

    def with_values(self, values: Sequence[float]) -> "Hypothesis":
        """Return the same effects with other numbers."""
        parts, begin = [], 0
        for part in self.parts:
            end = begin + len(part.values)
            parts.append(Part(part.form, tuple(float(x) for x in values[begin:end])))
            begin = end
        return Hypothesis(tuple(parts))

    def plus(self, form: Form, values: Values) -> "Hypothesis":
        """Return the hypothesis with one effect more."""
        return Hypothesis((*self.parts, Part(form, values)))

    def minus(self, index: int) -> "Hypothesis":
        """Return the hypothesis without one of its effects."""
        return Hypothesis(self.parts[:index] + self.parts[index + 1 :])

    def model(self, base: Model, record: int = 0) -> Model:
        """Return the base model with the effects in it, with the surroundings of one record.

        Raises:
            ModelError: a number is out of its bounds.
        """
        for part in self.parts:
            base = part.form.apply(base, part.form.of_record(part.values, record))
        return base

    def alone(self, record: int = 0) -> "Hypothesis":
        """Return the hypothesis for one record by itself."""
        return Hypothesis(tuple(Part(x.form.alone(), x.form.of_record(x.values, record)) for x in self.parts))

    def around(self, model: Model, record: int) -> Model:
        """Return a model that has the effects with the surroundings of another record in it."""
        for part in self.parts:
            if part.form.records > 1:
                model = part.form.apply(model, part.form.of_record(part.values, record))
        return model

    @property
    def has_surroundings(self) -> bool:
        """Whether records differ in some of its numbers."""
        return any(part.form.records > 1 for part in self.parts)


@dataclass(frozen=True, slots=True)
class Calibration:
    """Gain and offset of the reading, one offset for each record."""

    gain: float
    offsets_um: Values


@dataclass(slots=True, eq=False)
class Bench:
    """The base model and the observations, with one simulator for each record."""

    base: Model
    observations: tuple[Observations, ...]
    fine: list[Simulator] = field(default_factory=list)
    rough: list[Simulator] = field(default_factory=list)
    evaluations: int = 0

    def __post_init__(self) -> None:
        self.fine = [Simulator(x.drive, coarser=COARSER) for x in self.observations]
        self.rough = [Simulator(x.drive, coarser=ROUGH) for x in self.observations]

    def readings(self, hypothesis: Hypothesis, roughly: bool = False) -> list[Array] | None:
        """Return the simulated readings of every record, None where the model cannot be or runs away."""
        self.evaluations += 1
        try:
            runs = list(enumerate(self.rough if roughly else self.fine))
            own = hypothesis.has_surroundings
            models = [hypothesis.model(self.base, k) for k in range(len(runs) if own else 1)]
            return [simulator.run(models[k if own else 0]).reading_um for k, simulator in runs]
        except (ModelError, ArithmeticError):
            return None

    def calibrate(self, readings: list[Array]) -> Calibration:
        """Solve for gain and offsets by least squares on the training rows.

        A coarse reading stands for the nearest value that it allows, found by turns with gain and offsets.
        """
        targets = [x.measured_um[x.training] for x in self.observations]
        simulated = [y[x.training] for y, x in zip(readings, self.observations, strict=True)]
        found = _straight_line(simulated, targets)
        if all(x.half_step_um == 0.0 for x in self.observations):
            return found
        for _ in range(COARSE_TURNS):
            allowed = []
            for y, d, offset, x in zip(simulated, targets, found.offsets_um, self.observations, strict=True):
                line = found.gain * y + offset
                allowed.append(np.clip(line, d - x.half_step_um, d + x.half_step_um))
            found = _straight_line(simulated, allowed)
        return found

    def residuals(self, readings: list[Array], calibration: Calibration) -> list[Array]:
        """Return measured minus calibrated simulation for every record, NaN where lost."""
        return [
            x.beyond(x.measured_um - calibration.gain * y - offset)
            for x, y, offset in zip(self.observations, readings, calibration.offsets_um, strict=True)
        ]


def _straight_line(simulated: list[Array], targets: list[Array]) -> Calibration:
    """Return the gain common to all records and the offset of each; what hardly moves leaves the gain at 1."""
    means = [(float(y.mean()), float(d.mean())) for y, d in zip(simulated, targets, strict=True)]
    y = np.concatenate([a - mean for a, (mean, _) in zip(simulated, means, strict=True)])
    d = np.concatenate([b - mean for b, (_, mean) in zip(targets, means, strict=True)])
    power = float(y @ y)
    gain = float(y @ d) / power if power > 1e-18 * y.size else 1.0
    return Calibration(gain, tuple(b - gain * a for a, b in means))
