"""The one way through a diagnosis: read, search, judge, measure, propose.

The command, the benchmark of hidden effects, the demonstration and the notebook all go this way.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from threadpoolctl import threadpool_limits

from bender_compiled.background_compilation import compile_in_background
from bender_discrepancy.conclusion.coarse_readings import step_in_motion_um
from bender_discrepancy.conclusion.contenders import OPEN_VERDICTS
from bender_discrepancy.conclusion.diagnosis_json import FMU
from bender_discrepancy.conclusion.findings import Findings, find
from bender_discrepancy.conclusion.measurement.driver import Driver
from bender_discrepancy.conclusion.measurement.gap import Measured, measure
from bender_discrepancy.conclusion.origin import with_origin
from bender_discrepancy.conclusion.smallest_visible import smallest_visible
from bender_discrepancy.diagnosis import Diagnosis
from bender_discrepancy.effects.catalogue import EFFECTS, forms
from bender_discrepancy.effects.effect import FULL_VOLTAGE_V, FULL_STROKE_um, Sizes
from bender_discrepancy.effects.form import Form
from bender_discrepancy.effects.rigs import is_piezo_bender
from bender_discrepancy.equation.joined import with_equation
from bender_discrepancy.equation.lead import find_lead
from bender_discrepancy.experiment.proposal import propose
from bender_discrepancy.fitting.fit_problem import COARSER, MOST_SUBSTEPS, FitProblem, problem_of
from bender_discrepancy.fitting.level_cell import centred
from bender_discrepancy.fitting.output_error import fit, recounted
from bender_discrepancy.fitting.own_numbers import own_form
from bender_discrepancy.fitting.visible_modes import without_unseen_modes
from bender_discrepancy.input_hold import OtherCourseError, better_course, course_of_another_effect, decide_input_hold
from bender_discrepancy.records.checks import refuse_unusable
from bender_discrepancy.records.digits import jitter_um, lattice_step_um, printed
from bender_discrepancy.records.excerpt import Excerpt, excerpts
from bender_discrepancy.records.excitation import lowest_Hz
from bender_discrepancy.records.first_look import doubt
from bender_discrepancy.records.initial_motion import moving, started
from bender_discrepancy.records.observations import Array, Observations, observe
from bender_discrepancy.records.ringing import first_resonance
from bender_discrepancy.records.spectrum import bin_s
from bender_discrepancy.search.full_record import FullRecordCheck, check_on_full_record, judged_on_full_record
from bender_discrepancy.search.judgement.grades import grade, relevant_part
from bender_discrepancy.search.judgement.rules import MOST_GAIN
from bender_discrepancy.search.judgement.verdict import decide
from bender_discrepancy.search.moves import Catalogue, Kit
from bender_discrepancy.search.result import BrokenOffError, Interrupted, SearchResult, rules_for
from bender_discrepancy.search.search import Progress, Searched, search
from bender_discrepancy.search.set_aside import with_late_stamps
from bender_discrepancy.search.start import better_beginning
from bender_discrepancy.settings import Settings
from bender_discrepancy.structures import CompetingStructure, between_rows_decided, competing_structures, rebased
from bender_discrepancy.witnesses.testimony import Witnesses, judge_channels
from bender_identify.records.memory import memory_s
from bender_loop.errors import InputError, RunError
from bender_loop.records.initial_motion import starts_at_rest
from bender_loop.records.missing_rows import completed, without_remembered
from bender_loop.records.record import Record
from bender_loop.records.repeated_readings import without_repeats
from bender_loop.records.sizes import LEAST_SPAN
from bender_loop.records.zero_move import without_zero_move
from bender_plant.blocks.periodic_disturbance import Parameters as Swing
from bender_plant.blocks.periodic_disturbance import ringing_step_s
from bender_plant.model import Model
from bender_plant.parameter import ModelError
from bender_plant.plant import sub_step_bounds_s
from bender_report.wording import HALF_WIDTH, listed

MOST_EFFECTS = 5
# what an effect of the ringing is sized by in a model that has none
WITHOUT_MODES_Hz, USUAL_S = 100.0, 50.0


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


def eligible(candidates: Sequence[Form], settings: Settings) -> tuple[Form, ...]:
    """Return the forms whose names the records can support."""
    return tuple(form for form in candidates if not (settings.untimed and form.timed))


def affordable(base: Model, candidates: Sequence[Form], observations: Sequence[Observations]) -> tuple[Form, ...]:
    """Return the forms that can be simulated over the records: one that needs the ringing in full may not be."""
    duration = sum(float(np.ptp(x.time_s)) for x in observations)
    return tuple(x for x in candidates if duration < COARSER * MOST_SUBSTEPS * _longest_step_s(base, x))


def _endless(base: Model, observations: Sequence[Observations]) -> str:
    step_s = sub_step_bounds_s(base)[1]
    duration_s = sum(float(np.ptp(x.time_s)) for x in observations)
    return (
        f"records: found {duration_s:.4g} s to search, in sub-steps of {step_s:.2g} s as the model {base.name} needs, "
        f"expected less than {COARSER * MOST_SUBSTEPS * step_s:.2g} s; give a part of them, or a model without such a "
        "quick memory, or say --untimed where every row is a settled pair"
    )


def _fits(base: Model, form: Form) -> bool:
    """Return whether the model can have the form: what changes the ringing needs a model that rings."""
    try:
        _longest_step_s(base, form)
    except ModelError:
        return False
    return True


def _longest_step_s(base: Model, form: Form) -> float:
    values = tuple(free.starts[0] if free.starts else free.high for free in form.free)
    return sub_step_bounds_s(form.apply(base, form.of_record(values, 0)))[1]


def candidate_forms(base: Model, observations: Sequence[Observations]) -> tuple[Form, ...]:
    """Return the forms, sized to what the records span until their last row."""
    span = max(float(np.max(np.abs(x.drive.voltage_V))) for x in observations)
    stroke = _stroke_um(observations)
    duration = max(float(x.time_s[-1]) for x in observations)
    highest_Hz = max(0.5 / float(np.median(np.diff(x.time_s))) for x in observations)
    first_Hz, damping_ratio = first_resonance(base) or (WITHOUT_MODES_Hz, 0.0)
    lowest = min(_lowest_Hz(x) for x in observations)
    line_Hz = _quickest_line_Hz(observations, highest_Hz)
    ends = [y for x in observations for y in (float(np.min(x.command_V)), float(np.max(x.command_V)))]
    furthest = max(ends, key=abs)
    film = is_piezo_bender(base)
    sizes = Sizes(span, stroke, duration, first_Hz, film, highest_Hz, damping_ratio, lowest, line_Hz, furthest)
    own = len(observations)
    found = forms_for(base, sizes)
    return tuple(x.for_each_of(own) if EFFECTS[x.effect].stage == "surroundings" else x for x in found)


def _stroke_um(observations: Sequence[Observations]) -> float:
    """Return how far the readings go that count; of those that stand still there, how far all go, and never nought."""
    counted = max(float(np.ptp(x.measured_um[x.usable])) for x in observations)
    every = max(float(np.ptp(x.measured_um[np.isfinite(x.measured_um)])) for x in observations)
    return next((x for x in (counted, every) if x >= LEAST_SPAN), FULL_STROKE_um)


def _quickest_line_Hz(observations: Sequence[Observations], highest_Hz: float) -> float:
    """Return the frequency of the quickest disturbance that the rows show and that a sensor that lags can follow."""
    shown_Hz = max(0.5 / bin_s(x.time_s) for x in observations)
    of_one_Hz_s = ringing_step_s(Swing(sine_um=1.0, frequency_Hz=1.0), None)
    # half of what may be simulated: the steps that every jump of the command needs come on top
    most_steps = 0.5 * COARSER * MOST_SUBSTEPS
    followed_Hz = most_steps * of_one_Hz_s / sum(float(np.ptp(x.time_s)) for x in observations)
    return max(highest_Hz, min(shown_Hz, followed_Hz))


def _lowest_Hz(x: Observations) -> float:
    command_V = x.command_V
    before_V = 0.0 if x.start == "rest" else x.rest_before_V
    return lowest_Hz(x.drive.command_time_s[-command_V.size :], command_V, before_V)


def forms_for(base: Model, sizes: Sizes) -> list[Form]:
    """Return the forms that a model can have, sized so."""
    present = {settings.id for settings in base.blocks} - {"bending_modes", "calibration"}
    found = [x for x in forms(sizes) if x.effect not in present and _fits(base, x)]
    if "linear_transduction" in present:
        # beside a linear actuator a linear part of an effect is a gain once more
        found = [x.holding("reversible_linear_um_per_V", 0.0) for x in found]
    return found


def _tried_first(base: Model) -> list[Model]:
    """Return the model, and with each form in it: their kernels are the same for records of any size."""
    first_Hz, damping_ratio = first_resonance(base) or (WITHOUT_MODES_Hz, 0.0)
    sizes = Sizes(FULL_VOLTAGE_V, FULL_STROKE_um, USUAL_S, first_Hz, is_piezo_bender(base), damping_ratio=damping_ratio)
    forms = forms_for(base, sizes)
    starts = ([free.starts[0] if free.starts else free.high for free in x.free] for x in forms)
    return [base, *(x.apply(base, tuple(y)) for x, y in zip(forms, starts, strict=True))]


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
        with compile_in_background(lambda: _tried_first(given)):
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
        findings = with_origin(find(found).closing(gap), names)
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
        _, gap, content = measured(other)
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
        return lowered, (with_origin(find(lowered).closing(gap), names), gap, content)
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
    findings = with_origin(find(found), names)
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


def search_records(
    base: Model,
    records: Sequence[Record],
    settings: Settings | None = None,
    progress: Progress | None = None,
    lacking: Sequence[Array] = (),
    most: int = MOST_EFFECTS,
    others: Sequence[CompetingStructure] = (),
) -> SearchResult:
    """Search the records of one bench for missing effects, and judge what was found.

    Whether readings on a lattice are coarse beside their noise shows while the tip stands. Where it never does, the
    search is done again with the steps of the lattice if it leaves structure and they are most of the noise.

    Args:
        base: the model as given.
        records: of one bench.
        settings: how they are read.
        progress: is told what is being done.
        lacking: (n,) of every record, what was taken from its readings before; none for nothing.
        most: effects that are sought beside one another.
        others: linear structures that compete with the model as given.

    Raises:
        InputError: the records last too long for the sub-steps of the model.
        ValueError: the model cannot be simulated under the voltage of the records, or too few readings are left.
        Interrupted: by the user, after a first ranking.
    """
    how, tell = settings or Settings(), progress or (lambda _: None)

    def searched(how: Settings, most: int = most, step: float = 0.0) -> SearchResult:
        return _searched(base, records, how, tell, lacking, most, others, step)

    def on(course: Settings) -> SearchResult:
        tell(f"the command fits far better as {course.input_hold} between rows: searching again")
        return searched(course)

    try:
        found = searched(how)
    except OtherCourseError as other:
        found = on(other.how)
    try:
        if not found.verdict.complete:
            course = course_of_another_effect(found.found, records, found.settings, lambda x: searched(x, 1).found)
            found = found if course is None else on(course)
        step = 0.0 if found.verdict.complete or found.sensor_step_um else step_in_motion_um(found)
        if not step:
            return found
        tell("the readings are quantised although the tip never rests: searching again")
        return searched(found.settings, step=step)
    except KeyboardInterrupt:
        raise Interrupted(found, searched=True) from None


def _searched(
    base: Model,
    records: Sequence[Record],
    how: Settings,
    tell: Progress,
    lacking: Sequence[Array],
    most: int,
    structures: Sequence[CompetingStructure],
    known_step_um: float = 0.0,
) -> SearchResult:
    whole = tuple(observe(record, how.linear, how.untimed, how.smooth) for record in records)
    whole = tuple(replace(x, same_zero=how.same_zero) for x in whole)
    if lacking:
        whole = tuple(replace(x, lacking_um=d) for x, d in zip(whole, lacking, strict=True))
    begun = tuple(_begun(base, *x, how) for x in zip(records, whole, strict=True))
    parts = excerpts(begun, how.untimed)
    observations = tuple(x.seen() for x in parts)
    step = known_step_um or _sensor_step_um(observations)
    if step:
        observations = tuple(replace(x, half_step_um=step / 2.0) for x in observations)
    searched = without_unseen_modes(base, observations)
    problem = problem_of(searched, observations)
    sought = eligible(candidate_forms(searched, begun), how)
    told = _testimony(searched, records, sought, how)
    supported = told.left(sought)
    candidates = affordable(searched, supported, observations)
    if not candidates:
        raise InputError(_endless(searched, observations))
    untried = {x.effect for x in supported} - {x.effect for x in candidates}

    cut = () if all(x.is_all for x in parts) else parts
    others = () if cut or how.untimed or how.start != "auto" else whole
    rules = rules_for(how)
    catalogue = Catalogue(
        _kits(_kit(None, searched, candidates, observations), structures, begun, observations, told, how),
        told.first(candidates),
        most,
    )

    def begin(found: Searched) -> FitProblem | None:
        return better_beginning(found, others, rules) if others else None

    def concluded(found: Searched, on_all: FullRecordCheck | None = None) -> SearchResult:
        found = _finally(found)
        forms = catalogue.kit(found.best.hypothesis).forms
        found, given = rebased(found, searched)
        effects = found.best.hypothesis.effects
        found = relevant_part(found, rules)
        immaterial = tuple(x for x in effects if x not in found.best.hypothesis.effects)
        grades = grade(found, rules)
        verdict = decide(found, grades, rules)
        if on_all is not None:
            grades, verdict = judged_on_full_record(grades, verdict, on_all, rules)
        untold = tuple(sorted(untried))
        return SearchResult(
            base if given is searched else given,
            tuple(records),
            found,
            grades,
            verdict,
            how,
            step,
            untold,
            cut,
            told.sentences,
            forms,
            immaterial,
            () if on_all is None else on_all.rows,
        )

    kept: list[Searched] = []
    try:
        found = search(problem, catalogue, rules, tell, _kept_in(kept, records, how), begin)
        on_all = check_on_full_record(cut, found, told.left(_slow(searched, cut, how))) if cut else None
    except KeyboardInterrupt:
        if not kept:
            raise
        last, archive = kept[-1], kept[-1].archive
        last = replace(last, base=archive.current(last.base), best=archive.current(last.best))
        raise Interrupted(concluded(last)) from None
    return concluded(on_all.found if on_all else found, on_all)


def _kits(
    given: Kit,
    structures: Sequence[CompetingStructure],
    whole: Sequence[Observations],
    observations: Sequence[Observations],
    told: Witnesses,
    how: Settings,
) -> tuple[Kit, ...]:
    """Return what may be put into the model as given and into each structure that competes with it.

    Where structures compete, none was given: their own numbers are not off, so no change of one is an effect.

    Args:
        given: of the model as given.
        structures: that compete with it.
        whole: records that forms are sized to.
        observations: of their rows that are searched.
        told: by other channels.
        how: records are read.
    """
    if not structures:
        return (given,)
    kits = [given]
    for x in structures:
        forms = affordable(x.model, told.left(eligible(candidate_forms(x.model, whole), how)), observations)
        kits.append(replace(_kit(x.model, x.model, forms, observations), hidden=x.hidden))
    return tuple(x.without_changes_of_numbers() for x in kits)


def _kit(structure: Model | None, model: Model, forms: Sequence[Form], observations: Sequence[Observations]) -> Kit:
    longest_s = max(float(np.ptp(x.time_s)) for x in observations)
    row_s = min(float(np.median(np.diff(x.time_s))) for x in observations)
    return Kit(structure, tuple(forms), own_form(model, longest_s, row_s))


def _kept_in(kept: list[Searched], records: Sequence[Record], how: Settings) -> Callable[[Searched], None]:
    """Return what keeps the steps of a search, and ends it where another course between the rows fits far better."""

    def keep(found: Searched) -> None:
        kept.append(found)
        if (course := better_course(found, records, how)) is not None:
            raise OtherCourseError(course)

    return keep


def _finally(found: Searched) -> Searched:
    """Return what was found with its numbers from all rows that are off by late time stamps only.

    The step of a quantiser stands in the middle of what fits alike.
    """
    archive = found.archive
    best = centred(archive.problem, found.best)
    problem = with_late_stamps(archive.problem, best, archive.noise_um)
    if problem is not archive.problem and (again := fit(problem, best.hypothesis, kept=False)) is not None:
        best = recounted(again, archive.problem)
    if best is found.best:
        return found
    archive.add([best])
    return replace(found, best=best)


def _testimony(base: Model, records: Sequence[Record], sought: Sequence[Form], how: Settings) -> Witnesses:
    """Return what other channels of the records testify; nothing where their rows have no times."""
    if how.untimed:
        return Witnesses()
    film, linear = is_piezo_bender(base), how.linear or how.smooth
    return judge_channels(records, sought, is_film=film, linear=linear, confidence=how.confidence)


def _begun(base: Model, record: Record, seen: Observations, how: Settings) -> Observations:
    """Return the observations of a record as it begins: as told, or as the model as given meets its start better."""
    if how.untimed or how.start == "rest":
        return seen
    if how.start == "motion":
        return moving(base, record, seen)
    return seen if starts_at_rest(record.voltage_V) else started(base, record, seen)


def _slow(base: Model, parts: Sequence[Excerpt], settings: Settings) -> tuple[Form, ...]:
    """Return the forms of slow effects, sized to whole records."""
    return tuple(
        x for x in eligible(candidate_forms(base, [x.whole for x in parts]), settings) if EFFECTS[x.effect].slow
    )


def _sensor_step_um(observations: Sequence[Observations]) -> float:
    """Return the step of coarse readings, 0 where they are fine beside what changes from row to row."""
    steps = {lattice_step_um(x.read_um[x.usable]) for x in observations}
    step = max(steps)
    if step == 0.0 or 0.0 in steps:
        return 0.0
    jitter = np.concatenate([jitter_um(x.read_um[x.usable], x.command_V[x.usable]) for x in observations])
    same = float(np.mean(jitter < step / 2.0))
    return step if same > 0.2 else 0.0
