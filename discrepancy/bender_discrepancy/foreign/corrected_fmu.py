"""The corrected FMU: the original with what was found around it, made and driven."""

import math
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.foreign.container_stages import Original, Stages, inner_step_s, stages_around, without_delay
from bender_export.system import parameter_file
from bender_inference.records.observations import Observations
from bender_inference.search.result import SearchResult
from bender_loop.errors import RunError
from bender_loop.fmu.process.watched import WatchedPlant
from bender_loop.records.between_rows import is_even
from bender_loop.records.drive import dense, drive
from bender_loop.records.raster import drive_raster, raster_step_s
from bender_loop.records.record import Record
from bender_loop.shell.extras import install_command
from bender_native.build import Way
from bender_native.compilers import own_compiler, own_platform
from bender_native.container import (
    Corrected,
    container_fmu,
    corrected_system,
    is_at_hand,
    parameter_values,
    parameters_of,
)
from bender_plant.model import Model, ModelError

Array = NDArray[np.float64]
IDENTIFIER = "Corrected"
# part of a row
EVEN = 1e-3
# of the shortest time between two commands: what is static is looked at so soon after each
SOON = 1e-3
SYSTEM, PARAMETERS = "model.ssp", "model.ssv"


@dataclass(frozen=True, slots=True, eq=False)
class Container:
    """The corrected FMU.

    Attributes:
        fmu: its content; the original's own where nothing was corrected.
        system: an SSP archive with it; b"" where nothing was corrected.
        parameters: everything that was corrected, by name: `before.…`, `behind.…`, `inside.…` beside `without.…`, and
            `plant.…` of the original.
        step_s: its inner step; 0 where it has none.
        beside: titles of what acts inside the original, and stands beside it.
    """

    fmu: bytes
    system: bytes
    parameters: dict[str, float]
    step_s: float
    beside: tuple[str, ...] = ()

    def files(self) -> dict[str, bytes]:
        """Return what stands beside the FMU: the system that it is, and its parameters as a file."""
        if not self.system:
            return {}
        return {SYSTEM: self.system, PARAMETERS: parameter_file("corrected", {"": self.parameters})}


def why_none() -> str | None:
    """Return why no container can be made here, None where one can."""
    if own_compiler() is None or own_platform() is None:
        return f"a corrected FMU needs a C compiler ({install_command('native')})"
    if is_at_hand():
        return None
    return f"a corrected FMU needs fmu-manipulation-toolbox ({install_command('container')})"


@dataclass(slots=True)
class Containers:
    """Containers by the names of what is in them: for other numbers nothing is compiled again."""

    made: dict[frozenset[str], Container] = field(default_factory=dict)

    def driven(
        self, search: SearchResult, model: Model, original: Original, seen: Observations, record: Record
    ) -> Array:
        """Return the readings (n,) of an FMU with what of a corrected stand-in stands around it.

        Where only a delay and what is static stand there, no container is needed: the FMU gets what they make of the
        commands at the very instants from which these act, and not on a raster.

        Raises:
            RunError: it could not be made, or failed.
        """
        corrected, stages = _around(search, model, original)
        if _is_direct(stages, original, search):
            return _driven_directly(stages, original, seen, record)
        values = parameter_values(corrected)
        container = self.made.get(frozenset(values))
        if container is None:
            container = self.made[frozenset(values)] = build_corrected_fmu(search, model, original)
        return driven_container(container, original, seen, record, values)


def build_corrected_fmu(search: SearchResult, model: Model, original: Original) -> Container:
    """Return the FMU with what of a corrected stand-in stands around it.

    Raises:
        RunError: it could not be made.
    """
    corrected, stages = _around(search, model, original)
    if stages.are_none and not original.start_values:
        return Container(original.path.read_bytes(), b"", {}, corrected.step_s)
    target = own_platform()
    assert target is not None
    fmu = container_fmu(corrected, Way(2, (target,)), IDENTIFIER)
    parameters = parameters_of(fmu)
    system = corrected_system(fmu, corrected, parameters)
    given = {f"plant.{name}": value for name, value in original.start_values.items()}
    return Container(fmu, system, given | parameters, corrected.step_s, stages.changed)


def _around(search: SearchResult, model: Model, original: Original) -> tuple[Corrected, Stages]:
    try:
        stages = stages_around(search.base, model, original.rest_um)
    except (ModelError, ZeroDivisionError) as problem:
        raise RunError(f"{original.path}: the correction cannot be put around it ({problem})") from None
    rows = np.concatenate([np.diff(x.time_s) for x in search.whole])
    held = not search.settings.linear and all(x.command_time_s is None for x in search.records)
    held = held and all(is_even(x.time_s, EVEN) for x in search.whole)
    once = _is_direct(stages, original, search)
    short_s = inner_step_s(original, search.base, float(np.median(rows)), rows.size, once=once)
    # an FMU that integrates in steps of its own then takes the same ones as without anything around it
    step_s = raster_step_s(search.whole[0].time_s, math.inf if held and stages.is_static else short_s)
    return Corrected(
        original.path, original.input, original.output, stages.before, stages.behind, original.rest, step_s,
        original.start_values, inside=stages.inside, units=original.taken_units,
    ), stages  # fmt: skip


def _is_direct(stages: Stages, original: Original, search: SearchResult) -> bool:
    """Return whether the FMU can be given what stands before it at the instants of held commands."""
    held = not search.settings.linear and not search.settings.smooth
    return stages.only_delay and held and original.takes_any_step


def _driven_directly(stages: Stages, original: Original, seen: Observations, record: Record) -> Array:
    """Return the readings (n,) of an FMU behind a delay and what is static, and before what is static.

    Raises:
        RunError: the FMU failed, or what stands around it has no answer.
    """
    before, delay_s = without_delay(stages.before)
    command_s, voltage_V = seen.drive.path(seen.drive.voltage_V)
    acting_V = _static(before, command_s, voltage_V)
    exposure_s = seen.drive.exposure_s
    times, volts, read = dense(
        seen.drive.row_time_s, command_s + delay_s, acting_V, linear=False, exposure_s=exposure_s
    )
    names = (original.input.name, original.output.name)
    opened = WatchedPlant(original.path, input_name=names[0], output_name=names[1], quantities=original.quantities)
    with opened.with_parameters(original.start_values) as plant:
        plant.follow(record.time_s, record.further)
        shown_um = drive(plant, times, volts)
    if stages.behind is not None:
        shown_um = original.rest_um + _static(stages.behind, times, shown_um - original.rest_um)
    return read.readings(shown_um)


def _static(model: Model | None, time_s: Array, values: Array) -> Array:
    """Return what a model without memory makes of values (n,) at their times; the values themselves of None."""
    if model is None or values.size == 0:
        return values
    soon_s = SOON * float(np.min(np.diff(time_s))) if time_s.size > 1 else 1.0
    try:
        return Simulator(Drive(time_s + soon_s, time_s, values)).run(model).reading_um
    except (ModelError, ArithmeticError) as problem:
        raise RunError(f"{model.name}: {problem}") from None


def driven_container(
    container: Container,
    original: Original,
    seen: Observations,
    record: Record,
    values: Mapping[str, float] | None = None,
) -> Array:
    """Return the readings (n,) of a container under the voltage of a record, with other values of its parameters.

    Raises:
        RunError: it failed.
    """
    drive = seen.drive
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "corrected.fmu"
        path.write_bytes(container.fmu)
        names = (original.input.name, original.output.name)
        opened = WatchedPlant(path, input_name=names[0], output_name=names[1], quantities=original.quantities)
        with opened.with_parameters(values or {}) as plant:
            plant.follow(record.time_s, record.further)
            path = drive.path(drive.voltage_V)
            return drive_raster(plant, drive.row_time_s, *path, drive.linear, container.step_s, drive.exposure_s)
