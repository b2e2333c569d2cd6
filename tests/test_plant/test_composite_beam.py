"""The composite beam against hand numbers, a finite-element beam and the laws of beams."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from scipy.linalg import eigh
from scipy.optimize import brentq

from bender_plant.composite_beam import (
    CompositeBeam,
    Layer,
    flexural_rigidity_N_m2,
    moment_coefficient_N_m_per_V,
    natural_frequency_Hz,
    neutral_axis_m,
    static_gain_um_per_V,
    static_share,
    wave_number,
)
from bender_plant.model import load_model
from bender_plant.parameter import ModelError

POLYIMIDE = Layer("polyimide", 50e-6, 2.5e9, 1420.0)
PVDF = Layer("PVDF", 28e-6, 2.7e9, 1780.0, 23e-12)
TABLE_1 = CompositeBeam((POLYIMIDE, PVDF))
PAPER_AXIS = replace(TABLE_1, neutral_axis="paper")


def finite_elements(beam: CompositeBeam, count: int = 40) -> tuple[float, float]:
    """First frequency (Hz) and static gain (um/V) of a coupled extension-bending beam.

    Each node has an axial, a transverse and a rotational freedom; stiffness and piezoelectric load are integrated
    through the thickness from the middle of the stack, so the neutral axis is never asked for.
    """
    A, B, D, rho, N, M = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    bottom = -0.5 * sum(layer.thickness_m for layer in beam.layers)
    for layer in beam.layers:
        points, weights = np.polynomial.legendre.leggauss(4)
        z = bottom + layer.thickness_m * (points + 1.0) / 2.0
        w = layer.thickness_m * weights / 2.0 * beam.width_m
        A += layer.young_modulus_Pa * w.sum()
        B += layer.young_modulus_Pa * (w @ z)
        D += layer.young_modulus_Pa * (w @ z**2)
        rho += layer.density_kg_per_m3 * w.sum()
        stress = layer.young_modulus_Pa * layer.piezoelectric_coefficient_C_per_N / layer.thickness_m
        N += stress * w.sum()
        M += stress * (w @ z)
        bottom += layer.thickness_m
    size = beam.length_m / count
    K, mass, load = (np.zeros((3 * count + 3,) * 2), np.zeros((3 * count + 3,) * 2), np.zeros(3 * count + 3))
    points, weights = np.polynomial.legendre.leggauss(5)
    for element in range(count):
        k = slice(3 * element, 3 * element + 6)
        for s, weight in zip((points + 1.0) / 2.0, weights * size / 2.0, strict=True):
            strain = np.array([-1, 0, 0, 1, 0, 0]) / size
            curvature = np.array([0, 12 * s - 6, size * (6 * s - 4), 0, 6 - 12 * s, size * (6 * s - 2)]) / size**2
            shape = np.array(
                [0, 1 - 3 * s**2 + 2 * s**3, size * (s - 2 * s**2 + s**3), 0, 3 * s**2 - 2 * s**3, size * (s**3 - s**2)]
            )
            K[k, k] += weight * (
                A * np.outer(strain, strain)
                - B * (np.outer(strain, curvature) + np.outer(curvature, strain))
                + D * np.outer(curvature, curvature)
            )
            mass[k, k] += weight * rho * np.outer(shape, shape)
            load[k] += weight * (N * strain - M * curvature)
    K, mass, load = K[3:, 3:], mass[3:, 3:], load[3:]
    axial = np.arange(0, 3 * count, 3)
    bending = np.setdiff1d(np.arange(3 * count), axial)
    condense = np.linalg.solve(K[np.ix_(axial, axial)], K[np.ix_(axial, bending)])
    stiffness = K[np.ix_(bending, bending)] - K[np.ix_(bending, axial)] @ condense
    force = load[bending] - condense.T @ load[axial]
    values = eigh(stiffness, mass[np.ix_(bending, bending)], eigvals_only=True)
    return math.sqrt(values[0]) / (2 * math.pi), -np.linalg.solve(stiffness, force)[-2] * 1e6


def test_hand_numbers_of_table_1() -> None:
    assert neutral_axis_m(TABLE_1) == pytest.approx(25e-6 + 14.70e-6, abs=0.01e-6)
    assert flexural_rigidity_N_m2(TABLE_1) == pytest.approx(1.0263e-6, rel=1e-4)
    assert moment_coefficient_N_m_per_V(TABLE_1) == pytest.approx(1.509e-8, rel=2e-4)
    frequencies = [natural_frequency_Hz(TABLE_1, mode) for mode in (1, 2, 3, 4)]
    assert frequencies == pytest.approx([104.37, 654.1, 1831.5, 3589.0], rel=5e-5)
    assert static_gain_um_per_V(TABLE_1) == pytest.approx(1.1488, abs=5e-5)
    assert [static_share(mode) for mode in (1, 2, 3, 4)] == pytest.approx([0.8908, 0.0788, 0.0165, 0.0060], abs=5e-5)


def test_paper_axis_gives_the_numbers_of_the_paper() -> None:
    assert moment_coefficient_N_m_per_V(PAPER_AXIS) == pytest.approx(0.5 * 2.7e9 * 23e-12 * 0.01 * 78e-6, rel=1e-12)
    assert natural_frequency_Hz(PAPER_AXIS, 1) == pytest.approx(124.47, abs=0.005)
    assert static_gain_um_per_V(PAPER_AXIS) == pytest.approx(1.2962, abs=5e-5)


layer = st.builds(
    Layer,
    st.just("any"),
    st.floats(2e-5, 1e-4),
    st.floats(1e9, 1e11),
    st.floats(800.0, 8000.0),
    st.floats(-1e-10, 1e-10),
)
layers = st.lists(layer, min_size=1, max_size=5).map(tuple)
stacks = st.builds(CompositeBeam, layers, st.floats(5e-3, 0.05), st.floats(1e-3, 0.05))


@given(stacks)
@example(TABLE_1)
@example(CompositeBeam((PVDF, POLYIMIDE)))
def test_any_stack_of_layers_against_finite_elements(beam: CompositeBeam) -> None:
    """A single layer, or layers that pull alike on either side of the axis, do not bend."""
    assume(abs(static_gain_um_per_V(beam)) > 1e-3)
    first_Hz, gain = finite_elements(beam)
    assert natural_frequency_Hz(beam, 1) == pytest.approx(first_Hz, rel=1e-3)
    assert static_gain_um_per_V(beam) == pytest.approx(gain, rel=1e-6)


def test_wave_numbers_are_roots() -> None:
    for mode in (1, 2, 3, 7):
        around = (mode - 0.5) * math.pi
        root = brentq(lambda b: 1.0 + math.cos(b) * math.cosh(b), around - 0.4, around + 0.4, xtol=1e-14)
        assert wave_number(mode) == pytest.approx(root, rel=1e-12)


def test_static_shares_sum_to_one() -> None:
    assert sum(static_share(mode) for mode in range(1, 2001)) == pytest.approx(1.0, abs=1e-6)


def test_the_built_in_models_carry_table_1() -> None:
    for name in ("paper", "beam", "bench"):
        assert load_model(name).beam == TABLE_1


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: replace(PVDF, thickness_m=-1e-6), "beam.layer\\[PVDF\\].thickness_m: found -1e-06, expected"),
        (lambda: replace(PVDF, young_modulus_Pa=math.nan), "young_modulus_Pa: found nan, expected a finite number"),
        (lambda: replace(PVDF, density_kg_per_m3="heavy"), "density_kg_per_m3: found 'heavy'"),
        (lambda: replace(TABLE_1, neutral_axis="middle"), "neutral_axis: found 'middle'"),
        (lambda: CompositeBeam(()), "no layer"),
        (lambda: CompositeBeam((PVDF,), neutral_axis="paper"), "passive layer"),
    ],
)
def test_impossible_layers_and_beams_are_refused(make: Callable[[], object], words: str) -> None:
    with pytest.raises(ModelError, match=words):
        make()
