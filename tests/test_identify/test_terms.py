import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_identify.regression.terms import equation, evaluated, library, scale_of, unit_of
from bender_identify.settings import LIBRARIES

W, U, RATE = np.array([-2.0, 3.0]), np.array([4.0, -5.0]), np.array([-6.0, 7.0])


@pytest.mark.parametrize(
    ("term", "values", "unit"),
    [
        ("w", [-2.0, 3.0], "1/s"),
        ("u", [4.0, -5.0], "um/(V s)"),
        ("w |w|", [-4.0, 9.0], "1/(um s)"),
        ("u'", [-6.0, 7.0], "um/V"),
        ("w |u'|", [-12.0, 21.0], "1/V"),
        ("|w| u'", [-12.0, 21.0], "1/V"),
        ("u^2 u'", [-96.0, 175.0], "um/V^3"),
        ("w^2 |u|", [16.0, 45.0], "1/(um V s)"),
    ],
)
def test_terms_have_values_and_units(term: str, values: list[float], unit: str) -> None:
    assert evaluated(term, W, U, RATE).tolist() == values
    assert unit_of(term) == unit


@given(st.permutations(LIBRARIES["combined"]))
def test_the_library_follows_a_permutation_of_its_terms(terms: list[str]) -> None:
    columns = library(terms, W, U, RATE)
    for k, term in enumerate(terms):
        assert columns[:, k].tolist() == evaluated(term, W, U, RATE).tolist()


@given(w=st.floats(0.1, 10.0), u=st.floats(0.1, 10.0), t=st.floats(0.1, 10.0))
def test_a_scaled_coefficient_is_one_where_the_term_alone_makes_the_rate(w: float, u: float, t: float) -> None:
    for term in LIBRARIES["combined"]:
        size = evaluated(term, np.array([w]), np.array([u]), np.array([u / t]))[0]
        assert scale_of(term, w, u, t) * size == pytest.approx(w / t)


def test_an_equation_is_one_readable_line() -> None:
    line = equation(("w", "u'", "w |w|"), (-0.48, 0.818, -0.124))
    assert line == "w' = -0.48 w + 0.818 u' - 0.124 w |w|"
