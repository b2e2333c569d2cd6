"""What an FMU shows with corrections around it, without a container: it is driven once for each command.

What stands before the FMU makes another command of that of a record. The FMU is driven with it once, and all outputs
are read on the way; what stands behind or beside it is computed here, by the compiled chain. So any number of
corrections of any number of outputs costs one run of the FMU for each correction of the input, and no compiler.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.foreign.container_stages import Original, Stages, quickest_s, scaled, without_delay
from bender_inference.records.observations import Observations
from bender_loop.control.plant import Plant, Readable, Timed
from bender_loop.errors import RunError
from bender_loop.fmu.elsewhere import at_the_plant
from bender_loop.fmu.process.watched import WatchedPlant
from bender_loop.records.drive import drive
from bender_loop.records.record import Record
from bender_loop.tables.quantities import Quantities
from bender_plant.model import Model, ModelError

Array = NDArray[np.float64]
Other = tuple[str, Quantities]
"""Name and units of an output."""

PLACES = 4
"""Of a step at which a command that moves within it is looked at."""
SAME_INSTANT = 1e-9
"""Of a step: instants that are nearer are one."""
MOST_KEPT = 32
"""Answers: a fit of parameters asks for each once."""
STEPS_PER_ROW = 16
MOST_STEPS = 100_000
"""Of one run, where many are made."""
AS_IT_IS = scaled(None, 1.0, 0.0, 0.0)


@runtime_checkable
class _ManyOutputs(Plant, Readable, Timed, Protocol):
    def reader(self, output_name: str, quantities: Quantities, /) -> Callable[[], float]: ...


@dataclass(slots=True)
class _Listened:
    """A plant of which several outputs are kept, as they are after every step."""

    plant: _ManyOutputs
    readers: Sequence[Callable[[], float]]
    heard: list[list[float]] = field(default_factory=list)

    def reset(self) -> None:
        self.plant.reset()
        self.heard = [[read() for read in self.readers]]

    def begin_at(self, time_s: float) -> None:
        self.plant.begin_at(time_s)

    def read(self) -> float:
        return self.plant.read()

    def step(self, voltage_V: float, step_s: float) -> float:
        found = self.plant.step(voltage_V, step_s)
        self.heard.append([read() for read in self.readers])
        return found

    def close(self) -> None:
        self.plant.close()


@at_the_plant
def drive_outputs(plant: Plant, outputs: Sequence[Other], time_s: Array, voltage_V: Array) -> Array:
    """Drive a plant from rest with held commands; return several outputs at their instants, (outputs, n).

    Raises:
        RunError: the plant failed.
    """
    assert isinstance(plant, _ManyOutputs)
    listened = _Listened(plant, [plant.reader(*x) for x in outputs])
    drive(listened, time_s, voltage_V)
    return np.array(listened.heard).T


def opened(originals: Sequence[Original]) -> WatchedPlant:
    """Return the FMU of outputs with its parameters set.

    Raises:
        InputError, RunError: as `WatchedPlant` raises them.
    """
    first = originals[0]
    names = first.input.name, first.output.name
    plant = WatchedPlant(first.path, input_name=names[0], output_name=names[1], quantities=first.quantities)
    return plant.with_parameters(first.start_values)


def short_step_s(seen: Sequence[Observations], stages: Sequence[Stages], stand_ins: Sequence[Model]) -> float:
    """Return a step that an FMU is to be driven with at most, for what stands around it and for its own ringing.

    Where all of that is static, it takes the steps of the rows.
    """
    rows = np.concatenate([np.diff(x.time_s) for x in seen])
    row_s = float(np.median(rows))
    if all(x.is_static and x.inside is None for x in stages):
        return row_s
    needed_s = min(row_s / STEPS_PER_ROW, *(quickest_s(x) for x in stand_ins))
    return max(needed_s, row_s * rows.size / MOST_STEPS)


@dataclass(frozen=True, slots=True, eq=False)
class Answer:
    """What an FMU shows under one command.

    Attributes:
        time_s: (n,) instants.
        command_V: (n,) what it is given from each of them on.
        shown_um: (n,) of every output, by its name.
    """

    time_s: Array
    command_V: Array
    shown_um: Mapping[str, Array]


class Answers:
    """An FMU, in a process of its own, that is driven once for the same command and parameters.

    Args:
        plant: the FMU, opened with any of its outputs.
        originals: the FMU with each output that is read.

    Attributes:
        drives: how often it was driven.
        steps: that it did.
    """

    def __init__(self, plant: WatchedPlant, originals: Sequence[Original]) -> None:
        self._plant, self._any_step = plant, originals[0].takes_any_step
        self._outputs = tuple((x.output.name, x.quantities) for x in originals)
        self._parameters = dict(originals[0].start_values)
        self._kept: dict[tuple[object, ...], Answer] = {}
        self.drives = self.steps = 0

    def set_parameters(self, values: Mapping[str, float]) -> None:
        """Set parameters of the FMU for what is asked from now on."""
        self._plant.set_parameters(values)
        self._parameters |= values

    def answer(self, before: Model | None, seen: Observations, record: Record, step_s: float) -> Answer:
        """Return what the FMU shows under the command of a record behind a correction of it.

        Args:
            before: the correction; None for none.
            seen: the record.
            record: of further inputs.
            step_s: longest time between two instants.

        Raises:
            RunError: the FMU failed, or the correction has no answer.
        """
        times, volts = acting(before, seen, step_s, any_step=self._any_step)
        further = tuple((x.name, x.values.tobytes()) for x in record.further)
        key = (times.tobytes(), volts.tobytes(), further, tuple(sorted(self._parameters.items())))
        if key not in self._kept:
            self._plant.follow(record.time_s, record.further)
            shown = drive_outputs(self._plant, self._outputs, times, volts)
            self.drives, self.steps = self.drives + 1, self.steps + times.size - 1
            names = [name for name, _ in self._outputs]
            if len(self._kept) == MOST_KEPT:
                self._kept.pop(next(iter(self._kept)))
            self._kept[key] = Answer(times, volts, dict(zip(names, shown, strict=True)))
        return self._kept[key]

    def readings(
        self, name: str, rest_um: float, stages: Stages, seen: Observations, record: Record, step_s: float
    ) -> Array:
        """Return the readings (n,) of an output with corrections around the FMU, as a container would give them.

        Raises:
            RunError: the FMU failed, or a correction has no answer.
        """
        answer = self.answer(stages.before, seen, record, step_s)
        shown_um = answer.shown_um[name] + _beside(stages.inside, answer)
        row_s, exposure_s = seen.drive.row_time_s, seen.drive.exposure_s
        if stages.behind is None and exposure_s == 0.0:
            return np.interp(row_s, answer.time_s, shown_um)
        behind = stages.behind or AS_IT_IS
        moved = Drive(row_s, answer.time_s, shown_um - rest_um, linear=True, exposure_s=exposure_s)
        return rest_um + _run(behind, moved)


def _beside(inside: tuple[Model, Model] | None, answer: Answer) -> Array | float:
    """Return what a model with something that acts inside the FMU shows more than one without it."""
    if inside is None:
        return 0.0
    given = Drive(answer.time_s, answer.time_s, answer.command_V)
    return _run(inside[0], given) - _run(inside[1], given)


def acting(before: Model | None, seen: Observations, step_s: float, *, any_step: bool) -> tuple[Array, Array]:
    """Return instants (n,), at most a step apart, and the command that is held from each of them on.

    Where nothing but a delay and what is static stands before an FMU that takes any step, the instants of held
    commands are among them. Elsewhere the command is its mean over each step.

    Raises:
        RunError: the correction has no answer.
    """
    given = seen.drive
    begin_s = min(float(given.row_time_s[0]), float(given.command_time_s[0]))
    end_s = float(given.row_time_s[-1]) + 0.5 * given.exposure_s
    count = max(1, int(np.ceil((end_s - begin_s) / step_s * (1.0 - SAME_INSTANT))))
    raster = begin_s + step_s * np.arange(count + 1, dtype=np.float64)
    static, delay_s = without_delay(before)
    is_held = not (given.linear or given.smooth)
    if is_held and any_step and _has_no_memory(static):
        commands_s = given.command_time_s + delay_s
        volts = given.voltage_V
        if static is not None:
            soon_s = SAME_INSTANT + 1e-3 * float(np.min(np.diff(commands_s), initial=step_s))
            volts = _run(static, Drive(commands_s + soon_s, commands_s, volts))
        times = _once(np.concatenate([raster, commands_s, given.row_time_s]), step_s, end_s)
        place = np.searchsorted(commands_s, times + SAME_INSTANT * step_s, side="right") - 1
        return times, np.where(place < 0, 0.0, volts[np.maximum(place, 0)])
    within = (np.arange(PLACES) + 0.5) / PLACES
    places = (raster[:-1, None] + step_s * within).ravel()
    looked_at = Drive(places, given.command_time_s, given.voltage_V, given.linear, given.smooth)
    volts = _run(before or AS_IT_IS, looked_at).reshape(count, PLACES).mean(axis=1)
    return raster, np.append(volts, volts[-1])


def _once(times: Array, step_s: float, end_s: float) -> Array:
    """Return times in their order, those of one instant once, none behind the end."""
    found = np.sort(times[times <= end_s * (1.0 + SAME_INSTANT)])
    return found[np.append(True, np.diff(found) > SAME_INSTANT * step_s)]


def _has_no_memory(model: Model | None) -> bool:
    return Stages(model, None).is_static


def _run(model: Model, given: Drive) -> Array:
    try:
        return Simulator(given).run(model).reading_um
    except (ModelError, ArithmeticError) as problem:
        raise RunError(f"{model.name}: {problem}") from None
