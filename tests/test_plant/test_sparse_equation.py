"""Equations of a sum of terms, learned or of a residual: special cases, an independent solution, laws."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from plant_runs import run_plant
from scipy.integrate import solve_ivp

from bender_compiled.simulation import Drive, Simulator
from bender_plant.blocks import BLOCKS, sparse_equation
from bender_plant.blocks.sparse_equation import Powers, powers_of
from bender_plant.model import BlockSettings, Model, load_model, model_from_table
from bender_plant.parameter import ModelError

PAPER = load_model("paper")
STAIRS = np.array([20.0, 20.0, 45.0, 10.0, 10.0, 30.0, 0.0, 50.0, 5.0, -30.0, -30.0, 49.0])
BOUC_WEN = {"terms": ("u'", "w |u'|", "|w| u'"), "coefficients": (0.8, -0.05, -0.02)}
DUHEM = {"terms": ("u'", "w |u'|", "u |u'|", "w", "u^2"), "coefficients": (0.4, -0.06, 0.03, -0.9, 0.004)}
voltage = st.floats(-50.0, 50.0)


def swapped(block_id: str, **parameters: Any) -> Model:
    kept = tuple(s for s in PAPER.blocks if not BLOCKS[s.id].transducer)
    return replace(PAPER, blocks=(*kept, BlockSettings(block_id, BLOCKS[block_id].parameters(**parameters))))


def operate(parameters: dict[str, Any], path: list[float]) -> float:
    """The output after a path of voltages, each reached in no time."""
    numbers = sparse_equation.constants(sparse_equation.Parameters(**parameters), None)
    state = sparse_equation.initial(numbers)
    end = 0.0
    for u in path:
        state, _, _, end = sparse_equation.step(state, numbers, 0.0, 1e-9, u, u, u)
    return end


def test_the_defaults_are_equation_30() -> None:
    ours, theirs = run_plant(swapped("sparse_equation"), STAIRS, 1 / 30), run_plant(PAPER, STAIRS, 1 / 30)
    assert np.max(np.abs(ours - theirs)) < 1e-6


@given(path=st.lists(voltage, min_size=1, max_size=5))
@example([1.0, -4.086083468906152e-308, -38.0])
def test_polynomials_of_the_voltage_forget_the_path(path: list[float]) -> None:
    parameters = {"terms": ("u'", "u u'", "u^2 u'"), "coefficients": (0.5, 0.02, -3e-4)}
    u = path[-1]
    assert operate(parameters, path) == pytest.approx(0.5 * u + 0.01 * u**2 - 1e-4 * u**3, abs=1e-8)


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


def test_terms_are_read() -> None:
    assert powers_of("w |w|") == Powers(1, 1, 0, 0, 0)
    assert powers_of("u^2 u'") == Powers(0, 0, 2, 0, 1)
    assert powers_of("w^3 |u| |u'|") == Powers(3, 0, 0, 1, 2)


@pytest.mark.parametrize(
    ("terms", "coefficients", "says"),
    [*(((term,), (1.0,), says) for term, says in (
        ("", "zero at rest"), ("v", "'v'"), ("u' |u'|", "once at most"), ("u'^2", "once at most"), ("w^0", "w\\^0"),
        ("w^10", "w\\^10"), ("w^9 w", "up to 9"))),
     (("w",), (1.0, 2.0), "same number"), ((), (), "list of terms"), (("w", "|w| w^0"), (1.0, 1.0), "w\\^0"),
     (("w u", "u w"), (1.0, 1.0), "each term once"), ((3.0,), (1.0,), "3.0"), (("w",), (math.nan,), "nan")],
)  # fmt: skip
def test_terms_and_coefficients_that_cannot_be_are_refused(terms: Any, coefficients: Any, says: str) -> None:
    with pytest.raises(ModelError, match=says):
        sparse_equation.Parameters(terms=terms, coefficients=coefficients)


def test_a_model_file_carries_the_equation() -> None:
    model = swapped("sparse_equation", **DUHEM)
    assert model_from_table(model.to_table()) == model
    name = "sparse_equation.coefficients[2]"
    assert model.with_values({name: -0.07}).values()[name] == -0.07


def test_an_equation_that_runs_away_is_an_error() -> None:
    model = swapped("sparse_equation", terms=("w^2", "u"), coefficients=(1.0, 1.0))
    with pytest.raises(ArithmeticError):
        run_plant(model, np.full(50, 20.0), 0.1)


signal = st.floats(-20.0, 20.0)
positive = st.floats(0.5, 20.0)


@given(y_um=st.tuples(signal, signal, signal), h=st.floats(1e-3, 1.0), weight=st.floats(-0.1, 0.1))
def test_a_term_with_the_rate_of_the_displacement_has_the_slope_of_the_parabola(
    y_um: tuple[float, float, float], h: float, weight: float
) -> None:
    block = BLOCKS["residual_equation"]
    numbers = block.constants(block.parameters(gives="value", terms=("y'",), coefficients=(weight,)), None)
    assert block.step is not None
    _, *after = block.step(block.initial(numbers), numbers, 0.0, h, *y_um, 0.0, 0.0, 0.0)
    # y = a + b x + c x^2 through the three values, over x = t / h
    a, middle, end = y_um
    c = 2.0 * (a + end - 2.0 * middle)
    b = end - a - c
    slopes = [(b + 2.0 * c * x) / h for x in (0.0, 0.5, 1.0)]
    assert [x - y for x, y in zip(after, y_um, strict=True)] == pytest.approx([weight * x for x in slopes], abs=1e-6)


RATE_TERMS: dict[str, Callable[[float, float, float, float], float]] = {
    "1": lambda v, y, dv, dy: 1.0,
    "v": lambda v, y, dv, dy: v,
    "|v|": lambda v, y, dv, dy: abs(v),
    "v y": lambda v, y, dv, dy: v * y,
    "v'": lambda v, y, dv, dy: dv,
    "v |v'|": lambda v, y, dv, dy: v * abs(dv),
    "y v'": lambda v, y, dv, dy: y * dv,
    "v^2 y'": lambda v, y, dv, dy: v * v * dy,
    "|y'|": lambda v, y, dv, dy: abs(dy),
}


@pytest.mark.parametrize("term", RATE_TERMS)
@given(
    last=st.tuples(positive, positive),
    ends=st.tuples(positive, positive, positive, positive),
    h=st.floats(0.01, 0.1),
)
def test_a_rate_is_integrated_over_a_jump_and_along_the_sub_step(
    term: str, last: tuple[float, float], ends: tuple[float, float, float, float], h: float
) -> None:
    """Oracle: the differential equation, first over the jump, in which no time passes, then over straight signals."""
    v0, y0, v1, y1 = ends
    # with anything but a constant, a decay is of second order in the sub-step
    decay_per_s = 0.8 if term == "1" else 0.0
    block = BLOCKS["residual_equation"]
    settings = block.parameters(gives="rate", terms=(term, "r"), coefficients=(0.1, -decay_per_s))
    numbers = block.constants(settings, None)
    assert block.step is not None
    y, v = (y0, 0.5 * (y0 + y1), y1), (v0, 0.5 * (v0 + v1), v1)
    assert block.corner is None or block.corner((0.0, *last), numbers, h, *y, *v) == 1.0
    (end, *_), *after = block.step((0.3, *last), numbers, 0.0, h, *y, *v)

    def integral(r: float, begin: tuple[float, float], end: tuple[float, float], over_s: float, to_s: float) -> float:
        """Without a duration only terms with a rate go on, here once from 0 to 1."""
        dv, dy = ((y - x) / (over_s or 1.0) for x, y in zip(begin, end, strict=True))

        def slope(t: float, r: np.ndarray) -> np.ndarray:
            here = 0.1 * RATE_TERMS[term](begin[0] + dv * t, begin[1] + dy * t, dv, dy)
            return np.array([(here if over_s or "'" in term else 0.0) - (decay_per_s * r[0] if over_s else 0.0)])

        return float(solve_ivp(slope, (0.0, to_s), [r], rtol=1e-10, atol=1e-10).y[0, -1])

    first = integral(0.3, last, (v0, y0), 0.0, 1.0)
    expected = [first, *(integral(first, (v0, y0), (v1, y1), h, part * h) for part in (0.5, 1.0))]
    assert [*(x - z for x, z in zip(after, y, strict=True)), end] == pytest.approx(
        [*expected, expected[-1]], rel=1e-7, abs=1e-7
    )


@pytest.mark.parametrize(("term", "turns"), [("v'", None), ("|v'|", 0), ("y'", None), ("|y'|", 1)])
@given(places=st.tuples(st.floats(0.1, 0.9), st.floats(0.1, 0.9)))
def test_a_sub_step_ends_where_the_signal_turns_whose_magnitude_of_rate_counts(
    term: str, turns: int | None, places: tuple[float, float]
) -> None:
    block = BLOCKS["residual_equation"]
    numbers = block.constants(block.parameters(gives="rate", terms=(term,), coefficients=(0.1,)), None)
    v, y = ([(x - place) ** 2 for x in (0.0, 0.5, 1.0)] for place in places)
    assert block.corner is not None
    found = block.corner(block.initial(numbers), numbers, 0.1, *y, *v)
    assert found == (1.0 if turns is None else pytest.approx(places[turns]))
