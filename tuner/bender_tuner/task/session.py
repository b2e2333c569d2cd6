"""One tuning from the FMU file to the files in the output directory."""

import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Self

from bender_loop.errors import InputError, RunError
from bender_loop.fmu.diagnosed import LEAST_PROBABILITY, NOTHING, Diagnosed, RivalModel
from bender_loop.fmu.file import beyond_learned, learned_range, read_description
from bender_loop.fmu.followed_model import describe_model
from bender_loop.fmu.plant import FmuPlant
from bender_loop.fmu.process.watched import NATIVE_CODE, WatchedPlant
from bender_loop.shell.files import keep_earlier, prepare_directory, write_atomically
from bender_loop.shell.progress import Progress, print_table
from bender_loop.tables.quantities import USUAL, Quantities
from bender_report.drawing import can_draw, no_pictures
from bender_report.wording import listed, relabelled, shown_in
from bender_tuner.model.ensemble import Rival
from bender_tuner.results.gains_file import write_gains
from bender_tuner.results.summary import (
    deciding_title,
    finding_lines,
    gain_lines,
    recommendation_rows,
    table_rows,
    taken_units,
    task_lines,
)
from bender_tuner.results.tuning_file import FmuFacts, fmu_facts, tuning_document
from bender_tuner.rules.ziegler_nichols import ZieglerNichols
from bender_tuner.task.contenders import Contender, judged, line_up
from bender_tuner.task.following import TOLERANCE_SHARE, Following
from bender_tuner.task.interrupts import DeferredInterrupts, GuardedPlant
from bender_tuner.task.judgement import monte_carlo, variation_of
from bender_tuner.task.problem import Report, TuningProblem, pose_problem, silent
from bender_tuner.task.recommendation import LABEL, METHOD, Recommendation, recommend
from bender_tuner.task.settings import TuneSettings
from bender_tuner.task.tuning import Ended, SearchResult, search_in_growing_box, ziegler_nichols_rule

GAINS, TUNING, MODEL = "gains.toml", "tuning.json", "model.fmu"
PICTURES = ("convergence.png", "step.png", "loop.png", "monte_carlo.png")


@dataclass(slots=True, eq=False)
class Session:
    """What a tuning has come to so far.

    Attributes:
        settings: as asked for.
        problem: the plant posed as a problem.
        rule: what Ziegler and Nichols' rule says.
        searches: those that were begun, the asked one first.
        contenders: all gains, the asked method's first.
        ended: how it all ended.
        reason: what failed, empty otherwise.
        partial: the gains are those of a search that was cut short, beside a complete result of an earlier run.
        recommendation: whether a model is followed with the gains, and why; None where nobody asked.
        units: of command and reading, which V and um stand for.
    """

    settings: TuneSettings
    problem: TuningProblem
    rule: ZieglerNichols
    searches: list[SearchResult] = field(default_factory=list)
    contenders: list[Contender] = field(default_factory=list)
    ended: Ended = Ended.COMPLETE
    reason: str = ""
    partial: bool = False
    recommendation: Recommendation | None = None
    units: tuple[str, str] = USUAL[:2]

    @property
    def following(self) -> Following | None:
        """The model-following controller that is recommended with the gains, None where none is."""
        return None if self.recommendation is None else self.recommendation.following

    @property
    def following_note(self) -> str:
        """Why a model is followed, or is not; empty where nobody asked."""
        return "" if self.recommendation is None else self.recommendation.sentence

    @property
    def is_fit(self) -> bool:
        """Whether the gains may be run: they hold and, after a complete search, keep their bounds."""
        return self.ended is not Ended.REFUSED

    def place(self, out: Path, name: str) -> Path:
        """Return where a file of this session goes; one of an earlier, complete result is never replaced by a part."""
        stem, dot, ending = name.rpartition(".")
        return out / (f"{stem}.partial{dot}{ending}" if self.partial else name)


def hold_session(
    path: Path,
    input_name: str | None,
    output_name: str | None,
    settings: TuneSettings,
    out: Path,
    *,
    foreign: bool = False,
    parameters: Mapping[str, float] | None = None,
    quantities: Quantities = USUAL,
    follow_model: bool = False,
    found: Diagnosed = NOTHING,
    doubted: Sequence[tuple[str, Path]] = (),
) -> Session:
    """Tune the FMU at `path` and write into `out`; prints the task, the table and the findings.

    A foreign FMU runs in a process of its own that is watched, and so do those of its rivals and of what is doubted.

    Raises:
        InputError: bad FMU, variables, setpoint or directory; nothing was written.
        RunError: the plant failed before there were gains to keep, or the method has none.
        KeyboardInterrupt: before there were gains to keep.
    """
    opened = open_guarded(
        path,
        input_name,
        output_name,
        foreign=foreign,
        parameters=parameters,
        quantities=quantities,
        found=found,
    )
    with (
        opened as (plant, facts),
        open_rivals(plant, facts, found.rivals, foreign=foreign) as rivals,
        open_beside(plant, facts, doubted if follow_model else (), foreign=foreign) as lacking,
        Bars() as bars,
        shown_in(*facts.units),
    ):
        problem = pose_problem_in_units(plant, settings, facts, bars, rivals)
        prepare_directory(out)
        told = list(task_lines(settings, facts.path, facts.input, facts.output))
        _say(*told, *([taken_units(facts)] if facts.taken_units else []), *([NATIVE_CODE] if foreign else []))
        # gains are kept before they are judged: an interrupt then loses figures, no gains
        keep = partial(_keep_gains, out=out)
        session = run_session(plant, facts, problem, bars, keep, follow_model=follow_model, doubted=lacking)
        bars.close()
        written = write_results(session, facts, out)
        _print_results(session, written, foreign=foreign)
    return session


def pose_problem_in_units(
    plant: GuardedPlant,
    settings: TuneSettings,
    facts: FmuFacts,
    report: Report = silent,
    rivals: Sequence[Rival] = (),
) -> TuningProblem:
    """Return the plant, with what it may be instead, posed as a problem.

    Raises:
        InputError: as of `pose_problem`, in the units of the FMU; a setpoint out of reach may be one of a unit that the
            FMU does not declare.
    """
    try:
        problem = pose_problem(plant, settings, report, rivals)
        said = beyond_learned((problem.operating_point.voltage_V,), learned_range(Path(facts.path)), "V")
        told = (said, _without_unlikely(facts.unlikely_rivals))
        return replace(problem, notes=(*problem.notes, *(x for x in told if x)))
    except InputError as error:
        told = f"{error}; {taken_units(facts)}" if facts.taken_units else str(error)
        with shown_in(*facts.units):
            raise InputError(relabelled(told)) from None


def _without_unlikely(rivals: Sequence[str]) -> str:
    """Return for which rivals of the model nothing has to hold, in a sentence; empty where there are none."""
    if not rivals:
        return ""
    named = f"{listed(rivals, 'or')}, of which the diagnosis left {'a model' if len(rivals) == 1 else 'models'}"
    return f"no bound has to be kept with {named}: a probability of {LEAST_PROBABILITY:g} or less"


def run_session(
    plant: GuardedPlant,
    facts: FmuFacts,
    problem: TuningProblem,
    report: Report = silent,
    found: Callable[[Session], None] | None = None,
    *,
    follow_model: bool = False,
    doubted: Sequence[Rival] = (),
) -> Session:
    """Tune a plant and judge all gains; nothing is written or printed.

    Args:
        plant: as `open_guarded` gives it.
        facts: of its FMU.
        problem: the plant posed as a problem, with its settings.
        report: is told how far the work is.
        found: is given the session when the gains stand, before they are judged.
        follow_model: a controller that follows the FMU as its model is tuned too.
        doubted: devices without an effect that nothing vouches for, named after what they are without.

    Raises:
        RunError: the plant failed before there were gains to keep, or the method has none.
        KeyboardInterrupt: before there were gains to keep.
    """
    settings = problem.settings
    session = Session(settings, problem, ziegler_nichols_rule(problem), units=facts.units)
    _search(session, report)
    _require_gains(session)
    _refuse_unfit(session)
    if found is not None:
        found(session)
    if follow_model and session.ended is Ended.COMPLETE:
        _follow(session, plant, facts, report, doubted)
    for k, contender in enumerate(session.contenders):
        report("judging the gains", k, len(session.contenders), contender.label)
        session.contenders[k] = judged(problem, contender)
    if settings.monte_carlo and session.ended is Ended.COMPLETE:
        _run_monte_carlo(session, plant, facts, report)
    return session


class Bars:
    """Shows every piece of work that is reported as a bar of its own, one after the other."""

    def __init__(self) -> None:
        self._title, self._bar = "", None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __call__(self, title: str, done: int, total: int, remark: str = "") -> None:
        """Show how far a piece of work is."""
        if self._bar is None or title != self._title:
            self.close()
            self._title, self._bar = title, Progress(title).__enter__()
        self._bar.update(done, total, remark)

    def close(self) -> None:
        """End the bar that is shown."""
        if self._bar is not None:
            self._bar.__exit__(None, None, None)
            self._bar = None


@contextmanager
def open_guarded(
    path: Path,
    input_name: str | None = None,
    output_name: str | None = None,
    *,
    foreign: bool = False,
    parameters: Mapping[str, float] | None = None,
    quantities: Quantities = USUAL,
    found: Diagnosed = NOTHING,
) -> Iterator[tuple[GuardedPlant, FmuFacts]]:
    """The FMU as a plant that signals interrupt between its calls only, and what is known of the FMU.

    One in V and um is shown in the units that its diagnosis was made in.

    Raises:
        InputError: missing or unfit FMU, unknown variable.
        RunError: the FMU does not start.
    """
    values = dict(parameters or {})
    names = input_name, output_name
    with DeferredInterrupts() as interrupts, _opened(path, names, quantities, interrupts, foreign) as fmu:
        if values:
            fmu.set_parameters(values)
            fmu.reset()
        facts = fmu_facts(path, fmu, quantities)
        units = found.units if facts.units == NOTHING.units else facts.units
        told = replace(facts, start_values=values, units=units)
        yield (
            GuardedPlant(fmu, interrupts),
            replace(
                told,
                model_rms_um=found.rms_um,
                known=found.known,
                known_by=found.source,
                unlikely_rivals=found.unlikely,
            ),
        )


@contextmanager
def open_rivals(
    plant: GuardedPlant, facts: FmuFacts, rivals: Sequence[RivalModel], *, foreign: bool = False
) -> Iterator[tuple[Rival, ...]]:
    """What the device may be instead of `plant`, as `open_beside` opens it.

    Args:
        plant: as `open_guarded` gives it.
        facts: of its FMU.
        rivals: of the diagnosis that left it.
        foreign: each runs in a process of its own.

    Raises:
        InputError: missing or unfit FMU.
        RunError: an FMU does not start.
    """
    with open_beside(plant, facts, [(x.name, x.fmu) for x in rivals], foreign=foreign) as found:
        yield found


@contextmanager
def open_beside(
    plant: GuardedPlant, facts: FmuFacts, named: Sequence[tuple[str, Path]], *, foreign: bool = False
) -> Iterator[tuple[Rival, ...]]:
    """FMUs as plants with the same input and output as `plant` and under the same guard.

    Args:
        plant: as `open_guarded` gives it.
        facts: of its FMU; start values that were set are set in another one that has the parameter.
        named: FMUs with their names.
        foreign: each runs in a process of its own.

    Raises:
        InputError: missing or unfit FMU.
        RunError: an FMU does not start.
    """
    names = facts.input, facts.output
    with ExitStack() as ends:
        found = []
        for name, path in named:
            fmu = ends.enter_context(_opened(path, names, facts.quantities, plant.interrupts, foreign))
            known = {v.name for v in read_description(path).modelVariables}
            if values := {x: value for x, value in facts.start_values.items() if x in known}:
                fmu.set_parameters(values)
                fmu.reset()
            found.append(Rival(name, GuardedPlant(fmu, plant.interrupts)))
        yield tuple(found)


def _opened(
    path: Path,
    names: tuple[str | None, str | None],
    quantities: Quantities,
    interrupts: DeferredInterrupts,
    foreign: bool,
) -> FmuPlant | WatchedPlant:
    input_name, output_name = names
    if not foreign:
        return FmuPlant(path, input_name=input_name, output_name=output_name, quantities=quantities)
    try:
        return WatchedPlant(
            path,
            input_name=input_name,
            output_name=output_name,
            interrupted=lambda: interrupts.pending,
            quantities=quantities,
        )
    except RunError:  # the start may have been given up for the interrupt's sake
        interrupts.check()
        raise


def _search(session: Session, report: Report) -> None:
    for method in session.settings.searches:
        title = f"tuning with {method}"
        found = search_in_growing_box(
            session.problem,
            method,
            on_evaluation=lambda done, total, best, title=title: report(title, done, total, f"best {best:.4g}"),
        )
        session.searches.append(found)
        session.ended, session.reason = found.ended, found.reason
        if found.ended is not Ended.COMPLETE:
            break
    session.contenders = line_up(session.problem, session.searches, session.rule)


def _require_gains(session: Session) -> None:
    tuned = session.contenders[0]
    if tuned.gains is not None:
        return
    if session.ended is Ended.INTERRUPTED:
        raise KeyboardInterrupt
    if session.ended is Ended.FAILED:
        raise RunError(session.reason)
    raise RunError(f"{tuned.method}: {tuned.remark}; try another method or more evaluations")


def _refuse_unfit(session: Session) -> None:
    """Mark a complete tuning whose gains will not do; gains of an interrupted one are not kept where they are unstable.

    Raises:
        KeyboardInterrupt: an interrupted search has come to no stable loop yet.
    """
    if session.ended is Ended.FAILED:
        return
    try:
        objection = _objection(session)
    except RunError:
        if session.ended is Ended.INTERRUPTED:
            # the FMU hung and is gone: nothing can be tried any more, and what the search kept stands
            return
        raise
    if objection and session.ended is Ended.INTERRUPTED:
        raise KeyboardInterrupt
    if objection:
        session.ended, session.reason = Ended.REFUSED, objection


def _follow(session: Session, plant: GuardedPlant, facts: FmuFacts, report: Report, doubted: Sequence[Rival]) -> None:
    """Decide whether the model is followed with the gains, and put that among the contenders."""
    settings, path = session.settings, Path(facts.path)
    model = describe_model(
        plant,
        path,
        TOLERANCE_SHARE * abs(settings.setpoint_um),
        settings.slew_V_per_s,
        facts.input,
        facts.output,
        facts.start_values,
        facts.quantities,
    )
    model = replace(model, fmu=MODEL, rms_um=facts.model_rms_um)
    found = recommend(session.problem, session.contenders, model, path, facts.known, report, doubted, facts.known_by)
    session.recommendation = found
    gains = session.contenders[0].gains
    if found is not None and found.following is not None:
        session.contenders.insert(1, Contender(METHOD, LABEL, "following", gains, following=found.following))


def _objection(session: Session) -> str:
    """Why the gains will not do for a bench, empty where they will.

    A search by the practitioner's objective has promised to keep its bounds; a rule, and another objective, promise no
    more than a stable loop.
    """
    problem, tuned = session.problem, session.contenders[0]
    if tuned.gains is None:
        return ""
    if not problem.holds(tuned.gains):
        return f"{tuned.label} found no gains under which the loop is stable; try another method, or a lower --rate"
    searched = tuned.kind == "search" and session.settings.objective == "practitioner"
    if session.ended is Ended.COMPLETE and searched and not problem.keeps_bounds(tuned.gains):
        return (
            f"the best gains of {tuned.label} break the bounds that were asked for (see the line `bounds NOT kept`); "
            "allow more with --max-ms, --max-overshoot or --settle-within, or search further with --evaluations"
        )
    return ""


def _run_monte_carlo(session: Session, plant: GuardedPlant, facts: FmuFacts, report: Report) -> None:
    try:
        _draw_plants(session, plant, facts, report)
    except KeyboardInterrupt:
        session.ended = Ended.INTERRUPTED
    except RunError as error:
        session.ended, session.reason = Ended.FAILED, str(error)


def _draw_plants(session: Session, plant: GuardedPlant, facts: FmuFacts, report: Report) -> None:
    variation = variation_of(session.problem, set(facts.parameters))
    count = session.settings.monte_carlo
    for place, contender in enumerate(session.contenders):
        if contender.gains is None or contender.kind in ("start", "following"):
            continue
        title = f"trying {contender.label} on {count} plants"
        result = monte_carlo(
            session.problem,
            plant,
            contender.gains,
            variation,
            count,
            progress=lambda done, total, title=title: report(title, done, total, ""),
        )
        session.contenders[place] = replace(contender, monte_carlo=result)


def _keep_gains(session: Session, out: Path) -> None:
    """Write the gains before they are judged; a part of a search goes beside the complete result of an earlier one."""
    session.partial = session.ended is not Ended.COMPLETE and _has_complete_result(out)
    if not session.partial:
        keep_earlier(out, TUNING, [GAINS, *PICTURES])
    write_controller(session, out)


def write_controller(session: Session, out: Path) -> None:
    """Write the gains, where they may be run, and the FMU of the model that is followed."""
    settings, gains = session.settings, session.contenders[0].gains
    if gains is not None and session.is_fit:
        following = session.following
        if following is not None:
            write_atomically(out / MODEL, following.fmu.read_bytes())
        model = None if following is None else following.model
        path, period_s = session.place(out, GAINS), settings.sampling.period_s
        write_gains(path, gains, settings.limits, period_s, model, session.units)


def _has_complete_result(out: Path) -> bool:
    """Return whether gains are there, unless the file beside them says that they are those of a part of a search."""
    if not (out / GAINS).exists():
        return False
    try:
        found = json.loads((out / TUNING).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return True
    return not (isinstance(found, dict) and found.get("status") in (Ended.INTERRUPTED.value, Ended.FAILED.value))


def write_results(session: Session, facts: FmuFacts, out: Path) -> list[Path]:
    """Write gains, report and pictures; returns all files that are there now, and removes pictures of earlier runs."""
    write_controller(session, out)
    document = tuning_document(
        session.problem,
        facts,
        session.searches,
        session.contenders,
        session.rule,
        status=session.ended.value,
        reason=session.reason,
        model_following=session.recommendation,
    )
    write_atomically(session.place(out, TUNING), document)
    pictures = _pictures(session) if can_draw() else dict.fromkeys(PICTURES)
    for name, picture in pictures.items():
        if picture is None:
            session.place(out, name).unlink(missing_ok=True)
        else:
            write_atomically(session.place(out, name), picture)
    if not session.partial:
        for name in (GAINS, TUNING, *pictures):
            replace(session, partial=True).place(out, name).unlink(missing_ok=True)
    shown = [name for name, picture in pictures.items() if picture is not None]
    names = [*([GAINS] if session.is_fit else []), *([MODEL] if session.following else []), TUNING, *shown]
    return [session.place(out, name) for name in names]


def _pictures(session: Session) -> dict[str, bytes | None]:
    """Return the pictures by their files; None where a session has nothing to draw."""
    from bender_tuner.pictures.convergence import draw_convergence
    from bender_tuner.pictures.loop import draw_loop
    from bender_tuner.pictures.robustness import draw_monte_carlo
    from bender_tuner.pictures.steps import draw_steps

    settings, contenders = session.settings, session.contenders
    tuned, runs = contenders[0], [run for run in session.searches if run.history]
    judged = tuned.judgement is not None
    drawn = (
        draw_convergence(runs, settings.objective) if runs else None,
        draw_steps(contenders, settings) if judged else None,
        draw_loop(session.problem, tuned.judgement.gains) if tuned.judgement is not None else None,
        draw_monte_carlo(contenders, 2.0 * settings.duration_s) if tuned.monte_carlo is not None else None,
    )
    return dict(zip(PICTURES, drawn, strict=True))


def _print_results(session: Session, written: list[Path], *, foreign: bool) -> None:
    settings = session.settings
    columns, rows = table_rows(session.contenders)
    title = f"step to {settings.setpoint_um:g} µm, seen between the frames too for {settings.duration_s:g} s"
    print_table(relabelled(title), columns, rows)
    tuned = session.contenders[0]
    if tuned.gains is not None:
        _say("", f"gains of {tuned.label}", *(f"  {line}" for line in gain_lines(tuned.gains, settings.rate_Hz)))
    _say(
        "",
        *finding_lines(
            session.contenders, session.problem.practitioner.priorities, session.rule, session.problem.notes
        ),
    )
    if session.recommendation is not None:
        print_table(deciding_title(settings), *recommendation_rows(session.recommendation))
        _say(session.recommendation.sentence)
        if session.recommendation.following is not None and session.is_fit:
            _say(how_to_follow(written[0], foreign=foreign))
    _say(*([] if can_draw() else [no_pictures()]), f"written: {', '.join(map(str, written))}")


def how_to_follow(gains: Path, *, foreign: bool) -> str:
    """Return how gains that follow a model are run: those above alone are the PID block without it.

    Args:
        gains: the file.
        foreign: whether the model is somebody else's FMU, of which no controller FMU is made.
    """
    elsewhere = "" if foreign else f", in a loop of your own by the FMU of `bender fmu controller {gains}`"
    here = f"with the model they run by `bender hil --gains {gains}`"
    return f"the gains above are the PID block's share; {here}{elsewhere}"


def _say(*lines: str) -> None:
    sys.stdout.write("".join(f"{relabelled(line)}\n" for line in lines))
    sys.stdout.flush()
