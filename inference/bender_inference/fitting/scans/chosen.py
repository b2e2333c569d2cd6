"""The scan that suits a form: where a fit of one more effect should set out."""

from bender_effects.form import Form
from bender_inference.fitting.fit_problem import FitProblem
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.fitting.journal import current_journal
from bender_inference.fitting.scans.delay import scan_delay
from bender_inference.fitting.scans.hum import scan_hum
from bender_inference.fitting.scans.limit import limits_where_they_promise
from bender_inference.fitting.scans.second_mode import ringing_where_it_promises
from bender_inference.fitting.scans.supply_steps import scan_supply_steps
from bender_inference.fitting.standing import Standing
from bender_inference.fitting.starts import Start, scan


def scan_any(
    problem: FitProblem,
    base: Hypothesis,
    form: Form,
    noise_um: float,
    keep: int = 2,
    beside: Standing | None = None,
) -> list[Start]:
    """Return the most promising starts of a form, by the scan that suits it; `beside` as in `scan`."""
    journal = current_journal()
    if journal is None:
        return _scan_any(problem, base, form, noise_um, keep, beside)
    key = journal.key(problem, base, "scan", form, noise_um, keep, beside is not None)
    told = journal.recall(key)
    if told is not None:
        return [Start(tuple(values), square) for values, square in told]
    found = _scan_any(problem, base, form, noise_um, keep, beside)
    journal.entries[key] = [[list(x.values), x.square] for x in found]
    return found


def _scan_any(
    problem: FitProblem, base: Hypothesis, form: Form, noise_um: float, keep: int, beside: Standing | None
) -> list[Start]:
    if form.scan == "delay":
        return scan_delay(problem, base, form, keep, beside)
    if form.scan == "steps":
        return scan_supply_steps(problem, base, form, noise_um, keep, beside)
    if form.scan == "swing":
        return scan_hum(problem, base, form, keep, beside)
    if form.scan in ("limit above", "limit below"):
        return scan(problem, base, limits_where_they_promise(problem, base, form, beside), keep, beside)
    if form.scan == "ring":
        return scan(problem, base, ringing_where_it_promises(problem, base, form, beside), keep, beside)
    return scan(problem, base, form, keep, beside)
