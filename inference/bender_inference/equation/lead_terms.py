"""Candidate terms of a sparse equation for the residual: powers of it, of the acting voltage, of the tip, and rates.

r: residual, um; v: acting voltage, V; y: simulated tip, um; dv, dy: their changes over dt, s.
"""

from dataclasses import dataclass

import numpy as np

from bender_inference.records.observations import Array
from bender_report.wording import figure

_POWERS = {1: "", 2: "²", 3: "³"}


@dataclass(frozen=True, slots=True)
class Term:
    """One candidate.

    Attributes:
        r: the power of the residual, 0 or 1.
        v: the power of the voltage.
        y: the power of the simulated tip.
        rate: "" or what it runs with: "v", "|v|", "y", "|y|".
        magnitude: one of the factors r, v or y as its magnitude: "r" (r = 1), "v" or "y" (one power more); "" for none.
    """

    r: int = 0
    v: int = 0
    y: int = 0
    rate: str = ""
    magnitude: str = ""

    @property
    def name(self) -> str:
        """The term as it is read: `r v |dv/dt|`, `1`."""
        factors = ["|r|" if self.magnitude == "r" else "r"] if self.r else []
        for name, power in (("v", self.v), ("y", self.y)):
            factors += [f"{name}{_POWERS[power]}"] if power else []
            factors += [f"|{name}|"] if self.magnitude == name else []
        if self.rate:
            factors.append(f"|d{self.rate[1]}/dt|" if self.rate[0] == "|" else f"d{self.rate}/dt")
        return " ".join(factors) or "1"

    def of_tip_and_voltage(self, v: Array, y: Array) -> Array:
        """Return the factors of voltage and tip."""
        found = v**self.v * y**self.y
        if self.magnitude == "v":
            return found * np.abs(v)
        return found * np.abs(y) if self.magnitude == "y" else found

    def unit(self, per_second: bool) -> str:
        """Return the unit of its coefficient in an equation for r (um), or for dr/dt (um/s)."""
        um = 1 - self.r - self.y - (self.magnitude == "y") - (self.rate.strip("|") == "y")
        V = -self.v - (self.magnitude == "v") - (self.rate.strip("|") == "v")
        s = bool(self.rate) - per_second
        powers = {"um": um, "V": V, "s": s}
        above = [_power(unit, n) for unit, n in powers.items() if n > 0]
        below = [_power(unit, -n) for unit, n in powers.items() if n < 0]
        over = f"({' '.join(below)})" if len(below) > 1 else "".join(below)
        return f"{' '.join(above) or '1'}{'/' if below else ''}{over}"


def _power(unit: str, n: int) -> str:
    return unit if n == 1 else f"{unit}{n}"


RELAXING = (
    Term(r=1), Term(), Term(v=1), Term(v=2), Term(v=1, magnitude="v"), Term(y=1), Term(y=2),
    Term(r=1, v=1), Term(r=1, v=2),
)  # fmt: skip
"""Terms of dr/dt that run with time."""

RATE_INDEPENDENT = (
    Term(rate="v"), Term(v=1, rate="v"), Term(rate="v", magnitude="v"), Term(v=2, rate="v"), Term(rate="|v|"),
    Term(v=1, rate="|v|"), Term(r=1, rate="|v|"), Term(r=1, rate="v", magnitude="r"),
    Term(rate="y"), Term(y=1, rate="y"), Term(y=2, rate="y"),
)  # fmt: skip
"""Terms of dr/dt that run with voltage or tip, however fast; all that an untimed record can tell."""

AT_ONCE = (
    Term(v=1), Term(v=2), Term(v=1, magnitude="v"), Term(v=3), Term(y=2), Term(y=1, magnitude="y"), Term(y=3),
    Term(v=1, y=1),
)  # fmt: skip
"""Terms of r itself."""

AT_ONCE_TIMED = (Term(rate="y"), Term(rate="|y|"), Term(y=1, rate="y"), Term(v=1, rate="y"))
"""Terms of r itself that need true times."""


def equation(terms: tuple[Term, ...], coefficients: tuple[float, ...], per_second: bool) -> str:
    """Return the equation as it is read, coefficients with three digits."""
    parts = []
    for k, (term, value) in enumerate(zip(terms, coefficients, strict=True)):
        sign = ("−" if value < 0.0 else "") if k == 0 else (" − " if value < 0.0 else " + ")
        parts.append(f"{sign}{figure(abs(value))}{'' if term.name == '1' else f' {term.name}'}")
    return f"{'dr/dt' if per_second else 'r'} = {''.join(parts)}"
