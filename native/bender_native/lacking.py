"""Models without one of their effects at a time: what a device may be where nobody vouches for a name."""

from dataclasses import replace
from pathlib import Path

from bender_export.following import model_inside
from bender_loop.errors import InputError
from bender_native.ready import ready_plant_fmu
from bender_plant.blocks import BLOCKS
from bender_plant.model import Model, load_model
from bender_plant.parameter import ModelError

OWN = ("bending_modes", "calibration", "plant_lag")
"""What a linear model has of its own; what turns volts into a motion it has in any case."""
OF_A_RECORD = ("ageing", "periodic_disturbance", "thermal_drift")
"""What no controller follows."""


def without_each_effect(model: Model) -> tuple[tuple[str, Model], ...]:
    """Return the id of each effect of a model, and the model without it."""
    found = []
    for x in model.blocks:
        if x.id in (*OWN, *OF_A_RECORD) or BLOCKS[x.id].transducer:
            continue
        found.append((x.id, replace(model, blocks=tuple(y for y in model.blocks if y is not x))))
    return tuple(found)


def lacking_fmus(model: str | Path | Model) -> tuple[tuple[str, Path], ...]:
    """Return the id of each effect of a model, and the FMU of the model without it.

    Args:
        model: built-in name, model file or FMU; an FMU that is not of this project has no effects that are known.

    Raises:
        InputError: there is no such model, or no place where FMUs can be written.
        RunError: FMUs cannot be built here.
    """
    if isinstance(model, Model):
        loaded = model
    elif Path(model).suffix == ".fmu":
        inside = model_inside(Path(model))
        if inside is None:
            return ()
        loaded = inside
    else:
        try:
            loaded = load_model(model)
        except ModelError as problem:
            raise InputError(str(problem)) from None
    return tuple((name, ready_plant_fmu(x)) for name, x in without_each_effect(loaded))
