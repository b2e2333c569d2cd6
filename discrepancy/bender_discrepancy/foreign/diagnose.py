"""The diagnosis of anybody's FMU: a surrogate stands for it while effects are fitted, see `surrogate`."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from threadpoolctl import threadpool_limits

from bender_discrepancy.conclusion.findings import Findings
from bender_discrepancy.conclusion.measurement.gap import Measured
from bender_discrepancy.diagnosis import Diagnosis
from bender_discrepancy.foreign.competition import Contest, compete
from bender_discrepancy.foreign.container_stages import Original
from bender_discrepancy.foreign.corrected_fmu import Container, why_none
from bender_discrepancy.foreign.space_mapping import SpaceMapping, size_um
from bender_discrepancy.foreign.surrogate import FOLLOWS_WITHIN, fit_surrogate
from bender_discrepancy.foreign.suspects import suspects_of
from bender_discrepancy.workflow import BlackBox, diagnose
from bender_identify.records.memory import memory_s
from bender_inference.records.digits import printed
from bender_inference.search.result import SearchResult
from bender_inference.search.search import Progress
from bender_inference.settings import Settings
from bender_loop.fmu.process.watched import WatchedPlant
from bender_loop.records.common_units import in_units_of
from bender_loop.records.missing_rows import completed, without_remembered
from bender_loop.records.record import Record
from bender_loop.records.repeated_readings import without_repeats


# as in `workflow.diagnose`
@threadpool_limits.wrap(limits=1)
def diagnose_fmu(
    fmu: Path | str,
    input_name: str | None,
    output_name: str | None,
    records: Sequence[Record],
    settings: Settings | None = None,
    progress: Progress | None = None,
    names: Sequence[str] = (),
    parameters: Mapping[str, float] | None = None,
    suspects: Sequence[str] = (),
) -> Diagnosis:
    """Return what the records of one bench say about an FMU, whoever made it.

    Args:
        fmu: of FMI 2.0 or 3.0, for co-simulation; it runs in a process of its own.
        input_name: the variable that takes the voltage; None for its only input, or `voltage`.
        output_name: the variable that is read; None for its only output, or `displacement`.
        records: of one bench.
        settings: as in `workflow.diagnose`.
        progress: is told what is being done.
        names: of the records or their files.
        parameters: of the FMU, by name, in its own units.
        suspects: parameters of the FMU that may be off, as `--suspect` has them; they compete with the effects.

    Raises:
        InputError: as in `workflow.diagnose`; or the FMU is not fit, does not answer, or no linear model follows it.
        RunError: the FMU fails, crashes or hangs.
        Interrupted: by the user, after a first ranking.
        KeyboardInterrupt: by the user, before it.
    """
    how, tell, given = settings or Settings(), progress or (lambda _: None), dict(parameters or {})
    # of an FMU the command is held where nobody says what it does between the rows
    how = replace(how, decide_hold=False, with_record_effects=True)
    suspected = suspects_of(Path(fmu), suspects, given)
    tell("starting the FMU")
    records = [without_repeats(printed(x)) for x in in_units_of(records, None, names)]
    records = records if how.untimed else [completed(x) for x in records]
    own = records[0].quantities
    opened = WatchedPlant(fmu, input_name=input_name, output_name=output_name, quantities=own)
    with opened.with_parameters(given) as plant:

        def at(values: Mapping[str, float]) -> Diagnosis:
            plant.set_parameters(given | {x.name: x.given for x in suspected} | dict(values))
            return _at(plant, Path(fmu), given | dict(values), records, how, tell, names)

        if not suspected:
            return at({})
        return compete(Contest(plant, tuple(records), how, suspected, at, tell))


def _at(
    plant: WatchedPlant,
    fmu: Path,
    parameters: Mapping[str, float],
    records: Sequence[Record],
    how: Settings,
    tell: Progress,
    names: Sequence[str],
) -> Diagnosis:
    """Return the diagnosis of an FMU whose parameters are set."""
    called = str(fmu), plant.input.name, plant.output.name
    base, seen, known = fit_surrogate(plant, called, records, hold=how.input_hold, untimed=how.untimed, tell=tell)
    records, seen = ([without_remembered(y, memory_s(base)) for y in x] for x in (records, seen))
    plant.follow(records[0].time_s, records[0].further)
    plant.reset()
    original = Original(fmu, plant.input, plant.output, parameters, plant.read(), records[0].quantities)
    known = replace(known, start_values=tuple(parameters.items()))
    # behind an effect the FMU is elsewhere: only where the stand-in follows it there may several be sought at once
    is_led = known.difference_um > FOLLOWS_WITHIN * known.spread_um
    followed = SpaceMapping(original, records, known.differences_um, is_led)
    made: list[Container] = []

    def measured(search: SearchResult, findings: Findings) -> tuple[Measured, bytes]:
        gap, container = followed.measured(search, findings)
        made.append(container)
        return gap, container.fmu

    reason = why_none()
    box = BlackBox(lambda: followed.differences_um)
    if reason is None:
        box = replace(box, measured=measured)
        if not known.is_linear:
            leading = 1 if is_led else box.leading
            box = replace(box, leading=leading, again=followed.again, settled=followed.settled)
    found = diagnose(base, seen, how, tell, names, box)
    left = tuple(followed.differences_um)
    known = replace(known, differences_um=left, difference_um=size_um(left), no_container=reason)
    if reason is not None:
        return replace(found, stand_in=known, quantities=records[0].quantities)
    container = made[-1]
    known = replace(known, beside=container.beside, inner_step_s=container.step_s)
    return replace(found, stand_in=known, beside=container.files(), quantities=records[0].quantities)
