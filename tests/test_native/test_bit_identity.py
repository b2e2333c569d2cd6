"""The translated plant gives the very bits of `Plant.step`: every block, every form, every built-in model."""

import os
import random
from dataclasses import replace
from typing import Any

import pytest
from effect_examples import EXAMPLES
from native_hosts import Library, Running, needs_own_compiler, plant_library

from bender_native.plant_source import plant_source
from bender_plant.blocks import BLOCKS
from bender_plant.model import BUILT_IN, Model, load_model
from bender_plant.parameter import ModelError
from bender_plant.plant import Plant
from bender_plant.variables import variables

pytestmark = needs_own_compiler

SEEDS, MOST_SEEDS, STEPS = 2, 60, int(os.environ.get("BENDER_NATIVE_STEPS", "1100"))
"""For each model; all models together take more than 100 000 steps."""
PAPER = load_model("paper")
TRANSDUCERS: dict[str, dict[str, Any]] = {
    "linear_transduction": {"sensitivity_um_per_V": 0.4},
    "sparse_equation": {"terms": ("w", "u", "u'", "|w|", "w |w|"), "coefficients": (-0.5, 1.6, 0.8, -0.2, -0.1)},
    "prandtl_ishlinskii": {},
    "bouc_wen": {},
}
OTHERS: list[tuple[str, dict[str, Any]]] = [
    ("bouc_wen", {"exponent": 1.7}),
    ("bouc_wen", {"printed": True}),
    ("sparse_equation", {"terms": ("w^3", "u^2 u'", "|u'| |w|", "u |u|"), "coefficients": (-0.01, 1e-4, -0.02, 0.3)}),
    ("bending_modes", {"count": 4, "shares": "beam"}),
    ("bending_modes", {"cubic_1_per_um2": 1e-3}),
    ("bending_modes", {"first_frequency_Hz": 104.0}),
    ("calibration", {"gain": 0.9, "offset_um": 0.3}),
]


def _with(block_id: str, parameters: dict[str, Any]) -> Model:
    if not BLOCKS[block_id].transducer:
        return PAPER.with_block(block_id, **parameters)
    kept = tuple(s for s in PAPER.blocks if not BLOCKS[s.id].transducer)
    block = BLOCKS[block_id]
    settings = type(PAPER.blocks[0])(block_id, block.parameters(**parameters))
    return Model("tested", PAPER.beam, (settings, *kept))


def _everything() -> Model:
    model = PAPER
    for block_id, parameters in EXAMPLES:
        if block_id not in {settings.id for settings in model.blocks}:
            model = model.with_block(block_id, **parameters)
    return model


def models() -> dict[str, Model]:
    found = {name: load_model(name) for name in BUILT_IN}
    for block_id, parameters in [*TRANSDUCERS.items(), *OTHERS, *EXAMPLES]:
        found[f"{block_id} {len(found)}"] = _with(block_id, parameters)
    found["everything"] = _everything()
    return found


MODELS = models()


def test_every_block_and_every_form_is_among_the_models() -> None:
    ids = {settings.id for model in MODELS.values() for settings in model.blocks}
    assert ids == set(BLOCKS)
    for block_id, name in (
        ("saturation", "form"),
        ("rate_independent_hysteresis", "form"),
        ("bending_modes", "shares"),
    ):
        module = BLOCKS[block_id].module
        said = {getattr(s.parameters, name) for m in MODELS.values() for s in m.blocks if s.id == block_id}
        assert said == set(getattr(module, "FORMS", None) or module.SHARES)
    assert SEEDS * len(MODELS) * STEPS > 100_000


class Drive:
    """Draws voltages, lengths of steps and parameters; the same seed draws the same."""

    def __init__(self, seed: int, model: Model) -> None:
        self.random = random.Random(seed)
        self.tunable = [v for v in variables(model) if v.variability == "tunable" and v.name != "saturation.scale"]
        self.voltage_V = 0.0

    def voltage(self) -> float:
        draw = self.random
        if draw.random() < 0.3:
            self.voltage_V = draw.choice([0.0, 10.0, draw.uniform(-50.0, 50.0), draw.gauss(0.0, 3.0)])
        elif draw.random() < 0.2:
            self.voltage_V += draw.gauss(0.0, 0.1)
        return self.voltage_V

    def length(self) -> float:
        return self.random.choice([0.001, 0.001, 0.01, 0.01, 0.05, self.random.uniform(1e-4, 0.02)])

    def change(self, values: dict[str, float]) -> dict[str, float]:
        """Return a small change of one tunable parameter."""
        if not self.tunable:
            return {}
        variable = self.random.choice(self.tunable)
        assert variable.start is not None
        assert variable.minimum is not None
        assert variable.maximum is not None
        old = values.get(variable.name, variable.start)
        new = old * self.random.uniform(0.8, 1.2) if old else old
        return {variable.name: min(max(new, variable.minimum), variable.maximum)}


def compare(model: Model, library: Library, seed: int, steps: int) -> int:
    """Drive both hosts alike; returns the number of steps that gave the same bits.

    Now and then a parameter changes, the state is saved and brought back, in memory or as bytes, into another instance.
    """
    drive = Drive(seed, model)
    plant, values = Plant(model), {}
    state, time_s, done = plant.initial(), 0.0, 0
    running = Running(library)
    try:
        while done < steps:
            voltage_V, step_s = drive.voltage(), drive.length()
            chance = drive.random.random()
            if chance < 0.01:
                change = drive.change(values)
                try:
                    changed = Plant(model.with_values(values | change))
                except ModelError:
                    continue
                values |= change
                plant = changed
                running.set(change)
            elif chance < 0.02:
                kept = running.saved()
                assert running.step(17.0, time_s, 0.003) is not None
                running.restore(kept)
            elif chance < 0.03:
                data = running.serialised()
                running.__exit__()
                running = Running(library, start_s=1.0)
                running.deserialise(data)
            expected: list[float] | None
            try:
                after, reading_um, tip_um = plant.step(state, voltage_V, time_s, step_s)
                expected = [reading_um / 1e6, tip_um / 1e6]
            except ArithmeticError:
                after, expected = state, None
            except ValueError as problem:
                if "math" not in str(problem):
                    raise
                after, expected = state, None
            found = running.step(voltage_V, time_s, step_s)
            assert [x.hex() for x in found or ()] == [x.hex() for x in expected or ()], f"step {done} at {time_s!r} s"
            if expected is None:
                return done + 1
            state, done = after, done + 1
            time_s += step_s
    finally:
        running.__exit__()
    return done


QUICK = {"paper"}
"""The other models, each block alone and all together, are for `make test-all`."""


@pytest.mark.parametrize("name", [pytest.param(x, marks=[pytest.mark.slow] * (x not in QUICK)) for x in MODELS])
def test_the_same_bits(name: str) -> None:
    model = MODELS[name]
    library = plant_library(model)
    taken = sum(compare(model, library, seed, STEPS) for seed in range(SEEDS))
    # a plant that runs away under a random voltage ends a drive early
    for seed in range(SEEDS, MOST_SEEDS):
        taken += compare(model, library, seed, STEPS) if taken < STEPS else 0
    assert taken >= STEPS


def test_a_change_in_the_last_digits_of_one_factor_is_found() -> None:
    source = plant_source(PAPER)
    text = "2.0 * (k2 + k3)"
    assert text in source.body
    spoilt = replace(source, body=source.body.replace(text, f"{2.0 * (1.0 + 1e-15)!r} * (k2 + k3)"))
    library = Library(spoilt, plant_source(PAPER, dual=True))
    with pytest.raises(AssertionError, match="step"):
        compare(PAPER, library, 0, STEPS)
