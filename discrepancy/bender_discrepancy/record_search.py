"""The search of the records of one bench: what is tried on them, where they begin, and what is judged."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from bender_discrepancy.conclusion.coarse_readings import step_in_motion_um
from bender_effects.catalogue import EFFECTS
from bender_effects.form import Form
from bender_effects.rigs import is_piezo_bender
from bender_inference.candidates import affordable, candidate_forms, eligible, too_long
from bender_inference.fitting.fit_problem import FitProblem, problem_of
from bender_inference.fitting.level_cell import centred
from bender_inference.fitting.output_error import fit, recounted
from bender_inference.fitting.own_numbers import own_form
from bender_inference.fitting.visible_modes import without_unseen_modes
from bender_inference.input_hold import OtherCourseError, better_course, course_of_another_effect
from bender_inference.records.digits import jitter_um, lattice_step_um
from bender_inference.records.excerpt import Excerpt, excerpts
from bender_inference.records.initial_motion import moving, started
from bender_inference.records.observations import Array, Observations, observe
from bender_inference.search.full_record import FullRecordCheck, check_on_full_record, judged_on_full_record
from bender_inference.search.judgement.grades import grade, relevant_part
from bender_inference.search.judgement.verdict import decide
from bender_inference.search.moves import Catalogue, Kit
from bender_inference.search.result import Interrupted, SearchResult, rules_for
from bender_inference.search.search import Progress, Searched, search
from bender_inference.search.set_aside import with_late_stamps
from bender_inference.search.start import better_beginning
from bender_inference.settings import Settings
from bender_inference.structures import CompetingStructure, rebased
from bender_inference.witnesses.testimony import Witnesses, judge_channels
from bender_loop.errors import InputError
from bender_loop.records.initial_motion import starts_at_rest
from bender_loop.records.record import Record
from bender_plant.model import Model

MOST_EFFECTS = 5
INTEGRATES = 100.0
"""A lag so many times as slow as a record forgets one percent of what it adds up there."""


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
        raise InputError(too_long(searched, observations))
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
    # a plant that adds its commands up stands still at none only
    longest_s *= INTEGRATES if all(x.passes_zero for x in observations) else 1.0
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
