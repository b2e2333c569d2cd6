"""The report page of an identification."""

from collections.abc import Iterator, Sequence

from bender_identify.fitting.candidate import Coefficient
from bender_identify.fitting.identifiability import WEAK
from bender_identify.identification_result import Identification
from bender_identify.report.figures import COLUMNS, table
from bender_report.page import Page, Picture, Section, Table, render
from bender_report.wording import figure, quantity, unit_text

ANY_SLACK = 100.0
"""A coefficient that may move by more than this many times itself may be anything."""


def page(outcome: Identification, picture: bytes, model_name: str) -> str:
    """Return the page as HTML, the picture of the loops inside it."""
    names = ", ".join(x.name for x in outcome.experiments)
    lead = f"The model file {model_name} holds: {outcome.written.candidate.title}."
    return render(Page(f"Hysteresis learned from {names}", lead, (), list(_sections(outcome, picture))))


def _sections(outcome: Identification, picture: bytes) -> Iterator[Section]:
    written, learned = outcome.written.candidate, outcome.rows[0].candidate
    yield Section(f"The written model: {written.title}", formula=_lines(written.equation))
    if learned is not written:
        yield Section("The learned equation beside it", formula=_lines(learned.equation))
    place = next(k for k, row in enumerate(outcome.rows) if row is outcome.written)
    yield Section(
        "What each model buys",
        table=Table(COLUMNS, table(outcome), stressed=frozenset({place})),
        remarks=[
            "Every error is that of the re-simulated displacement, over the rms of the readings about their mean. Held "
            f"out: {outcome.held_out_by}. Floor of the held-out error, from what differs from cycle to cycle or from "
            f"the noise: {figure(outcome.floor_percent)} %. The written model is highlighted."
        ],
    )
    yield Section("Loops and residuals", picture=Picture(picture, "loops, time series and residuals"))
    nothing = () if outcome.findings else ("No finding speaks against it.",)
    yield Section("What to know before you trust it", nothing, bullets=outcome.findings)
    yield Section(
        "Coefficients of the learned equation",
        table=_coefficients(learned.coefficients),
        remarks=[
            "Intervals hold together with 95 % probability and allow for correlated residuals. Slack: how far the "
            "coefficient can move, the others making up for it, before the output moves by 1 % of its rms."
        ],
    )
    if written is not learned:
        rows = [(c.name, c.value, unit_text(c.unit)) for c in written.coefficients]
        yield Section(
            f"Coefficients of the written model, {written.title}", table=Table(("part", "value", "unit"), rows)
        )
    yield Section("How it was found", bullets=list(_how(outcome)))


def _lines(equation: str) -> str:
    return equation.replace("; ", "\n").replace("-", "−")


def _coefficients(coefficients: Sequence[Coefficient]) -> Table:
    rows, marked = [], set()
    for k, c in enumerate(coefficients):
        interval = None if c.half_width is None else f"± {figure(c.half_width, 2)}"
        slack = "any" if c.slack is None or c.slack > ANY_SLACK else f"{figure(100.0 * c.slack)} %"
        rows.append((c.name, figure(c.value, 4), interval, unit_text(c.unit), slack))
        if c.slack is None or c.slack > WEAK:
            marked.add((k, 4))
    return Table(("term", "coefficient", "interval", "unit", "slack"), rows, marked=frozenset(marked))


def _how(outcome: Identification) -> Iterator[str]:
    learned, about = outcome.learned, outcome.identifiability
    yield f"library: {', '.join(learned.library)}"
    yield f"regression: {learned.regression.form} form, {len(learned.regression.rates)} rows"
    yield f"zero of the reading in the written model: {quantity(outcome.written.candidate.fit.offset_um, 'um', 4)}"
    yield (
        f"condition number of the library on this input: {figure(about.condition_library)}; of the output's "
        f"derivatives to the coefficients: {figure(about.condition_output)}"
    )
    yield (
        f"{len(learned.trials)} sets of terms were simulated over the whole records and compared by the Bayesian "
        "information criterion"
    )
    if learned.ensemble is not None:
        shares = zip(learned.regression.terms, learned.ensemble.inclusion, strict=True)
        yield "share of the resamples that keep a term: " + ", ".join(f"{t} {x:.2f}" for t, x in shares)
    known = {k: v for k, v in outcome.unseen.rivals.items() if v is not None}
    if known:
        listed = ", ".join(f"{name} {figure(value, 2)} %" for name, value in known.items())
        yield f"distance from the written model on two tones that were not recorded: {listed}"
    if outcome.unseen.coefficients is not None:
        yield (
            "spread on these two tones from the uncertainty of the learned coefficients: "
            f"{figure(outcome.unseen.coefficients, 2)} %"
        )
