"""Anybody's FMU as the model of a diagnosis: what stands in for it while effects are fitted.

The FMU is a black box. It is driven with the voltages of the records, and with levels of chance over their range and
rate. A linear model (gain, delay, lags, modes) that follows it there stands in for it, or, where the FMU is not linear,
one whose relaxation bends, see `relaxing`. What FMU and stand-in differ by under the voltage of a record is taken from
its readings. So the gap as given is that of the FMU itself, and an effect is computed by way of the stand-in: as
exactly as that follows the FMU, and to first order where it does not; `followed` goes on from there.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bender_compiled.simulation import Simulator
from bender_discrepancy.foreign.relaxation_model import fit_relaxation
from bender_discrepancy.foreign.slow_copy import with_slow_copy
from bender_identify.first_model.choice import first_model, select, structures_scored
from bender_identify.first_model.fit import CANNOT_BE, FirstFit, FitTask, fitted
from bender_identify.first_model.structures import Structure
from bender_identify.records.experiment import Experiment, experiment_of
from bender_identify.settings import Settings
from bender_inference.records.observations import observe
from bender_inference.records.stand_in import LINEAR_WITHIN, StandIn
from bender_loop.control.plant import Plant as RunningPlant
from bender_loop.errors import InputError, RunError
from bender_loop.records.drive import InputHold, drive_record
from bender_loop.records.record import Record
from bender_loop.records.replay import replay
from bender_plant.model import Model
from bender_report.wording import unit_text

Array = NDArray[np.float64]
Tell = Callable[[str], None]

ROWS = 2400
"""Of the run that the stand-in is fitted to: some hundred times the numbers that it has."""
LONGEST_HOLD_ROWS = 120
GRAIN = 1e-2
"""Noise added to that run, in parts of its spread: differences below it are taken from the readings, not fitted."""
FINER = (16, 256)
"""Between the rows the FMU is looked at with so much finer ones: what rings faster than a slow camera sees aliases."""
BETWEEN_WITHIN, WORSE_BETWEEN = 3.0 * GRAIN, 1.2
"""What a stand-in may be off by there, in parts of the spread and over what it is off by at the rows, before it is
fitted to these rows as well: one of an FMU that is not linear is off anyway."""
SLOWER = 3.0
"""A run of an FMU that is not linear lasts as long as the records: a slow relaxation shows in no shorter one."""
RELAXATION = "relaxation"
LEAST_DELAY_ROWS = 0.1
"""Of a row of the slowest run: a shorter delay is one of the grain."""
FOLLOWS_WITHIN = BETWEEN_WITHIN
"""Of the spread over the records: no other kind of stand-in is looked for where one follows the FMU within that."""


def fit_surrogate(
    fmu: RunningPlant,
    names: tuple[str, str, str],
    records: Sequence[Record],
    *,
    hold: InputHold = "hold",
    untimed: bool = False,
    tell: Tell = lambda _: None,
) -> tuple[Model, list[Record], StandIn]:
    """Return the stand-in, the records without what FMU and stand-in differ by, and what is known of both.

    Args:
        fmu: opened, reads µm.
        names: of the FMU, its input and its output.
        records: of one bench.
        hold: the voltage between two rows.
        untimed: time is only an order.
        tell: is told what is being done.

    Raises:
        InputError: the FMU does not answer the voltage, or no linear model follows it.
        RunError: the FMU failed.
    """
    tell("driving the FMU with the records")
    own = [replay(fmu, x, input_hold=hold, untimed=untimed).simulated_um for x in records]
    spread_um = math.sqrt(float(np.mean(np.concatenate([x - x.mean() for x in own]) ** 2)))
    if not spread_um > 0.0:
        unit = unit_text(records[0].quantities.reading)
        raise InputError(f"{names[0]}: {names[2]} stays at {own[0][0]:.4g} {unit} under the command of the records")
    tell("testing whether the FMU is linear")
    probe = _probe(records)
    answer, half, rest = (_answer(fmu, probe, factor, hold) for factor in (1.0, 0.5, 0.0))
    departure = _rms(answer - 2.0 * half + rest) / max(_rms(answer - answer.mean()), 1e-300)
    tell("fitting the stand-in for the FMU")
    undeclared = getattr(getattr(fmu, "output", None), "unit", "") is None

    def off(model: Model) -> list[Array]:
        return [y - _simulated(model, x, hold, untimed) for x, y in zip(records, own, strict=True)]

    model = None if departure < LINEAR_WITHIN else _bent(fmu, names[0], (probe, answer), records, hold)
    structure, differences = RELAXATION, [] if model is None else off(model)
    if model is None or _rms(np.concatenate(differences)) > FOLLOWS_WITHIN * spread_um:
        linear, name = _followed_between(
            fmu, names[0], [(probe, answer)], records, hold, undeclared, bends=departure >= LINEAR_WITHIN
        )
        others = off(linear)
        if model is None or _rms(np.concatenate(others)) <= _rms(np.concatenate(differences)):
            model, structure, differences = linear, name, others
    seen = [replace(x, displacement_um=x.displacement_um - d) for x, d in zip(records, differences, strict=True)]
    known = StandIn(*names, structure, departure, _rms(np.concatenate(differences)), spread_um)
    known = replace(known, differences_um=tuple(differences), further=tuple(x.name for x in records[0].further))
    return model, seen, known


def _rms(values: Array) -> float:
    return math.sqrt(float(np.mean(values**2)))


def _simulated(model: Model, record: Record, hold: InputHold, untimed: bool) -> Array:
    return Simulator(observe(record, hold != "hold", untimed, hold == "smooth").drive).run(model).reading_um


def _bent(
    fmu: RunningPlant, name: str, run: tuple[Record, Array], records: Sequence[Record], hold: InputHold
) -> Model | None:
    """Return a stand-in whose relaxation bends; None where it follows the FMU nowhere."""
    runs = [run]
    lasts_s = max(float(np.ptp(x.time_s)) for x in records)
    coarser = lasts_s / float(np.ptp(run[0].time_s))
    for finer in (*((1.0 / coarser,) if coarser > SLOWER else ()), *FINER):
        between = _probe(records, finer)
        try:
            runs.append((between, _answer(fmu, between, 1.0, hold)))
        except RunError:  # it refuses such short steps; one that has broken off says so the next time it is asked
            break
    try:
        dynamics = _fitted(name, runs[-1:], hold)[0].blocks
    except InputError:  # nothing linear follows it there
        dynamics = ()
    return fit_relaxation(runs, dynamics, hold)


def _followed_between(
    fmu: RunningPlant,
    name: str,
    runs: list[tuple[Record, Array]],
    records: Sequence[Record],
    hold: InputHold,
    undeclared: bool,
    *,
    bends: bool,
) -> tuple[Model, str]:
    """Return a linear model fitted to runs of the FMU at the rate of the records, and to finer ones where that helps.

    An effect moves what acts to instants between the rows, so the stand-in has to follow the FMU there as well, if the
    FMU takes steps as short as that.
    """
    model, structure = _fitted(name, runs, hold, undeclared, bends=bends)
    if not bends and (off := _off(model, *runs[0], hold)) > BETWEEN_WITHIN:
        richer = with_slow_copy(model, runs, hold)
        if richer is not None and _off(richer, *runs[0], hold) < 0.5 * off:
            model, structure = richer, f"{structure}+slow copy"
    for finer in FINER:
        between = _probe(records, finer)
        try:
            answer = _answer(fmu, between, 1.0, hold)
        except RunError:  # it refuses such short steps; one that has broken off says so the next time it is asked
            break
        off = _off(model, between, answer, hold)
        if off <= max(BETWEEN_WITHIN, WORSE_BETWEEN * _off(model, *runs[0], hold)):
            break
        try:
            again, other = _fitted(name, [*runs, (between, answer)], hold, undeclared, bends=bends)
        except InputError:  # nothing linear follows it at both rates
            break
        worse = any(_off(again, *x, hold) > _off(model, *x, hold) + GRAIN for x in runs)
        if worse or _off(again, between, answer, hold) > 0.5 * off:
            break
        model, structure, runs = again, other, [*runs, (between, answer)]
    return model, structure


def _off(model: Model, probe: Record, answer_um: Array, hold: InputHold) -> float:
    """Return the rms by which a model is off a run of the FMU, over the spread of that."""
    return _rms(answer_um - _simulated(model, probe, hold, False)) / max(_rms(answer_um - answer_um.mean()), 1e-300)


def _probe(records: Sequence[Record], finer: float = 1.0) -> Record:
    """Levels of chance, held for 1 to many rows, over the voltages and at the rate of the records; it begins at 0 V.

    A finer one has its rows closer together by that factor. Further inputs stay at their mean over the records.
    """
    rng = np.random.default_rng(0)
    low = min(float(x.voltage_V.min()) for x in records)
    high = max(float(x.voltage_V.max()) for x in records)
    step_s = float(np.median(np.concatenate([np.diff(x.time_s) for x in records]))) / finer
    rows = [0.0]
    while len(rows) < ROWS:
        length = round(math.exp(rng.uniform(0.0, math.log(LONGEST_HOLD_ROWS))))
        rows += [float(rng.uniform(low, high))] * length
    voltage_V = np.array(rows[:ROWS])
    times = step_s * np.arange(ROWS, dtype=np.float64)
    further = tuple(
        replace(x, values=np.full(ROWS, np.mean(np.concatenate([y.further[k].values for y in records]))))
        for k, x in enumerate(records[0].further)
    )
    return Record(times, voltage_V, np.zeros(ROWS), quantities=records[0].quantities, further=further)


def _of_real_delays(fit: FirstFit, runs: Sequence[tuple[Record, Array]]) -> tuple[Structure, Sequence[float]]:
    """Return structure and numbers of a fit without a delay that is a small part of a row.

    Fitted to the grain of a run, it is no delay of the FMU, but it would stand in the place of one that is missing.
    """
    row_s = max(float(np.median(np.diff(probe.time_s))) for probe, _ in runs)
    if not fit.structure.delay or fit.values[-1] >= LEAST_DELAY_ROWS * row_s:
        return fit.structure, fit.values
    return replace(fit.structure, delay=False), fit.values[:-1]


def _answer(fmu: RunningPlant, probe: Record, factor: float, hold: InputHold) -> Array:
    return drive_record(fmu, replace(probe, voltage_V=factor * probe.voltage_V), input_hold=hold)


def _linear_fit(experiments: Sequence[Experiment]) -> FirstFit:
    """Return the linear structure that follows an FMU that is linear: no nonlinear part is tried beside it.

    Whole runs are simulated: an excerpt begins at rest, where a plant that is slow beside it is not.
    """
    chosen = select(structures_scored(FitTask.of(experiments, rough=True))).fit
    task = FitTask.of(experiments)
    return fitted(task, chosen.structure, chosen.values, [x.fitted | x.held_out for x in experiments]) or chosen


def _fitted(
    name: str, runs: Sequence[tuple[Record, Array]], hold: InputHold, undeclared: bool = False, *, bends: bool = True
) -> tuple[Model, str]:
    rng = np.random.default_rng(1)
    quantities = runs[0][0].quantities
    try:
        read = [y + GRAIN * float(np.std(y)) * rng.standard_normal(y.size) for _, y in runs]
        records = [replace(probe, displacement_um=y) for (probe, _), y in zip(runs, read, strict=True)]
        experiments = [experiment_of(x, name, Settings(), hold) for x in records]
        fit = first_model(experiments).chosen if bends else _linear_fit(experiments)
        structure, values = _of_real_delays(fit, runs)
        model = structure.model(values, fit.gain, fit.offsets[0], Path(name).stem)
    except CANNOT_BE as problem:
        if undeclared:
            taken = quantities.stated[1] or "m"
            raise InputError(
                f"{name}: its output declares no unit and was taken in {taken}, with which no linear model follows it; "
                f"state the unit of the FMU as that of the record: --units s,V,mm ({problem})"
            ) from None
        raise InputError(
            f"{name}: no linear model follows it ({problem}), expected an FMU that answers its input by gain, delay, "
            "lags and modes"
        ) from None
    return model, structure.name
