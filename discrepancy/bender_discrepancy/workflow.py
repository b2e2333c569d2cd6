"""The one way through a diagnosis: read, search, judge, measure, propose.

The command, the benchmark of hidden effects, the demonstration and the notebook all go this way.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from threadpoolctl import threadpool_limits

from bender_compiled.background_compilation import compile_in_background
from bender_discrepancy.conclusion.contenders import OPEN_VERDICTS
from bender_discrepancy.conclusion.diagnosis_json import FMU
from bender_discrepancy.conclusion.findings import Findings, find
from bender_discrepancy.conclusion.measurement.driver import Driver
from bender_discrepancy.conclusion.measurement.gap import Measured, measure
from bender_discrepancy.conclusion.origin import with_origin
from bender_discrepancy.conclusion.smallest_visible import smallest_visible
from bender_discrepancy.diagnosis import Diagnosis
from bender_discrepancy.record_search import MOST_EFFECTS, search_records
from bender_effects.rigs import is_piezo_bender
from bender_identify.records.memory import memory_s
from bender_inference.candidates import tried_first
from bender_inference.equation.joined import with_equation
from bender_inference.equation.lead import find_lead
from bender_inference.experiment.proposal import propose
from bender_inference.input_hold import decide_input_hold
from bender_inference.records.checks import refuse_unusable
from bender_inference.records.digits import printed
from bender_inference.records.first_look import doubt
from bender_inference.records.observations import Array
from bender_inference.search.judgement.rules import MOST_GAIN
from bender_inference.search.result import BrokenOffError, Interrupted, SearchResult
from bender_inference.search.search import Progress
from bender_inference.settings import Settings
from bender_inference.structures import between_rows_decided, competing_structures
from bender_loop.errors import InputError, RunError
from bender_loop.records.common_units import in_units_of
from bender_loop.records.missing_rows import completed, without_remembered
from bender_loop.records.record import Record
from bender_loop.records.repeated_readings import without_repeats
from bender_loop.records.zero_move import without_zero_move
from bender_plant.model import Model
from bender_report.wording import HALF_WIDTH, listed


@dataclass(frozen=True, slots=True)
class BlackBox:
    """How a model that is a black box enters a diagnosis of what stands in for it.

    Attributes:
        lacking: (n,) of every record, what its readings lack: what box and stand-in differ by, where they were found.
        leading: effects that are sought at first: further ones only around the box itself.
        again: returns the records without what both differ by around what was found, where that is something else;
            None where it is not.
        settled: returns what was found, or what leaves less around the box itself.
        measured: returns the gap, measured on the box with what was found around it, and that as an FMU; None where
            the stand-in with it is all that can be driven.
    """

    lacking: Callable[[], Sequence[Array]]
    leading: int = MOST_EFFECTS
    again: Callable[[SearchResult, Progress], Sequence[Record] | None] = lambda _, __: None
    settled: Callable[[SearchResult], SearchResult] = lambda x: x
    measured: Callable[[SearchResult, Findings], tuple[Measured, bytes]] | None = None


# simulations have the cores: threads of linear algebra that wait for one take many times as long as one does
@threadpool_limits.wrap(limits=1)
def diagnose(
    base: Model | None,
    records: Sequence[Record],
    settings: Settings | None = None,
    progress: Progress | None = None,
    names: Sequence[str] = (),
    box: BlackBox | None = None,
    remark: Progress | None = None,
) -> Diagnosis:
    """Return what the records of one bench say about a model.

    Args:
        base: the model as given; None for linear structures that compete with the effects.
        records: of one bench.
        settings: how records are read, and what a next one may ask for.
        progress: is told what is being done.
        names: of the records or their files, as refusals and the diagnosis name them.
        box: what the model stands in for; None where it is the model itself that is diagnosed.
        remark: is told before the search where the records look like those of another device.

    Raises:
        InputError: nothing can be learned from a record, its units cannot be right, or the records last too long for
            the sub-steps of the model.
        BrokenOffError: the corrected FMU could not be driven.
        Interrupted: by the user, after a first ranking.
        KeyboardInterrupt: by the user, before it.
    """
    tell, how = progress or (lambda _: None), settings or Settings()
    sources = tuple(names) or tuple(f"record {k + 1}" for k in range(len(records)))
    tell("comparing the records with the model")
    # of a piezo bender another quantity is refused below, with what to do
    wanted = None if base is None or is_piezo_bender(base) else base.units
    records = in_units_of(records, wanted, sources)
    measured = [without_zero_move(without_repeats(printed(x))) for x in records]
    records = measured if how.untimed else [completed(x) for x in measured]
    given, others = base, ()
    if base is None:
        tell("fitting linear structures")
        how = between_rows_decided(records, how, sources)
        first, *others = competing_structures(records, how, sources)
        given = first.model
    assert given is not None
    records = [without_remembered(x, memory_s(given)) for x in records]
    with Driver() as driver:
        with compile_in_background(lambda: tried_first(given)):
            if base is not None:
                refuse_unusable(base, sources, measured, how)
            if base is not None and remark is not None and (doubtful := doubt(base, records[0], how)) is not None:
                remark(doubtful)
            if box is None or box.measured is None:
                driver.begin()
            how = how if base is None else decide_input_hold(base, records, how)
            lacking, most = (box.lacking(), box.leading) if box else ((), MOST_EFFECTS)
            found = search_records(given, records, how, tell, lacking, most, others)
        refuse_gain(found)
        try:
            while box and (nearer := box.again(found, tell)) is not None:
                found = search_records(given, [printed(x) for x in nearer], how, tell, box.lacking())
            found = box.settled(found) if box else found
            return replace(conclude(found, sources, tell, box, driver), quantities=records[0].quantities)
        except KeyboardInterrupt:
            raise Interrupted(found, searched=True) from None
        except RunError as problem:
            raise BrokenOffError(str(problem), found) from None


def refuse_gain(found: SearchResult) -> None:
    """Refuse readings that only a gain which no model holds brings near the model: they hardly answer the command.

    Raises:
        InputError: they do.
    """
    gain = found.best.calibration.gain * found.base.values().get("calibration.gain", 1.0)
    if abs(gain) > MOST_GAIN:
        raise InputError(
            f"the readings are {gain:.3g} times those of the model {found.base.name}, expected at most {MOST_GAIN:g}: "
            "they hardly answer the command; check the columns and their units, or give a model by --model"
        )


def conclude(
    found: SearchResult,
    names: Sequence[str],
    tell: Progress,
    box: BlackBox | None = None,
    driver: Driver | None = None,
) -> Diagnosis:
    """Judge what a search found, measure the gap through the corrected FMU, propose what comes next.

    Args:
        found: by the search.
        names: of the records.
        tell: is told what is being done.
        box: what the model stands in for; None where it is the model itself that is diagnosed.
        driver: may have begun a process that drives the FMU.

    Raises:
        RunError: the corrected FMU could not be driven.
    """
    with ThreadPoolExecutor(1) as beside:
        # a core is free while the corrected FMU is driven in a process of its own
        visible = beside.submit(smallest_visible, found)
        findings, gap, content = measured_through_fmu(found, names, tell, box, driver)
        if found.best.hypothesis.all_parts and (why := refuted(found, gap)):
            tell("held-out readings contradict the effects")
            measured = partial(measured_through_fmu, names=names, tell=tell, box=box, driver=driver)
            found, (findings, gap, content) = next_best(found, why, names, measured)
            visible = beside.submit(smallest_visible, found)
    found = findings.search
    is_certain = any(x.grade == "certain" for x in found.grades.effects)
    if is_certain and not found.verdict.complete and gap.falls_short(found.rules.closes):
        share, error = (100.0 * x for x in gap.closed)
        least, effects = 100.0 * found.rules.closes, listed(found.best.hypothesis.effects)
        close = "closes" if len(found.best.hypothesis.effects) == 1 else "close"
        found = found.without_certainty(
            f"on held-out readings {effects} {close} {share:.0f} % of the gap (standard error {error:.0f} %), "
            f"less than {least:.0f} %",
            gap.closed[0],
        )
        findings = with_origin(find(found, of_a_device=findings.of_a_device).closing(gap), names)
    following = propose(found, findings.leaders, tell) if findings.verdict in OPEN_VERDICTS else None
    lead = None
    if findings.verdict == "unexplained":
        tell("seeking an equation for the residual")
        lead = find_lead(found)
        joined = with_equation(found, lead) if box is None else None
        if joined is not None:
            further = measured_through_fmu(joined, names, tell, None, driver)
            if not further[1].is_worse and further[1].after.rms_um < gap.after.rms_um:
                findings, gap, content = further
    return Diagnosis(findings, gap, following, lead, tuple(names), content, visible.result())


def next_best(
    found: SearchResult,
    why: str,
    names: Sequence[str],
    measured: Callable[[SearchResult], tuple[Findings, Measured, bytes]],
) -> tuple[SearchResult, tuple[Findings, Measured, bytes]]:
    """Return another result for a search whose effects the held-out readings contradict, and its measurement.

    Other effects that these readings do not contradict are at most likely; where there are none, nothing is named.
    """
    refuted = listed(found.best.hypothesis.effects) or "other numbers"
    for other in found.next_best():
        kept, gap, content = measured(other)
        share, error = gap.closed
        if gap.is_worse or not share > HALF_WIDTH * error:
            continue
        reason = (
            f"held-out readings contradict a model with {refuted} and nothing else missing; this is the next best, "
            "which they do not contradict"
        )
        if other.verdict.word == "ambiguous":
            reason = f"{reason}; {other.verdict.reason}"
        lowered = other.without_certainty(reason, share, complete=other.grades.complete)
        again = find(lowered, of_a_device=kept.of_a_device)
        return lowered, (with_origin(again.closing(gap), names), gap, content)
    nothing = found.without_effects(why)
    return nothing, measured(nothing)


def measured_through_fmu(
    found: SearchResult, names: Sequence[str], tell: Progress, box: BlackBox | None, driver: Driver | None
) -> tuple[Findings, Measured, bytes]:
    """Return what is reported of a search, the gap as its corrected FMU leaves it, and that FMU.

    Raises:
        RunError: the FMU could not be driven.
    """
    tell("weighing the evidence")
    findings = with_origin(find(found, of_a_device=box is None), names)
    if box is not None and box.measured is not None:
        tell("driving the corrected FMU")
        measured, content = box.measured(found, findings)
        return findings.closing(measured), measured, content
    tell("building the corrected FMU")
    with TemporaryDirectory() as folder:
        fmu = Path(folder) / FMU

        def driving(steps: str) -> None:
            tell(f"driving the corrected FMU{steps and f', {steps} steps'}")

        gap = measure(found, findings.model, findings.calibration, fmu, findings.of_record, driving, driver)
        return findings.closing(gap), gap, fmu.read_bytes()


def refuted(searched: SearchResult, gap: Measured) -> str:
    """Return why held-out readings contradict what was found, "" where they do not."""
    if not gap.is_worse:
        return ""
    effects = listed(searched.best.hypothesis.effects) or "numbers of its own"
    less = "as given" if gap.before.rms_um < gap.recalibrated.rms_um else "with calibration alone"
    return (
        f"with {effects} the model leaves {gap.after.rms_um:.3g} µm rms of readings that no choice saw, "
        f"{less} {min(gap.before.rms_um, gap.recalibrated.rms_um):.3g} µm"
    )
