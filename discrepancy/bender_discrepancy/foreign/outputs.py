"""The diagnosis of several outputs of one FMU: each by itself, and all together (see `joint_explanations`)."""

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bender_discrepancy.conclusion.sentences import title_of
from bender_discrepancy.diagnosis import Diagnosis
from bender_discrepancy.foreign.answers import AS_IT_IS, STEPS_PER_ROW, Answers, opened
from bender_discrepancy.foreign.container_stages import (
    Original,
    Stages,
    acts_inside,
    inner_step_s,
    quickest_s,
    scaled,
    stages_around,
)
from bender_discrepancy.foreign.corrected_fmu import IDENTIFIER, why_none
from bender_discrepancy.foreign.diagnose import diagnose_fmu
from bender_discrepancy.foreign.joint_explanations import (
    NOTHING,
    Correction,
    JointExplanation,
    Output,
    OutputResidual,
    RankedExplanations,
    corrections,
    output_of,
    rank_explanations,
)
from bender_discrepancy.foreign.shared_parameters import Bench, diagnose_beside
from bender_discrepancy.foreign.suspects import suspects_of
from bender_export.system import parameter_file
from bender_inference.fitting.criterion import price, very_strong
from bender_inference.fitting.fit_problem import Calibration, calibrated
from bender_inference.records.observations import Observations
from bender_inference.search.search import Progress
from bender_inference.settings import Settings
from bender_loop.errors import InputError, RunError
from bender_loop.fmu.process.watched import WatchedPlant
from bender_loop.records.raster import drive_raster, raster_step_s
from bender_loop.records.record import Record
from bender_native.build import Way as Made
from bender_native.compilers import own_platform
from bender_native.container import Behind, Corrected, container_fmu, corrected_system, parameters_of
from bender_plant.parameter import ModelError
from bender_report.wording import quantity

Array = NDArray[np.float64]
MOST_STEPS = 400_000
"""Of the FMU while outputs are weighed together: some ten seconds of one that runs in Python."""
FEWEST_STEPS_PER_ROW = 4
FEWEST_DRIVEN = 3
MOST_EVALUATIONS = 15
FAR_OFF = 1e6


@dataclass(frozen=True, slots=True, eq=False)
class Together:
    """What several outputs say of one FMU.

    Attributes:
        by_itself: the diagnosis of each output, by its name.
        ranked: the ways to explain them together.
        files: the corrected FMU of all outputs, its system and its parameters, by file name; none where there is none.
        after: what the corrected FMU leaves of each output on held-out readings; none without it.
        why_no_fmu: why there is no corrected FMU of all outputs; None where there is.
        needing_inside: outputs that nothing around the FMU explains; None for all that found something inside.
        parameters: suspected ones that were off: name, value as given, value found, standard deviation, unit.
        notes: what the corrected FMU changes of an output on which nothing acts, a sentence each.
    """

    by_itself: Mapping[str, Diagnosis]
    ranked: RankedExplanations
    files: Mapping[str, bytes]
    after: Mapping[str, float]
    why_no_fmu: str | None = None
    needing_inside: frozenset[str] | None = None
    parameters: tuple[tuple[str, float, float, float, str], ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def best(self) -> JointExplanation:
        """The way that the readings favour."""
        return self.ranked.best

    @property
    def own(self) -> dict[str, tuple[str, ...]]:
        """What acts on one output alone, by its name."""
        if self.best.each:
            return {name: tuple(x.id for x in found.added) for name, found in self.by_itself.items()}
        return {name: x.effects for name, x in self.best.behind.items()}

    @property
    def inside(self) -> dict[str, tuple[str, ...]]:
        """What acts inside the FMU by the readings of an output, by its name: neither shared nor of that output."""
        found = {
            name: tuple(x.id for x in one.added if acts_inside(x.id, one.model))
            for name, one in self.by_itself.items()
            if self.needing_inside is None or name in self.needing_inside
        }
        return {name: effects for name, effects in found.items() if effects}

    @property
    def complete(self) -> bool:
        """Whether nothing above the noise stays unexplained on any output."""
        return all(x.is_complete for x in self.by_itself.values())

    @property
    def verdict(self) -> str:
        """The contract's word for all outputs together."""
        if self.ranked.rivals():
            return "ambiguous"
        words = [x.verdict for x in self.by_itself.values()]
        if self.best.effects or any(self.own.values()) or self.inside:
            return "named"
        words += ["recalibrated"] if self.parameters else []
        return next((x for x in ("unexplained", "recalibrated") if x in words), "no_gap")


def diagnose_outputs(
    fmu: Path | str,
    input_name: str | None,
    records: Mapping[str, Sequence[Record]],
    settings: Settings | None = None,
    progress: Progress | None = None,
    names: Sequence[str] = (),
    parameters: Mapping[str, float] | None = None,
    keep: Callable[[str, Diagnosis], None] = lambda _name, _diagnosis: None,
    suspects: Sequence[str] = (),
) -> Together:
    """Return what the records of one bench say about several outputs of an FMU.

    Args:
        fmu: as in `diagnose_fmu`, like the input and the parameters.
        input_name: the variable that takes the command.
        records: of one bench, with the readings of each output, by the name of the variable.
        settings: as in `workflow.diagnose`.
        progress: is told what is being done.
        names: of the records or their files.
        parameters: of the FMU, by name, in its own units.
        keep: is given the diagnosis of each output when it is ready.
        suspects: parameters of the FMU that may be off, as `--suspect` has them: one value for all outputs.

    Raises:
        InputError, RunError, Interrupted: as `diagnose_fmu` raises them.
        InputError: there are not two outputs.
    """
    if len(records) < 2:
        raise InputError(f"--output: found {len(records)}, expected at least two outputs to weigh together")
    how, tell, given = settings or Settings(), progress or (lambda _: None), dict(parameters or {})
    how = replace(how, decide_hold=False)
    reason = why_none()
    if reason is not None:
        raise RunError(f"{fmu}: several outputs are weighed through corrected FMUs; {reason}")
    suspected = suspects_of(Path(fmu), suspects, given)
    originals = {x: _original(Path(fmu), input_name, x, own, given) for x, own in records.items()}

    def alone(name: str, values: Mapping[str, float]) -> Diagnosis:
        def say(text: str) -> None:
            tell(f"{name}{_at(values)}: {text}")

        return diagnose_fmu(fmu, input_name, name, records[name], how, say, names, given | dict(values))

    found: dict[str, Diagnosis] = {}
    moved: dict[str, float] = {}
    if suspected:
        bench = Bench(originals, records, how, suspected, lambda values: {x: alone(x, values) for x in records}, tell)
        found, moved = diagnose_beside(bench)
        originals = {x: _original(Path(fmu), input_name, x, own, given | moved) for x, own in records.items()}
    for name in records:
        found[name] = found[name] if name in found else alone(name, {})
        keep(name, found[name])
    outputs = [output_of(diagnosis, originals[name]) for name, diagnosis in found.items()]
    chosen, needing = _weighed(outputs, how, tell)
    tell("driving the corrected FMU of all outputs")
    known = outputs[0].diagnosis.stand_in
    off = known.suspected.moved if known is not None and known.suspected is not None else ()
    return replace(_together(found, outputs, chosen, needing), needing_inside=needing, parameters=off)


def _at(values: Mapping[str, float]) -> str:
    told = ", ".join(f"{name} at {value:.4g}" for name, value in values.items())
    return f" with {told}" if told else ""


def _original(
    fmu: Path, input_name: str | None, output: str, records: Sequence[Record], parameters: Mapping[str, float]
) -> Original:
    own = records[0].quantities
    with WatchedPlant(fmu, input_name=input_name, output_name=output, quantities=own) as opened:
        plant = opened.with_parameters(parameters)
        plant.follow(records[0].time_s, records[0].further)
        plant.reset()
        return Original(fmu, plant.input, plant.output, dict(parameters), plant.read(), own)


def _weighed(outputs: Sequence[Output], how: Settings, tell: Progress) -> tuple[RankedExplanations, frozenset[str]]:
    """Return the ways to explain all outputs, and the outputs that need what acts inside the FMU.

    The FMU is driven once for every correction before it.
    """
    competing = affordable(corrections(outputs), outputs)
    rows = _rows(outputs)
    left: dict[tuple[str, int, int], OutputResidual] = {}
    fitted: dict[tuple[str, int, int], Correction] = {}
    originals = [x.original for x in outputs]
    with opened(originals) as plant:
        answers = Answers(plant, originals)
        step_s = _weighing_step_s(outputs, len(competing) + len(outputs))
        steps = round(sum(float(np.ptp(x.time_s)) for x in rows) / step_s)
        tell(f"weighing the outputs together: {len(competing)} corrections of the input, {steps} steps of the FMU each")
        for place, (shared, source) in enumerate(competing):
            named = " and ".join(title_of(y) for y in shared.effects) or "nothing"
            tell(f"weighing {place + 1} of {len(competing)}: {named} before the FMU ({_of(source)}), every output read")
            for x in outputs:
                for k, behind in enumerate(x.behind):
                    read = partial(_around, answers, x, shared, step_s=step_s)
                    key = x.name, place, k
                    fitted[key], left[key] = _nearest(x, behind, read)
        own = {x.name: _left(x, _around(answers, x, x.before[0], x.behind[0], step_s)) for x in outputs}
        needing = _needing_their_inside(outputs, left, fitted, answers, step_s, how.confidence)
    return rank_explanations(outputs, left, own, how.confidence, competing, fitted), needing


def _nearest(
    output: Output, behind: Correction, read: Callable[[Correction], list[Array]]
) -> tuple[Correction, OutputResidual]:
    """Return a correction behind the FMU with its numbers where they leave least of the FMU's own answer.

    They were found by way of the stand-in, whose own numbers may have given way. The FMU is not driven for it.
    """
    from scipy.optimize import least_squares

    best = behind, _left(output, read(behind))
    parts = behind.parts
    if not parts or any(x.form.records > 1 for x in parts):
        return best
    free = [x for part in parts for x in part.form.free]
    start = np.array([f.inward(v) for f, v in zip(free, (v for part in parts for v in part.values), strict=True)])

    def at(point: Array) -> Correction:
        values = [f.outward(float(p)) for f, p in zip(free, point, strict=True)]
        model, own = AS_IT_IS, []
        for part in parts:
            mine, values = tuple(values[: len(part.values)]), values[len(part.values) :]
            model = part.form.apply(model, mine)
            own.append(replace(part, values=mine))
        return replace(behind, stages=model, parts=tuple(own))

    def residual(point: Array) -> Array:
        try:
            return _innovations(output, read(at(point)))
        except (RunError, ModelError):
            return np.full(size, FAR_OFF)

    try:
        size = _innovations(output, read(behind)).size
        point = least_squares(residual, start, x_scale="jac", max_nfev=MOST_EVALUATIONS, diff_step=1e-4).x
        there = at(point)
        left = _left(output, read(there))
    except (RunError, ModelError, ValueError):
        return best
    return (there, left) if left.cost < best[1].cost else best


def _needing_their_inside(
    outputs: Sequence[Output],
    left: Mapping[tuple[str, int, int], OutputResidual],
    fitted: Mapping[tuple[str, int, int], Correction],
    answers: Answers,
    step_s: float,
    confidence: float,
) -> frozenset[str]:
    """Return the outputs whose readings are met by something inside the FMU only, not by what stands around it."""
    found = []
    for x in outputs:
        search = x.diagnosis.findings.search
        stages = stages_around(search.base, x.diagnosis.findings.model, x.original.rest_um)
        if stages.inside is None:
            continue
        inside = _left(x, _read_around(answers, x, stages, step_s)).cost
        inside += price(search.best.hypothesis.free_count, x.rows)
        around = [left[key].cost + price(fitted[key].count, x.rows) for key in left if key[0] == x.name]
        if inside < min(around) - very_strong(confidence):
            found.append(x.name)
    return frozenset(found)


def affordable(
    competing: Sequence[tuple[Correction, tuple[str, ...]]], outputs: Sequence[Output]
) -> list[tuple[Correction, tuple[str, ...]]]:
    """Return the corrections that can be driven within the budget: what an output prefers goes first."""
    rows = sum(x.time_s.size for x in _rows(outputs))
    most = max(FEWEST_DRIVEN, MOST_STEPS // (rows * FEWEST_STEPS_PER_ROW))
    if len(competing) <= most:
        return list(competing)
    first = {id(x.before[0]) for x in outputs}
    order = sorted(competing, key=lambda x: not (x[0] is NOTHING or len(x[1]) > 1 or id(x[0]) in first))
    return order[:most]


def _rows(outputs: Sequence[Output]) -> Sequence[Observations]:
    return outputs[0].diagnosis.findings.search.whole


def _weighing_step_s(outputs: Sequence[Output], runs: int) -> float:
    """Return a step that the budget allows in every run, and that is no shorter than the corrections need."""
    seen = _rows(outputs)
    rows = sum(x.time_s.size for x in seen)
    row_s = float(np.median(np.concatenate([np.diff(x.time_s) for x in seen])))
    needed_s = min(row_s / STEPS_PER_ROW, *(quickest_s(x.diagnosis.findings.search.base) for x in outputs))
    parts = min(row_s / needed_s, max(MOST_STEPS / (rows * runs), FEWEST_STEPS_PER_ROW))
    return raster_step_s(seen[0].time_s, row_s / parts)


def _of(source: Sequence[str]) -> str:
    return f"numbers of {', '.join(source)}" if source else "as given"


def _innovations(output: Output, readings: list[Array]) -> Array:
    """Return what an output leaves beside simulated readings (n,) of every record, whitened, with its own gain."""
    search = output.diagnosis.findings.search
    seen, line = search.problem.observations, _line(output, readings)
    simulated = [y[rows] for y, rows in zip(readings, search.searched, strict=True)]
    residuals = [
        x.beyond(x.measured_um - line.gain * y - c) for x, y, c in zip(seen, simulated, line.offsets_um, strict=True)
    ]
    return np.concatenate([f.innovations(r) for f, r in zip(search.grades.by.filters, residuals, strict=True)])


def _line(output: Output, readings: list[Array]) -> Calibration:
    search = output.diagnosis.findings.search
    simulated = [y[rows] for y, rows in zip(readings, search.searched, strict=True)]
    return calibrated(search.problem.observations, simulated)


def _left(output: Output, readings: list[Array]) -> OutputResidual:
    """Return what an output leaves beside simulated readings (n,) of every record."""
    search = output.diagnosis.findings.search
    by, line = search.grades.by, _line(output, readings)
    square = float(np.sum(_innovations(output, readings) ** 2))
    cost = by.effective_rows * float(np.log(max(square, 1e-300) / by.rows))
    return OutputResidual(
        cost, _rms(search.whole, readings, line), line.gain, line.offsets_um[output.diagnosis.findings.of_record]
    )


def _rms(whole: Sequence[Observations], readings: Sequence[Array], line: Calibration) -> float:
    """Return the rms on held-out readings."""
    left = [
        (x.measured_um - line.gain * y - offset)[x.reporting]
        for x, y, offset in zip(whole, readings, line.offsets_um, strict=True)
    ]
    return float(np.sqrt(np.mean(np.concatenate(left) ** 2)))


def _around(answers: Answers, output: Output, before: Correction, behind: Correction, step_s: float) -> list[Array]:
    """Return the readings (n,) of every record with corrections around the FMU.

    What the stand-in differs by is taken from them, as it was from the records.
    """
    return _read_around(answers, output, Stages(before.stages, behind.stages), step_s)


def _read_around(answers: Answers, output: Output, stages: Stages, step_s: float) -> list[Array]:
    search, known, original = output.diagnosis.findings.search, output.diagnosis.stand_in, output.original
    assert known is not None
    return [
        answers.readings(original.output.name, original.rest_um, stages, x, record, step_s) - d
        for x, d, record in zip(search.whole, known.differences_um, search.records, strict=True)
    ]


def _read(output: Output, content: bytes, step_s: float) -> list[Array]:
    search, known, original = output.diagnosis.findings.search, output.diagnosis.stand_in, output.original
    assert known is not None
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "corrected.fmu"
        file.write_bytes(content)
        names = original.input.name, original.output.name
        with WatchedPlant(file, input_name=names[0], output_name=names[1], quantities=original.quantities) as plant:
            found = []
            for x, d, record in zip(search.whole, known.differences_um, search.records, strict=True):
                plant.follow(record.time_s, record.further)
                path = x.drive.path(x.drive.voltage_V)
                drive = x.drive
                found.append(drive_raster(plant, drive.row_time_s, *path, drive.linear, step_s, drive.exposure_s) - d)
            return found


def _step_s(outputs: Sequence[Output]) -> float:
    """Return an inner step that is short enough for every output."""
    found = []
    for x in outputs:
        search = x.diagnosis.findings.search
        rows = np.concatenate([np.diff(y.time_s) for y in search.whole])
        found.append(
            raster_step_s(
                search.whole[0].time_s, inner_step_s(x.original, search.base, float(np.median(rows)), rows.size)
            )
        )
    return min(found)


def _container(outputs: Sequence[Output], before: Correction, behind: Mapping[str, Correction], step_s: float) -> bytes:
    corrected = _corrected(outputs, before, behind, step_s)
    target = own_platform()
    assert target is not None
    if corrected.before is None and corrected.behind is None and not corrected.further and not corrected.start_values:
        return corrected.original.read_bytes()
    return container_fmu(corrected, Made(2, (target,)), IDENTIFIER)


def _corrected(
    outputs: Sequence[Output], before: Correction, behind: Mapping[str, Correction], step_s: float
) -> Corrected:
    first, *others = outputs
    further = [(x, behind[x.name].stages) for x in others]
    original = first.original
    units = {name: unit for x in outputs for name, unit in x.original.taken_units.items()}
    return Corrected(
        original.path, original.input, original.output, before.stages, behind[first.name].stages, original.rest, step_s,
        original.start_values, further=tuple(Behind(x.original.output, y, x.original.rest) for x, y in further if y),
        units=units,
    )  # fmt: skip


def _together(
    found: Mapping[str, Diagnosis], outputs: Sequence[Output], chosen: RankedExplanations, needing: frozenset[str]
) -> Together:
    best = chosen.best
    if best.each:
        reason = "each output has a correction of the input of its own: one FMU cannot have them all"
        return Together(found, chosen, {}, {}, reason)
    if best.apart:
        named = ", ".join(sorted(best.apart))
        reason = f"{named} has an effect on the input that other outputs contradict: one FMU cannot have both"
        return Together(found, chosen, {}, {}, reason)
    if inside := Together(found, chosen, {}, {}, needing_inside=needing).inside:
        said = ", ".join(sorted({title_of(x) for effects in inside.values() for x in effects}))
        reason = f"{said} acts inside the FMU: the corrected FMU of each output by itself has it beside the original"
        return Together(found, chosen, {}, {}, reason)
    step_s = _step_s(outputs)
    behind = {x.name: _with_line(x, best) for x in outputs}
    if best.shared is NOTHING and all(x is NOTHING for x in behind.values()):
        return Together(found, chosen, {}, {}, "nothing was corrected")
    content = _container(outputs, best.shared, behind, step_s)
    after = {x.name: _left(x, _read(x, content, step_s)).rms for x in outputs}
    changed = {x.name: change for x in outputs if (change := _spoilt(x, after[x.name])) > 0.0}
    worse = [x.name for x in outputs if changed.get(x.name, 0.0) > _allowed(x, best)]
    if worse:
        reason = f"calibration alone leaves less of {', '.join(worse)} than the corrected FMU"
        return Together(found, chosen, {}, after, reason)
    corrected, parameters = _corrected(outputs, best.shared, behind, step_s), parameters_of(content)
    files = {
        "model.fmu": content,
        "model.ssp": corrected_system(content, corrected, parameters),
        "model.ssv": parameter_file("corrected", {"": parameters}),
    }
    notes = tuple(
        f"nothing acts on {x.name}; by itself the FMU answers differently to steps of {step_s:g} s, as the corrected "
        f"one takes them: {quantity(changed[x.name], x.diagnosis.quantities.reading)} rms"
        for x in outputs
        if x.name in changed
    )
    return Together(found, chosen, files, after, notes=notes)


def _spoilt(output: Output, after: float) -> float:
    """Return the rms by which a corrected FMU leaves more of an output than calibration alone, 0 where it does not."""
    before = output.diagnosis.gap.recalibrated.rms_um
    return 0.0 if after <= before + 1e-2 * output.floor else float(np.sqrt(after**2 - before**2))


def _allowed(output: Output, way: JointExplanation) -> float:
    """Return how much more may be left of an output.

    Where nothing acts on it, only the FMU's own answer to shorter communication steps can differ: of that as much may
    stay as nobody misses. What acts has to pay.
    """
    if way.effects or way.behind[output.name].effects:
        return 0.0
    search = output.diagnosis.findings.search
    return search.settings.relevant * max(float(np.ptp(x.measured_um[x.reporting])) for x in search.whole)


def _with_line(output: Output, way: JointExplanation) -> Correction:
    """Return what acts behind an output, with gain and offset that it has beside the correction that all share."""
    known, behind = way.left[output.name], way.behind[output.name]
    if output.diagnosis.verdict == "no_gap":
        return behind
    return replace(behind, stages=scaled(behind.stages, known.gain, known.offset, output.original.rest_um))
