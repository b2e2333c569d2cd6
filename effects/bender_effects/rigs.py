"""What kind of device a model is of, as far as the words about effects depend on it."""

from bender_plant.model import Model


def is_piezo_bender(model: Model) -> bool:
    """Return whether a model has a beam with a piezoelectric layer, as the paper's actuator has.

    What is typical, and what is unusual for a piezo actuator, is known of such a model only. Models of other devices
    have no beam: a gain and a lag or a mode.
    """
    return model.beam is not None and any(x.piezoelectric_coefficient_C_per_N for x in model.beam.layers)


def learned_commands(model: Model) -> tuple[float, float] | None:
    """Return lowest and highest command that a model of another device was learned from, in its own unit.

    None for a piezo bender, whose supply says how far it may go, and where the model does not say.
    """
    valid = model.valid
    if is_piezo_bender(model) or valid is None or not valid.lowest_V < valid.highest_V:
        return None
    return valid.lowest_V, valid.highest_V
