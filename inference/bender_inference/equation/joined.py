"""A sparse equation joins the corrected model where it predicts held-out blocks better than any named effect.

It stays what it is, an equation without a name: it joins no hypothesis of the search and changes no verdict. Its
numbers are fitted again in the model, together with those of the effects; it acts within what the records covered.
"""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bender_effects.form import Form, Free, Values
from bender_inference.equation.lead import Lead
from bender_inference.equation.lead_terms import Term
from bender_inference.fitting.hypothesis import Hypothesis, Part
from bender_inference.fitting.output_error import fit, judge
from bender_inference.records.observations import Array
from bender_inference.search.transfer import transfer_square
from bender_plant.blocks import residual_equation
from bender_plant.blocks.residual_equation import GIVES
from bender_plant.model import Model

if TYPE_CHECKING:
    from bender_inference.search.result import SearchResult

FARTHEST = 1e12


def with_equation(search: "SearchResult", lead: Lead) -> "SearchResult | None":
    """Return the result with the equation of a lead beside the best hypothesis, None where it predicts no better.

    No better is: by no more than the luckiest of many equations would by chance; or not where neither was fitted, at
    the end of the records and at the largest commands.
    """
    best, x = search.best, lead.equation
    if x is None or best.calibration.gain == 0.0:
        return None
    free = _form(search, lead, FARTHEST)
    start = tuple(_in_model(c, t, best.calibration.gain) for c, t in zip(x.coefficients, x.terms, strict=True))
    unbound = fit(search.problem, replace(best.hypothesis, equation=Part(free, start)))
    if unbound is None or unbound.hypothesis.equation is None:
        return None
    largest_residual_um = max(
        float(np.max(np.abs(one - other)))
        for one, other in zip(_tips_um(search, unbound.hypothesis), _tips_um(search, best.hypothesis), strict=True)
    )
    bound = Part(_form(search, lead, largest_residual_um), unbound.hypothesis.equation.values)
    fitted = judge(search.problem, replace(unbound.hypothesis, equation=bound))
    if fitted is None or not search.rules.gains(search.archive, fitted, best):
        return None
    if transfer_square(search.problem, fitted) >= transfer_square(search.problem, best):
        return None
    return replace(search, found=replace(search.found, best=fitted))


def _in_model(coefficient: float, term: Term, gain: float) -> float:
    """Return a coefficient for a residual in units of the model, which the gain of the reading multiplies."""
    return coefficient if term.r else coefficient / gain


def _form(search: "SearchResult", lead: Lead, largest_residual_um: float) -> Form:
    """Return the form whose numbers are the coefficients of an equation, within what the records covered."""
    x = lead.equation
    assert x is not None
    terms = tuple(written(t) for t in x.terms)
    gain = search.best.calibration.gain
    tips = _tips_um(search, search.best.hypothesis)
    volts = [y.drive.voltage_V for y in search.problem.observations]

    def apply(model: Model, values: Values) -> Model:
        return model.with_block(
            residual_equation.ID,
            terms=terms,
            coefficients=tuple(values),
            gives=GIVES[x.per_second],
            lowest_voltage_V=min(0.0, *(float(y.min()) for y in volts)),
            highest_voltage_V=max(0.0, *(float(y.max()) for y in volts)),
            lowest_displacement_um=min(0.0, *(float(y.min()) for y in tips)),
            highest_displacement_um=max(0.0, *(float(y.max()) for y in tips)),
            largest_residual_um=largest_residual_um,
        )

    sizes = (_in_model(c, t, gain) for c, t in zip(x.coefficients, x.terms, strict=True))
    free = tuple(
        Free(f"coefficients[{k}]", -FARTHEST, FARTHEST, False, (c,), abs(c) or 1.0) for k, c in enumerate(sizes, 1)
    )
    return Form(residual_equation.ID, " + ".join(terms), free, apply)


def _tips_um(search: "SearchResult", hypothesis: Hypothesis) -> list[Array]:
    """Return the simulated displacement (n,) of every record."""
    problem = search.problem
    return [x.run(hypothesis.model(problem.base, k)).tip_um for k, x in enumerate(problem.fine)]


def written(term: Term) -> str:
    """Return a term as the block writes it: `r v^2 |y'|`."""
    factors = ["|r|" if term.magnitude == "r" else "r"] if term.r else []
    for name, power in (("v", term.v), ("y", term.y)):
        factors += [name if power == 1 else f"{name}^{power}"] if power else []
        factors += [f"|{name}|"] if term.magnitude == name else []
    if term.rate:
        factors.append(f"|{term.rate[1]}'|" if term.rate[0] == "|" else f"{term.rate}'")
    return " ".join(factors) or "1"
