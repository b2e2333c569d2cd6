"""Effects that are a lag with something in it take that lag over, and leave the others."""

import pytest

from bender_effects.catalogue import EFFECTS
from bender_effects.effect import Sizes
from bender_effects.form import Form
from bender_plant.blocks import bearing_friction, output_limit, plant_lag
from bender_plant.model import Model, ModelError, model_from_table

SIZES = Sizes(10.0, 50.0, 60.0, 0.0, piezo_bender=False, highest_Hz=50.0)


def device(first_s: float, second_s: float) -> Model:
    blocks = [
        {"id": "linear_transduction", "sensitivity_um_per_V": 5.0},
        {"id": "plant_lag", "time_constant_s": first_s, "second_time_constant_s": second_s},
    ]
    return model_from_table({"format": 1, "name": "device", "description": "", "block": blocks})


def of(model: Model, block: str):
    return next(x.parameters for x in model.blocks if x.id == block)


def forms(effect: str, part: str) -> list[Form]:
    return [x for x in EFFECTS[effect].forms(SIZES) if part in x.name]


@pytest.mark.parametrize("lags", [(3.0, 0.2), (0.2, 3.0)])
def test_the_friction_of_a_place_takes_both_lags_and_keeps_the_shorter(lags: tuple[float, float]):
    plain, loaded = forms("bearing_friction", "place")
    for form, values in ((plain, (4.0,)), (loaded, (4.0, -1.0))):
        found = form.apply(device(*lags), values)
        assert of(found, "plant_lag") == plant_lag.Parameters()
        load = values[1] if len(values) > 1 else 0.0
        assert of(found, "bearing_friction") == bearing_friction.Parameters(0.2, 4.0, load_um=load, form="place")
        with pytest.raises(ModelError, match="without a lag"):
            form.apply(device(3.0, 0.0), values)


@pytest.mark.parametrize(
    ("lags", "stopped_s", "left_s"), [((3.0, 0.2), 3.0, 0.2), ((0.2, 3.0), 3.0, 0.2), ((2.0, 0.0), 2.0, 0.0)]
)
def test_a_stop_takes_the_longest_lag(lags: tuple[float, float], stopped_s: float, left_s: float):
    for form in forms("output_limit", "stop"):
        values = tuple(7.0 for _ in form.free)
        found = form.apply(device(*lags), values)
        assert of(found, "plant_lag") == plant_lag.Parameters(left_s)
        side = "below" if "below" in form.name else "above"
        sides = dict(zip([x.name for x in form.free], values, strict=True))
        assert of(found, "output_limit") == output_limit.Parameters(side, time_constant_s=stopped_s, **sides)


def test_no_stop_without_a_lag():
    with pytest.raises(ModelError, match="without a lag"):
        forms("output_limit", "stop above")[0].apply(device(0.0, 0.0), (7.0,))
