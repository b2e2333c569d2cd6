"""The model-following controller of a tuning as an FMU, and its closed loop around the model that it follows.

The FMU of the model is opened for its equations alone: FMUs of this project carry their model as
`resources/model.toml`. The controller runs that model inside, so it needs neither the FMU nor a library that loads it.
"""

import tomllib
import zipfile
from collections.abc import Callable
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any, NamedTuple

from bender_export.assembly import following_archive
from bender_export.build import plant_fmu, reference_fmu
from bender_export.content import following_content
from bender_export.slaves.following import TABLE
from bender_export.system import Loop, closed_loop_archive
from bender_loop.control.pid import Gains, Limits
from bender_loop.errors import InputError
from bender_loop.fmu.file import OWN_MODEL, read_description
from bender_loop.fmu.followed_model import FollowedModel, require_same
from bender_loop.fmu.following_models import neutral
from bender_loop.shell.files import prepare_directory, write_atomically
from bender_plant.model import Model, model_from_table
from bender_plant.parameter import ModelError

FOLLOWING_FMU, FOLLOWING_LOOP = "ModelFollowingController.fmu", "FollowingLoop.ssp"
_MOST_BYTES = 1 << 22
_PORTS = ("voltage", ("displacement", "tip_displacement"))
_WAY_OUT = (
    "expected one made by this project; tune with --follow-model on the model file of a diagnosis (bender tune --model "
    "model.toml), or run these gains as they are (bender hil --gains)"
)


@dataclass(frozen=True, slots=True)
class Tuned:
    """A controller as a gains file has it.

    Attributes:
        gains: of the PID block.
        limits: of the command.
        period_s: time between samples.
        model: what it follows.
    """

    gains: Gains
    limits: Limits
    period_s: float
    model: FollowedModel


@dataclass(frozen=True, slots=True)
class Host:
    """How the host of the FMU runs it.

    Attributes:
        latency_frames: age of a measurement, in samples, when the controller gets it.
        command_delay_s: from a measurement until the command acts.

    Raises:
        InputError: one is negative.
    """

    latency_frames: int = 0
    command_delay_s: float = 0.0

    def __post_init__(self) -> None:
        if self.latency_frames < 0 or not self.command_delay_s >= 0.0:
            raise InputError(
                f"found a latency of {self.latency_frames!r} samples and a delay of {self.command_delay_s!r} s, "
                "expected numbers of at least 0"
            )


class Makers(NamedTuple):
    """How the FMUs of a controller and its loop are made: of the settings and their model, of a model, of nothing."""

    controller: Callable[[dict[str, Any], Model], bytes]
    plant: Callable[[Model], bytes]
    reference: Callable[[], bytes]


def build_following(
    tuned: Tuned, fmu: Path, folder: Path, host: Host | None = None, makers: Makers | None = None
) -> tuple[Path, Path]:
    """Write the FMU of a model-following controller, and the SSP archive of its loop around the model.

    Args:
        tuned: the controller.
        fmu: the FMU of the model that it was tuned with.
        folder: where both go.
        host: how the FMU is run; in the archive each measurement is one sample old, whatever is said here.
        makers: of the FMUs; None for those that run in Python.

    Raises:
        InputError: the FMU is missing, another one or of another maker, a value does not fit, or the folder cannot be
            written; nothing is written then.
    """
    make = makers or Makers(following_fmu, plant_fmu, reference_fmu)
    model = followed_equations(tuned.model, fmu)
    settings = following_settings(tuned, model, host or Host())
    controller = make.controller(settings, model)
    # all components of a system step at the same time, each with what the others showed a step before; small importers
    # leave parameters as the FMU has them, so that it has them so
    in_system = following_settings(tuned, model, Host(latency_frames=1))
    loop = Loop("step", tuned.period_s, in_system["start"], FOLLOWING_FMU, settings["output"])
    plant = make.plant(model.with_values(settings["both"]))
    archive = closed_loop_archive(plant, make.controller(in_system, model), make.reference(), loop)
    outs = folder / FOLLOWING_FMU, folder / FOLLOWING_LOOP
    prepare_directory(folder)
    for out, data in zip(outs, (controller, archive), strict=True):
        write_atomically(out, data)
    return outs


def following_fmu(settings: dict[str, Any], model: Model) -> bytes:
    """Return the FMU of a model-following controller; the same settings give the same bytes.

    Args:
        settings: as `following_settings` gives them.
        model: the one in them.
    """
    return following_archive(settings, model, following_content(settings))


def following_settings(tuned: Tuned, model: Model, host: Host) -> dict[str, Any]:
    """Return what `slaves.following` is made of.

    Args:
        tuned: the controller.
        model: the equations of what it follows.
        host: how the FMU is run.

    Raises:
        InputError: a value does not fit.
    """
    followed = tuned.model
    both, left_out = neutral(model.values(), followed.parameters)
    bounds = followed.slew_V_per_s, followed.rate_um_per_s, followed.curvature_um_per_s2
    values = (
        *astuple(tuned.gains),
        *astuple(tuned.limits),
        *(0.0 if bound == float("inf") else bound for bound in bounds),
        float(followed.horizon_ticks),
        followed.held_back,
        followed.rms_um,
        followed.tolerance_um,
        tuned.period_s,
        float(host.latency_frames),
        host.command_delay_s,
    )
    rows = [row for row in TABLE if row.causality == "parameter"]
    for row, value in zip(rows, values, strict=True):
        if not (row.minimum <= value <= row.maximum and abs(value) < float("inf")):
            raise InputError(
                f"{row.name}: found {value!r}, expected a finite number from {row.minimum:g} to {row.maximum:g}"
            )
    if not host.command_delay_s < tuned.period_s:
        raise InputError(
            f"sampling.command_delay: found {host.command_delay_s!r} s, expected less than the period of "
            f"{tuned.period_s!r} s"
        )
    return {
        "model": model.to_table(),
        "both": both,
        "left_out": left_out,
        "output": followed.output,
        "lead_s": followed.lead_s,
        "start": dict(zip((row.name for row in rows), values, strict=True)),
    }


def followed_equations(followed: FollowedModel, fmu: Path) -> Model:
    """Return the model in the FMU that a gains file names.

    Raises:
        InputError: the FMU is missing, not the one that was tuned with, or not of this project.
    """
    require_same(followed, fmu)
    maker = read_description(fmu, needs_binary=False).generationTool or "a tool that does not say its name"
    text = _model_text(fmu)
    ports = f"{followed.input} → {followed.output}"
    if text is None or followed.input != _PORTS[0] or followed.output not in _PORTS[1] or followed.units:
        units = f" in {followed.units[0]} and {followed.units[1]}" if followed.units else ""
        what = "its equations" if text is not None else f"no equations ({OWN_MODEL})"
        raise InputError(f"{fmu}: found an FMU of {maker} with {what}, run from {ports}{units}, {_WAY_OUT}")
    try:
        return model_from_table(tomllib.loads(text.decode("utf-8")))
    except (ModelError, ValueError, TypeError, ArithmeticError) as problem:
        raise InputError(f"{fmu}: {OWN_MODEL}: {problem}; {_WAY_OUT}") from None


def model_inside(fmu: Path) -> Model | None:
    """Return the model in an FMU of this project; None in one of another maker.

    Raises:
        InputError: the file is missing or damaged, or is no FMU.
    """
    read_description(fmu, needs_binary=False)
    text = _model_text(fmu)
    try:
        return None if text is None else model_from_table(tomllib.loads(text.decode("utf-8")))
    except (ModelError, ValueError, TypeError, ArithmeticError):
        return None


def _model_text(fmu: Path) -> bytes | None:
    with zipfile.ZipFile(fmu) as archive:
        inside = OWN_MODEL in archive.namelist() and archive.getinfo(OWN_MODEL).file_size <= _MOST_BYTES
        return archive.read(OWN_MODEL) if inside else None
