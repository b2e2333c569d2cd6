"""The learned equation in general form: special cases that other blocks solve, an independent solution, and laws."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from bender_compiled.simulation import Drive, Simulator
from bender_plant.blocks import BLOCKS, sparse_equation
from bender_plant.blocks.sparse_equation import Powers, powers_of
from bender_plant.model import BlockSettings, Model, load_model
from bender_plant.parameter import ModelError
from bender_plant.plant import Plant

PAPER = load_model("paper")
STAIRS = np.array([20.0, 20.0, 45.0, 10.0, 10.0, 30.0, 0.0, 50.0, 5.0, -30.0, -30.0, 49.0])
BOUC_WEN = {"terms": ("u'", "w |u'|", "|w| u'"), "coefficients": (0.8, -0.05, -0.02)}
DUHEM = {"terms": ("u'", "w |u'|", "u |u'|", "w", "u^2"), "coefficients": (0.4, -0.06, 0.03, -0.9, 0.004)}
LEARNED: dict[str, Any] = {}
EXAMPLES = [LEARNED, BOUC_WEN, DUHEM]
voltage = st.floats(-50.0, 50.0)


def swapped(block_id: str, **parameters: Any) -> Model:
    kept = tuple(s for s in PAPER.blocks if not BLOCKS[s.id].transducer)
    return replace(PAPER, blocks=(*kept, BlockSettings(block_id, BLOCKS[block_id].parameters(**parameters))))


def run(model: Model, voltages: np.ndarray, step_s: float, parts: int = 1) -> np.ndarray:
    plant = Plant(model)
    state = plant.initial()
    readings = []
    for k, volts in enumerate(voltages):
        reading = 0.0
        for part in range(parts):
            state, reading, _ = plant.step(state, float(volts), (k + part / parts) * step_s, step_s / parts)
        readings.append(reading)
    return np.array(readings)


def operate(parameters: dict[str, Any], path: list[float]) -> float:
    """The output after a path of voltages, each reached in no time."""
    numbers = sparse_equation.constants(sparse_equation.Parameters(**parameters), None)
    state = sparse_equation.initial(numbers)
    end = 0.0
    for u in path:
        state, _, _, end = sparse_equation.step(state, numbers, 0.0, 1e-9, u, u, u)
    return end


def test_the_defaults_are_equation_30() -> None:
    ours, theirs = run(swapped("sparse_equation"), STAIRS, 1 / 30), run(PAPER, STAIRS, 1 / 30)
    assert np.max(np.abs(ours - theirs)) < 1e-6


def test_bouc_wen_is_a_special_case() -> None:
    closed = swapped("bouc_wen", linear_gain_um_per_V=0.0, alpha_um_per_V=0.8, beta_1_per_V=0.05, gamma_1_per_V=0.02)
    assert np.max(np.abs(run(swapped("sparse_equation", **BOUC_WEN), STAIRS, 0.1) - run(closed, STAIRS, 0.1))) < 1e-6


@given(path=st.lists(voltage, min_size=1, max_size=5))
@example([1.0, -4.086083468906152e-308, -38.0])
def test_polynomials_of_the_voltage_forget_the_path(path: list[float]) -> None:
    parameters = {"terms": ("u'", "u u'", "u^2 u'"), "coefficients": (0.5, 0.02, -3e-4)}
    u = path[-1]
    assert operate(parameters, path) == pytest.approx(0.5 * u + 0.01 * u**2 - 1e-4 * u**3, abs=1e-8)


@given(path=st.lists(voltage, min_size=1, max_size=5), u=voltage, part=st.floats(0.0, 1.0))
def test_a_monotone_stretch_may_be_cut_anywhere(path: list[float], u: float, part: float) -> None:
    between = path[-1] + part * (u - path[-1])
    assert operate(BOUC_WEN, [*path, between, u]) == pytest.approx(operate(BOUC_WEN, [*path, u]), abs=1e-6)


@given(path=st.lists(voltage, min_size=1, max_size=5))
def test_odd_terms_answer_a_mirrored_voltage_with_a_mirrored_displacement(path: list[float]) -> None:
    assert operate(BOUC_WEN, [-u for u in path]) == pytest.approx(-operate(BOUC_WEN, path), abs=1e-9)


@pytest.mark.parametrize("parameters", EXAMPLES)
@pytest.mark.parametrize("supply", [{}, {"time_constant_s": 0.02}])
def test_halving_the_step_changes_nothing(parameters: dict[str, Any], supply: dict[str, float]) -> None:
    model = swapped("sparse_equation", **parameters).with_block("source_resistance", **supply)
    for step_s in (1 / 30, 0.25):
        assert np.max(np.abs(run(model, STAIRS, step_s) - run(model, STAIRS, step_s, parts=2))) < 1e-3


@pytest.mark.parametrize("parameters", [BOUC_WEN, DUHEM])
def test_against_solve_ivp_on_a_smooth_voltage(parameters: dict[str, Any]) -> None:
    terms = [powers_of(term) for term in parameters["terms"]]

    def slope(t: float, w: np.ndarray) -> list[float]:
        u, rate = 20.0 * math.sin(t) + 8.0 * math.sin(2.7 * t), 20.0 * math.cos(t) + 21.6 * math.cos(2.7 * t)
        factors = (1.0, rate, abs(rate))
        return [
            sum(
                c * w[0] ** p.w * abs(w[0]) ** p.magnitude * u**p.u * abs(u) ** p.voltage_magnitude * factors[p.rate]
                for c, p in zip(parameters["coefficients"], terms, strict=True)
            )
        ]

    t = np.linspace(0.0, 6.0, 61)
    exact = solve_ivp(slope, (0.0, 6.0), [0.0], "DOP853", t_eval=t, rtol=1e-10, atol=1e-10, max_step=0.005).y[0]
    fine = np.linspace(0.0, 6.0, 60 * 400 + 1)
    drive = Drive(t, fine, 20.0 * np.sin(fine) + 8.0 * np.sin(2.7 * fine), linear=True)
    model = Model("alone", None, (BlockSettings("sparse_equation", sparse_equation.Parameters(**parameters)),))
    assert np.max(np.abs(Simulator(drive).run(model).reading_um - exact)) < 1e-5


def test_compiled_and_plain_agree() -> None:
    model = swapped("sparse_equation", **DUHEM)
    t = np.linspace(0.0, 0.05 * len(STAIRS), len(STAIRS) + 1)
    compiled = Simulator(Drive.of_rows(t, np.append(STAIRS, 0.0))).run(model).reading_um
    assert np.max(np.abs(compiled[1:] - run(model, STAIRS, 0.05))) < 1e-9


def test_terms_are_read() -> None:
    assert powers_of("w |w|") == Powers(1, 1, 0, 0, 0)
    assert powers_of("u^2 u'") == Powers(0, 0, 2, 0, 1)
    assert powers_of("w^3 |u| |u'|") == Powers(3, 0, 0, 1, 2)


@pytest.mark.parametrize(
    ("term", "says"),
    [("", "zero at rest"), ("v", "'v'"), ("u' |u'|", "once at most"), ("u'^2", "once at most"), ("w^0", "w\\^0"),
     ("w^10", "w\\^10"), ("w^9 w", "up to 9")],
)  # fmt: skip
def test_a_term_that_cannot_be_is_refused(term: str, says: str) -> None:
    with pytest.raises(ModelError, match=says):
        sparse_equation.Parameters(terms=(term,), coefficients=(1.0,))


@pytest.mark.parametrize(
    ("terms", "coefficients", "says"),
    [(("w",), (1.0, 2.0), "same number"), ((), (), "list of terms"), (("w", "|w| w^0"), (1.0, 1.0), "w\\^0"),
     (("w u", "u w"), (1.0, 1.0), "each term once"), ((3.0,), (1.0,), "3.0"), (("w",), (math.nan,), "nan")],
)  # fmt: skip
def test_parameters_that_cannot_be_are_refused(terms: Any, coefficients: Any, says: str) -> None:
    with pytest.raises(ModelError, match=says):
        sparse_equation.Parameters(terms=terms, coefficients=coefficients)


def test_a_model_file_carries_the_equation() -> None:
    from bender_plant.model import model_from_table

    model = swapped("sparse_equation", **DUHEM)
    assert model_from_table(model.to_table()) == model
    assert (
        model.with_values({"sparse_equation.coefficients[2]": -0.07}).values()["sparse_equation.coefficients[2]"]
        == -0.07
    )


def test_an_equation_that_runs_away_is_an_error() -> None:
    model = swapped("sparse_equation", terms=("w^2", "u"), coefficients=(1.0, 1.0))
    with pytest.raises(ArithmeticError):
        run(model, np.full(50, 20.0), 0.1)
