"""The gap of a corrected FMU, measured on the container that is written."""

import math
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bender_discrepancy.conclusion.findings import Findings
from bender_discrepancy.conclusion.gap import Measured, recalibrated_readings
from bender_discrepancy.conclusion.gap import compared as compared_stages
from bender_discrepancy.foreign.around import Original, Stages, inner_step_s, stages_around
from bender_discrepancy.records.observations import Observations
from bender_discrepancy.search.result import SearchResult
from bender_export.system import parameter_file
from bender_loop.errors import RunError
from bender_loop.fmu.watched import WatchedPlant
from bender_loop.records.between_rows import is_even
from bender_loop.records.raster import drive_raster, raster_step_s
from bender_loop.records.record import Record
from bender_native.build import Way
from bender_native.compilers import own_compiler, own_platform
from bender_native.container import Corrected, container_fmu, corrected_system, is_at_hand, parameters_of
from bender_plant.model import Model, ModelError

Array = NDArray[np.float64]
IDENTIFIER = "Corrected"
# part of a row
EVEN = 1e-3
SYSTEM, PARAMETERS = "model.ssp", "model.ssv"
NO_COMPILER = "a corrected FMU needs a C compiler (pip install 'piezo-bender[native]')"
NO_LIBRARY = "a corrected FMU needs fmu-manipulation-toolbox (pip install 'piezo-bender[container]')"


@dataclass(frozen=True, slots=True, eq=False)
class Container:
    """The corrected FMU.

    Attributes:
        fmu: its content; the original's own where nothing was corrected.
        system: an SSP archive with it; b"" where nothing was corrected.
        parameters: everything that was corrected, by name: `before.…`, `behind.…`, and `plant.…` of the original.
        step_s: its inner step; 0 where it has none.
        left_out: titles of what can stand on neither side of the original.
    """

    fmu: bytes
    system: bytes
    parameters: dict[str, float]
    step_s: float
    left_out: tuple[str, ...]

    def files(self) -> dict[str, bytes]:
        """Return what stands beside the FMU: the system that it is, and its parameters as a file."""
        if not self.system:
            return {}
        return {SYSTEM: self.system, PARAMETERS: parameter_file("corrected", {"": self.parameters})}


def why_none() -> str | None:
    """Return why no container can be made here, None where one can."""
    if own_compiler() is None or own_platform() is None:
        return NO_COMPILER
    return None if is_at_hand() else NO_LIBRARY


def measured_around(
    search: SearchResult, findings: Findings, original: Original, differences_um: list[Array]
) -> tuple[Measured, Container]:
    """Return the gap at its three stages, the last one measured by driving the container, and the container.

    Args:
        search: of the records without what FMU and stand-in differ by.
        findings: of the search.
        original: the FMU.
        differences_um: (n,) of every record, what FMU and stand-in differ by.

    Raises:
        RunError: the container could not be made, or fails.
    """
    given, recalibrated = recalibrated_readings(search)
    if findings.model is search.base:
        content = Container(original.path.read_bytes(), b"", dict(original.start_values), 0.0, ())
        return replace(compared_stages(search, given, recalibrated, given), is_corrected=False), content
    made: Container | None = None
    after = []
    own = findings.calibration.offsets_um[findings.of_record]
    apart = search.best.hypothesis.has_surroundings
    rows = zip(search.whole, differences_um, search.records, strict=True)
    for k, (seen, difference, record) in enumerate(rows):
        model = findings.model if not apart or k == findings.of_record else _around(search, findings.model, k)
        if made is None or apart:
            made = _made(search, model, original)
        reading = _driven(made, original, seen, record)
        after.append(reading - difference + findings.calibration.offsets_um[k] - own)
    if apart:
        made = _made(search, findings.model, original)
    assert made is not None
    return compared_stages(search, given, recalibrated, after), made


def _around(search: SearchResult, model: Model, record: int) -> Model:
    return search.best.hypothesis.around(model, record)


def _made(search: SearchResult, model: Model, original: Original) -> Container:
    try:
        stages = stages_around(search.base, model, original.rest_um)
    except (ModelError, ZeroDivisionError) as problem:
        raise RunError(f"{original.path}: the correction cannot be put around it ({problem})") from None
    rows = np.concatenate([np.diff(x.time_s) for x in search.whole])
    held = not search.settings.linear and all(x.command_time_s is None for x in search.records)
    held = held and all(is_even(x.time_s, EVEN) for x in search.whole)
    short_s = inner_step_s(search.base, float(np.median(rows)), rows.size)
    # an FMU that integrates in steps of its own then takes the same ones as without anything around it
    step_s = raster_step_s(search.whole[0].time_s, math.inf if held and stages.is_static else short_s)
    if stages.before is None and stages.behind is None and not original.start_values:
        return Container(original.path.read_bytes(), b"", {}, step_s, stages.left_out)
    return _contained(original, stages, step_s)


def _contained(original: Original, stages: Stages, step_s: float) -> Container:
    target = own_platform()
    assert target is not None
    corrected = Corrected(
        original.path, original.input, original.output, stages.before, stages.behind, original.rest, step_s,
        original.start_values,
    )  # fmt: skip
    fmu = container_fmu(corrected, Way(2, (target,)), IDENTIFIER)
    parameters = parameters_of(fmu)
    system = corrected_system(fmu, corrected, parameters)
    given = {f"plant.{name}": value for name, value in original.start_values.items()}
    return Container(fmu, system, given | parameters, step_s, stages.left_out)


def _driven(container: Container, original: Original, seen: Observations, record: Record) -> Array:
    drive = seen.drive
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "corrected.fmu"
        path.write_bytes(container.fmu)
        names = (original.input.name, original.output.name)
        with WatchedPlant(path, input_name=names[0], output_name=names[1], quantities=original.quantities) as plant:
            plant.follow(record.time_s, record.further)
            return drive_raster(plant, drive.row_time_s, *drive.path(drive.voltage_V), drive.linear, container.step_s)
