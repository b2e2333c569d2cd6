"""The learned equation in general form: it is equation (30) where it says so, and knows no communication step."""

import math

import numpy as np
import pytest
from bender_compiled.simulation import Drive, Simulator
from bender_plant.blocks import BLOCKS
from bender_plant.model import BlockSettings, Model, ModelError, load_model
from bender_plant.plant import Plant
from scipy.integrate import solve_ivp

STAIRS = np.array([20.0, 20.0, 45.0, 10.0, 10.0, 30.0, 0.0, 50.0, 5.0, 5.0, 5.0, 49.0])
RELAXING = {"terms": ("w", "u", "u'", "w |w|", "u |u|"), "coefficients": (-0.5, 1.2, 0.7, -0.1, 0.01)}
HYSTERETIC = {"terms": ("u'", "|u'| w", "u' |w|", "w"), "coefficients": (1.0, -0.05, -0.02, -0.3)}


def model_with(block_id: str, name: str = "bench", **parameters: object) -> Model:
    bench = load_model(name)
    others = tuple(x for x in bench.blocks if x.id != "learned_hysteresis")
    return Model("test", bench.beam, (*others, BlockSettings(block_id, BLOCKS[block_id].parameters(**parameters))))


def run(model: Model, voltages: np.ndarray, step_s: float, parts: int = 1) -> np.ndarray:
    plant = Plant(model)
    state, readings = plant.initial(), []
    for k, voltage in enumerate(voltages):
        reading = math.nan
        for part in range(parts):
            state, reading, _ = plant.step(state, float(voltage), (k + part / parts) * step_s, step_s / parts)
        readings.append(reading)
    return np.array(readings)


@pytest.mark.parametrize("name", ["paper", "bench"])
def test_as_it_comes_it_is_equation_30(name: str) -> None:
    ours = run(model_with("sparse_equation", name), STAIRS, 1 / 30)
    assert np.max(np.abs(ours - run(load_model(name), STAIRS, 1 / 30))) < 1e-3


@pytest.mark.parametrize("parameters", [RELAXING, HYSTERETIC], ids=["relaxing", "hysteretic"])
@pytest.mark.parametrize("step_s", [0.1, 1 / 30])
def test_halving_the_step_changes_nothing(parameters: dict[str, object], step_s: float) -> None:
    model = model_with("sparse_equation", **parameters)
    assert np.max(np.abs(run(model, STAIRS, step_s) - run(model, STAIRS, step_s, parts=2))) < 1e-3


@pytest.mark.parametrize("parameters", [RELAXING, HYSTERETIC], ids=["relaxing", "hysteretic"])
def test_the_compiled_run_equals_the_plain_kernel(parameters: dict[str, object]) -> None:
    model = model_with("sparse_equation", **parameters)
    time = np.arange(STAIRS.size + 1) / 30.0
    compiled = Simulator(Drive.of_rows(time, np.append(STAIRS, 0.0))).run(model).reading_um[1:]
    assert np.max(np.abs(compiled - run(model, STAIRS, 1 / 30))) < 1e-7


def test_a_rate_term_follows_the_path_against_solve_ivp() -> None:
    def rate(t: float, w: np.ndarray) -> list[float]:
        du = 10.0 * math.cos(t)
        return [1.0 * du - 0.05 * abs(du) * w[0] - 0.02 * du * abs(w[0]) - 0.3 * w[0]]

    block = BLOCKS["sparse_equation"]
    numbers = block.constants(block.parameters(**HYSTERETIC), None)
    assert block.step is not None
    state, h, ours = block.initial(numbers), 0.002, []
    for k in range(3000):
        u = [10.0 * math.sin(h * (k + x)) for x in (0.0, 0.5, 1.0)]
        state, _, _, w = block.step(state, numbers, 0.0, h, *u)
        ours.append(w)
    expected = solve_ivp(rate, (0.0, 6.0), [0.0], "DOP853", [2.0, 4.0, 6.0], rtol=1e-10, atol=1e-10, max_step=0.01)
    assert [ours[999], ours[1999], ours[2999]] == pytest.approx(expected.y[0], abs=1e-4)


@pytest.mark.parametrize(
    ("terms", "words"),
    [
        (("w", "sin(u)"), "expected factors"),
        (("u'^2",), "u' or"),
        (("w", "w"), "expected each term once"),
        (("w^12",), "expected factors"),
        (("",), "zero at rest"),
    ],
)
def test_what_is_no_equation_is_refused(terms: tuple[str, ...], words: str) -> None:
    with pytest.raises(ModelError, match=words):
        BLOCKS["sparse_equation"].parameters(terms=terms, coefficients=(0.1,) * len(terms))
