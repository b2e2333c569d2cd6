"""Effects of many numbers are told in the figures that people compare."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from bender_discrepancy.report.loop_and_creep import (
    creep_per_decade,
    figures_of,
)
from bender_discrepancy.report.loop_figures import ROWS_OF_A_BRANCH, loop_of
from bender_plant.model import Model, model_from_table
from bender_report.number import Number


def _model(gain: float = 1.0, sensitivity_um_per_V: float = 0.5, **hysteresis: Any) -> Model:
    """A linear transducer with hysteresis beside it, and a calibration."""
    return model_from_table(
        {
            "format": 1,
            "name": "loop",
            "block": [
                {"id": "linear_transduction", "sensitivity_um_per_V": sensitivity_um_per_V},
                {"id": "calibration", "gain": gain},
            ],
        }
    ).with_block("rate_independent_hysteresis", **hysteresis)


@settings(max_examples=30)
@given(
    plays=st.lists(st.tuples(st.floats(0.5, 9.0), st.floats(0.01, 0.2)), min_size=1, max_size=6),
    linear=st.floats(-0.5, 0.5),
    gain=st.floats(0.2, 3.0),
)
def test_plays_have_the_width_and_the_remanence_of_the_textbook(
    plays: list[tuple[float, float]], linear: float, gain: float
) -> None:
    thresholds, weights = zip(*plays, strict=True)
    # the part that returns the way it came widens nothing
    known = _model(gain, thresholds_V=thresholds, weights_um_per_V=weights, reversible_linear_um_per_V=linear)
    loop = loop_of(known, 0.0, 40.0)
    one_sided = gain * sum(r * p for r, p in plays)
    assert loop.width_um == pytest.approx(2.0 * one_sided, rel=1e-6)
    assert loop.remanence_um == pytest.approx(one_sided, rel=1e-6)


def test_bouc_wen_agrees_with_its_equation() -> None:
    alpha, beta, gamma, top_V = 0.1, 0.2, 0.05, 30.0
    known = _model(form="bouc_wen", alpha_um_per_V=alpha, beta_1_per_V=beta, gamma_1_per_V=gamma)

    def branch(z: float, sign: float) -> float:
        def slope(_: float, z: np.ndarray) -> np.ndarray:
            return sign * alpha - beta * z - gamma * sign * np.abs(z)

        return float(solve_ivp(slope, (0.0, top_V), [z], rtol=1e-9, atol=1e-12).y[0, -1])

    assert loop_of(known, 0.0, top_V).remanence_um == pytest.approx(abs(branch(branch(0.0, 1.0), -1.0)), rel=1e-3)


@pytest.mark.slow
@settings(max_examples=30)
@given(
    half_width=st.floats(1.0, 6.0), part=st.floats(0.2, 0.8), gain=st.floats(-20.0, 20.0).filter(lambda x: abs(x) > 0.1)
)
def test_a_slider_behind_a_gap_has_a_free_stretch_as_wide_as_the_gap(
    half_width: float, part: float, gain: float
) -> None:
    # what the slider passes on is v less its play; the gap is taken out of it
    slipping = {"thresholds_V": (half_width,), "weights_um_per_V": (-1.0,), "reversible_linear_um_per_V": -1.0}
    gap = 2.0 * part * half_width
    known = _model(gain, 1.0, **slipping).with_block("output_dead_zone", width_um=gap)
    free = loop_of(known, -20.0, 20.0).free
    assert free is not None
    row_V = 40.0 / (ROWS_OF_A_BRANCH - 1)
    assert free.length_V == pytest.approx(gap, abs=2.0 * row_V)
    assert free.after_V == pytest.approx(half_width - 0.5 * gap, abs=2.0 * row_V)


@pytest.mark.slow
@settings(max_examples=30)
@given(st.lists(st.tuples(st.floats(0.5, 9.0), st.floats(0.01, 0.2)), min_size=1, max_size=6))
def test_what_follows_ever_more_closely_after_a_reversal_has_no_free_stretch(plays: list[tuple[float, float]]) -> None:
    thresholds, weights = zip(*plays, strict=True)
    assert loop_of(_model(thresholds_V=thresholds, weights_um_per_V=weights), -40.0, 40.0).free is None


def _numbers(plays: list[tuple[float, float]]) -> tuple[Number, ...]:
    return (
        *(Number(f"thresholds_V[{k + 1}]", r, "V") for k, (r, _) in enumerate(plays)),
        *(Number(f"weights_um_per_V[{k + 1}]", p, "um/V", p) for k, (_, p) in enumerate(plays)),
    )


def test_programs_get_the_figures_that_people_get() -> None:
    plays = _numbers([(1.0, 0.05), (2.0, 0.05), (4.0, 0.05), (8.0, 0.05)])
    told = figures_of("rate_independent_hysteresis", "plays", plays, (0.0, 50.0), _model())
    assert [(x["name"], x["unit"]) for x in told] == [("loop_width", "um"), ("remanence", "um")]
    assert [x["value"] for x in told] == pytest.approx([1.5, 0.75])
    assert all(x["between"] == [0.0, 50.0] and x["between_unit"] == "V" for x in told)
    slipping = (*_numbers([(5.0, -1.0)]), Number("reversible_linear_um_per_V", -1.0, "um/V", 0.1))
    behind = _model(2.0, 1.0).with_block("output_dead_zone", width_um=4.0)
    free = figures_of("rate_independent_hysteresis", "plays", slipping, (-20.0, 20.0), behind)[2:]
    assert [x["name"] for x in free] == ["follows_for", "stands_still_for"]
    assert [x["value"] for x in free] == pytest.approx([3.0, 4.0], abs=0.1)
    pairs = [(0.04, 3.0), (0.01, 0.2), (0.03, 5.0)]
    creep = (
        *(Number(f"gains[{k + 1}]", g, "1", 0.001) for k, (g, _) in enumerate(pairs)),
        *(Number(f"time_constants_s[{k + 1}]", t, "s") for k, (_, t) in enumerate(pairs)),
    )
    decades = figures_of("creep", None, creep, (0.0, 50.0), _model())
    assert [(x["name"], x["between"]) for x in decades] == [
        ("creep_of_decade", [pytest.approx(0.1), pytest.approx(1.0)]),
        ("creep_of_decade", [1.0, 10.0]),
        ("creep_in_all", [pytest.approx(0.1), 10.0]),
    ]
    assert [x["value"] for x in decades] == pytest.approx([0.01, 0.07, 0.08])
    assert figures_of("tip_mass", None, plays, (0.0, 50.0), _model()) == []


def test_creep_is_summed_per_decade_of_its_time_constants() -> None:
    found = creep_per_decade([0.01, 0.02, 0.03, 0.05], [0.1, 0.4, 1.0, 30.0])
    assert [(low, high) for low, high, _ in found] == [(0.1, 1.0), (1.0, 10.0), (10.0, 100.0)]
    assert [total for *_, total in found] == pytest.approx([0.03, 0.03, 0.05])


@given(st.lists(st.tuples(st.floats(-0.2, 0.4), st.floats(1e-3, 1e6)), min_size=1, max_size=12))
def test_no_relaxation_is_lost_in_the_decades(pairs: list[tuple[float, float]]) -> None:
    found = creep_per_decade([x for x, _ in pairs], [x for _, x in pairs])
    assert sum(x for *_, x in found) == pytest.approx(sum(x for x, _ in pairs), abs=1e-12)
    assert all(np.isclose(high, 10.0 * low) for low, high, _ in found)
