"""Terms of the learned equation on arrays, in words, and as a library of PySINDy."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from bender_plant.blocks.sparse_equation import powers_of

Array = NDArray[np.float64]


def evaluated(term: str, w: Array, u: Array, rate: Array) -> Array:
    """Return a term on arrays of equal shape: displacement, voltage, voltage rate."""
    p = powers_of(term)
    factor = (np.ones_like(rate), rate, np.abs(rate))[p.rate]
    return w**p.w * np.abs(w) ** p.magnitude * u**p.u * np.abs(u) ** p.voltage_magnitude * factor


def library(terms: Sequence[str], w: Array, u: Array, rate: Array) -> Array:
    """Return the library (n, number of terms), made by PySINDy of one function for each term."""
    import pysindy

    made = pysindy.CustomLibrary(
        library_functions=[_function(term) for term in terms],
        function_names=[_naming(term) for term in terms],
        interaction_only=True,
    )
    return np.asarray(made.fit_transform(np.column_stack([w, u, rate])))


def _function(term: str) -> Callable[[Array, Array, Array], Array]:
    def function(w: Array, u: Array, rate: Array) -> Array:
        return evaluated(term, w, u, rate)

    return function


def _naming(term: str) -> Callable[[str, str, str], str]:
    def naming(w: str, u: str, rate: str) -> str:
        del w, u, rate
        return term

    return naming


def scale_of(term: str, w_um: float, u_V: float, time_s: float) -> float:
    """Return the coefficient that makes a term as large as the rate w_um / time_s, for |w| = w_um and |u| = u_V."""
    p = powers_of(term)
    size = w_um ** (p.w + p.magnitude) * u_V ** (p.u + p.voltage_magnitude) * (u_V / time_s if p.rate else 1.0)
    return w_um / time_s / size


def unit_of(term: str) -> str:
    """Return the unit of a term's coefficient, in um, V and s."""
    p = powers_of(term)
    powers = {"um": 1 - p.w - p.magnitude, "V": -p.u - p.voltage_magnitude - (p.rate > 0), "s": -(p.rate == 0)}
    above = [_power(unit, n) for unit, n in powers.items() if n > 0]
    below = [_power(unit, -n) for unit, n in powers.items() if n < 0]
    return f"{' '.join(above) or '1'}{'/' if below else ''}{_bracketed(below)}"


def _power(unit: str, n: int) -> str:
    return unit if n == 1 else f"{unit}^{n}"


def _bracketed(below: list[str]) -> str:
    return f"({' '.join(below)})" if len(below) > 1 else "".join(below)


def equation(terms: Sequence[str], coefficients: Sequence[float]) -> str:
    """Return the equation in one line, terms in the order given, coefficients with four digits."""
    if not terms:
        return "w' = 0"
    parts = []
    for k, (term, value) in enumerate(zip(terms, coefficients, strict=True)):
        sign = ("-" if value < 0 else "") if k == 0 else (" - " if value < 0 else " + ")
        parts.append(f"{sign}{abs(value):.4g} {term}")
    return "w' = " + "".join(parts)
