"""The models that the records leave open beside the corrected one: what suits it should suit them too."""

from dataclasses import dataclass, replace

from bender_discrepancy.conclusion.contenders import MOST_REPORTED
from bender_discrepancy.conclusion.findings import Findings, moved_gain
from bender_discrepancy.conclusion.measurement.corrected_model import carried, corrected, straight_beyond
from bender_discrepancy.conclusion.measurement.reading_units import in_reading_units
from bender_export.build import plant_fmu
from bender_inference.fitting.output_error import Fitted
from bender_plant.model import Model, ModelError
from bender_report.wording import listed


def _files(number: int) -> tuple[str, str]:
    return f"rival-{number}.toml", f"rival-{number}.fmu"


RIVAL_FILES = tuple(name for k in range(1, MOST_REPORTED + 1) for name in _files(k))
"""All that may be written of them."""


@dataclass(frozen=True, slots=True)
class RivalModel:
    """One of them.

    Attributes:
        number: from 1 on, the nearest first.
        effects: that it has, by their ids.
        model: with these effects, refitted, in the place of the corrected model's.
        probability: of the effect in which it differs.
    """

    number: int
    effects: tuple[str, ...]
    model: Model
    probability: float

    @property
    def files(self) -> tuple[str, str]:
        """Names of the model file and of the FMU."""
        return _files(self.number)

    def to_dict(self) -> dict[str, object]:
        """Return it as `diagnosis.json` has it."""
        model, fmu = self.files
        return {"effects": list(self.effects), "probability": round(self.probability, 6), "model": model, "fmu": fmu}

    def fmu(self) -> bytes:
        """Return the content of its FMU."""
        return plant_fmu(self.model)


def rival_models(findings: Findings) -> tuple[RivalModel, ...]:
    """Return what the device may be instead of the corrected model; none where the verdict is not open.

    Those are the effects that are reported as rivals, each with its own fit of the records. What belongs to a record is
    left out of them as it is of the corrected model; two that are then the same count once, and one with a gain that no
    model holds is none.
    """
    best, found = _device(findings, findings.search.best), []
    known = [] if best is None else [best.blocks]
    for x in findings.effects:
        contender = x.contender
        if contender is None or contender.rival_of is None:
            continue
        model = _device(findings, contender.fitted)
        if model is not None and model.blocks not in known:
            known.append(model.blocks)
            effects = _carried(findings, contender.fitted).hypothesis.effects
            found.append(RivalModel(len(found) + 1, effects, model, contender.probability))
    return tuple(found)


def _carried(findings: Findings, fitted: Fitted) -> Fitted:
    return carried(fitted, with_record_effects=findings.search.settings.with_record_effects)


def _device(findings: Findings, fitted: Fitted) -> Model | None:
    kept, given = _carried(findings, fitted), findings.model
    step_um = findings.lattice.step_um if findings.lattice and findings.lattice.is_simulated else 0.0
    try:
        model = corrected(findings.search.base, kept, step_um, findings.of_record)
    except ModelError:
        return None
    if given.valid:
        model = straight_beyond(model, kept.hypothesis.effects, given.valid, findings.search.whole)
    if findings.of_a_device:
        model = in_reading_units(model, moved_gain(findings.search, fitted))
    said = f"a model with {listed(kept.hypothesis.effects) or 'no effect'}, which the records do not rule out"
    return replace(model, description=f"{said} beside that in model.toml", valid=given.valid)
