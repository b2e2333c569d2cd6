"""Sentences about what a reader must know before trusting a model."""

from collections.abc import Iterator

import numpy as np

from bender_identify.identification_result import Identification, Row

ILL_CONDITIONED = 1e3
FAR_APART_PERCENT = 5.0
CLEARLY_BETTER = 0.9
MUCH_WIDER = 2.0
DOES_NOT_FOLLOW_PERCENT = 50.0
"""Variances of the coefficients that grow by more than this are told of."""


def remarks(outcome: Identification) -> Iterator[str]:
    """Yield warnings, the gravest first; each says what was found and what would settle it."""
    yield from _failure(outcome)
    yield from _excitation(outcome)
    yield from _terms(outcome)
    yield from _repeating(outcome)
    yield from _structure(outcome)
    yield from _start(outcome)
    yield from _unseen(outcome)
    yield from _form(outcome)


def _row(outcome: Identification, name: str) -> Row | None:
    return next((row for row in outcome.rows if row.candidate.id == name), None)


def _failure(outcome: Identification) -> Iterator[str]:
    error_percent = outcome.written.held_out.error_percent
    if error_percent > DOES_NOT_FOLLOW_PERCENT:
        yield (
            f"the written model does not follow the held-out rows (it errs {error_percent:.3g} %; their mean errs "
            "100 %): do not use it; check units and columns, try --quasi-static, or record more slowly"
        )


def _excitation(outcome: Identification) -> Iterator[str]:
    excitations = [x.excitation for x in outcome.experiments]
    periods = [x.period_s for x in excitations if x.single and x.period_s is not None]
    spans = [float(x.acting_V.max() - x.acting_V.min()) for x in outcome.experiments]
    same = max(periods, default=0.0) <= 1.05 * min(periods, default=1.0) and max(spans) <= 1.05 * min(spans)
    if len(periods) == len(excitations) and same:
        lag, operator = _row(outcome, "first_order_lag"), _row(outcome, "prandtl_ishlinskii")
        beside = (
            f" (a first-order lag errs {lag.held_out.error_percent:.3g} %, "
            f"the operator {operator.held_out.error_percent:.3g} %)"
            if lag is not None and operator is not None
            else ""
        )
        yield (
            f"the voltage is one frequency ({1.0 / periods[0]:.3g} Hz) at one amplitude: it cannot separate "
            f"relaxation or delay from hysteresis{beside}, and the held-out part is the same motion once more; "
            "record a second frequency a decade away and at least three amplitudes"
        )
    elif max(x.turns for x in excitations) == 0:
        yield "the voltage never turns round, so no loop was seen; record a voltage that goes up and down again"


def _terms(outcome: Identification) -> Iterator[str]:
    about = outcome.identifiability
    if about.weak:
        slack = {c.name: c.slack for c in outcome.learned.candidate.coefficients}
        listed = ", ".join(f"{term} (by {_percent(slack[term])})" for term in about.weak)
        yield (
            f"weakly identified: the coefficients of {listed} can move before the output moves by 1 %, the others "
            f"making up for it; those of {', '.join(about.traded)} move together. Trust the simulated displacement on "
            "inputs like these records, not the single coefficients"
        )
    for term, same in about.twins:
        yield (
            f"collinear: in these records {term} does what {same} does (cosine above 0.9995), so it was left out of "
            "the library"
            if same != "nothing"
            else f"not excited: {term} is zero in these records and was left out of the library"
        )
    if about.condition_library > ILL_CONDITIONED:
        yield (
            f"the library is ill-conditioned on this input (condition number {about.condition_library:.2g}): which "
            "of its terms are right cannot be told from these records alone"
        )


def _repeating(outcome: Identification) -> Iterator[str]:
    factor = outcome.learned.candidate.fit.repeating_factor
    if factor > MUCH_WIDER:
        yield (
            "part of the residual of the learned equation repeats in every cycle (a missing term, or an error of the "
            f"sensor that depends on the position): the intervals are {factor**0.5:.2g} times those of noise alone"
        )


def _structure(outcome: Identification) -> Iterator[str]:
    fitted = outcome.written.fitted.error_percent
    if outcome.still_percent < CLEARLY_BETTER * fitted:
        yield (
            f"these records do not show the ringing of the base model's structure: without it the written model errs "
            f"{outcome.still_percent:.3g} % instead of {fitted:.3g} % on the fitted rows; try --quasi-static or "
            "another --model"
        )
    if outcome.delay_s > 0.0:
        yield (
            f"a transport delay of {outcome.delay_s:.3g} s is in every model; at one frequency it cannot be told "
            "from a lag or from hysteresis"
        )


def _percent(slack: float | None) -> str:
    return "any amount" if slack is None or slack > 100.0 else f"{100.0 * slack:.0f} %"


def _start(outcome: Identification) -> Iterator[str]:
    for x in outcome.experiments:
        if x.in_motion:
            yield f"{x.name} starts in the middle of a motion: its initial state was estimated by a lead-in"
        counted = np.flatnonzero(x.fitted | x.held_out)
        readings = np.flatnonzero(np.isfinite(x.measured_um))
        # the reading at rest counts even where what follows is set aside
        if counted[1] > readings[1]:
            aside_s = float(x.time_s[counted[1]] - x.time_s[0])
            yield f"{x.name}: the first {aside_s:.3g} s are set aside, neither fitted nor scored"


def _unseen(outcome: Identification) -> Iterator[str]:
    distances = {k: v for k, v in outcome.unseen.rivals.items() if v is not None and k != "first_order_lag"}
    close = [
        row.candidate.id
        for row in outcome.rows
        if row.held_out.rms_um < 1.5 * outcome.written.held_out.rms_um and row.candidate.id in distances
    ]
    far = [name for name in close if distances[name] > FAR_APART_PERCENT]
    if far:
        listed = ", ".join(f"{name} by {distances[name]:.2g} %" for name in far)
        yield (
            f"models about as good on these records differ from the written one on two tones that were not recorded: "
            f"{listed}"
        )


def _form(outcome: Identification) -> Iterator[str]:
    learned = outcome.rows[0]
    written = outcome.written
    if written is not learned:
        yield (
            f"the model file holds the operator ({written.candidate.title}): its held-out error is "
            f"{written.held_out.error_percent:.3g} % beside {learned.held_out.error_percent:.3g} % of the learned "
            "equation"
        )
    if not written.remanent:
        yield ("the written model has no remanence at 0 V: it is a relaxation, not a hysteresis in the strict sense")
