"""The lag of a plant, taken out of it for an effect that is that lag with something nonlinear in it."""

from dataclasses import asdict

from bender_plant.blocks import plant_lag
from bender_plant.model import Model, ModelError


def without_a_lag(model: Model, shortest_s: float, effect: str) -> tuple[Model, float]:
    """Return the model without its first lag, and that lag's time constant in s.

    Args:
        model: with a lag or two.
        shortest_s: a lag that is no longer does not show in the rows.
        effect: that takes it over, for the message.

    Raises:
        ModelError: there is none that shows.
    """
    lag = next((x.parameters for x in model.blocks if x.id == plant_lag.ID), None)
    if not isinstance(lag, plant_lag.Parameters) or lag.time_constant_s <= shortest_s:
        raise ModelError(f"{effect}: found a model without a lag that rows show, expected one to take over")
    rest = asdict(lag) | {"time_constant_s": lag.second_time_constant_s, "second_time_constant_s": 0.0}
    return model.with_block(plant_lag.ID, **rest), lag.time_constant_s


def without_the_longest_lag(model: Model, shortest_s: float, effect: str) -> tuple[Model, float]:
    """Return the model without the longer of its lags, and that lag's time constant in s; raises as `without_a_lag`."""
    rest, tau_s = without_a_lag(model, shortest_s, effect)
    try:
        last, other_s = without_a_lag(rest, shortest_s, effect)
    except ModelError:
        return rest, tau_s
    if other_s <= tau_s:
        return rest, tau_s
    return last.with_block(plant_lag.ID, time_constant_s=tau_s), other_s
