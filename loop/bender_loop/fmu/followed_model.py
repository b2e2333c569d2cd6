"""A model that a controller follows, as data, and the controller that it makes in a loop."""

import atexit
import contextlib
import hashlib
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from bender_loop.control.following_loop import simulate_following
from bender_loop.control.model_following import ModelFollower
from bender_loop.control.pid import Gains, Limits
from bender_loop.control.plant import Plant
from bender_loop.control.references import Reference
from bender_loop.control.sampling import Sampling
from bender_loop.control.shaper import Shaper
from bender_loop.control.trace import Trace
from bender_loop.errors import InputError
from bender_loop.fmu.elsewhere import at_the_plant
from bender_loop.fmu.following_models import FollowingModels, open_following_models
from bender_loop.tables.quantities import USUAL, Quantities


@dataclass(frozen=True, slots=True)
class FollowedModel:
    """A model's FMU, and how it is followed.

    Attributes:
        fmu: name of the FMU, relative to the file that says so.
        sha256: of the FMU.
        input: the variable that takes the command.
        output: the variable that is read.
        rate_um_per_s: of the shaper.
        curvature_um_per_s2: of the shaper.
        horizon_ticks: of the inverse.
        lead_s: dead time that the horizon reaches beyond.
        dead_time_s: of the model, by which a known reference is previewed.
        tolerance_um: of the inverse.
        slew_V_per_s: bound of the command's rate that it was tuned with, inf for none.
        left_out: parameters of the model that is inverted, by FMI name.
        parameters: of both models, where they are not the FMU's own.
        units: the command's, the reading's, and those stated for variables without one; empty for V and µm.
        rms_um: rms of the model's residual on held-out rows, 0 where it was not measured.
        preview_horizon_ticks: of the inverse where the reference is known beforehand, 0 for the same.
        held_back: part of a movement to a set-point that is not known beforehand, which is left to the PID block.
    """

    fmu: str
    sha256: str
    input: str
    output: str
    rate_um_per_s: float
    curvature_um_per_s2: float
    horizon_ticks: int
    lead_s: float
    dead_time_s: float
    tolerance_um: float
    slew_V_per_s: float = math.inf
    left_out: dict[str, float] = field(default_factory=dict)
    parameters: dict[str, float] = field(default_factory=dict)
    units: tuple[str, ...] = ()
    rms_um: float = 0.0
    preview_horizon_ticks: int = 0
    held_back: float = 0.0

    def __post_init__(self) -> None:
        Shaper(self.rate_um_per_s, self.curvature_um_per_s2)
        if self.units and len(self.units) != 4:
            raise ValueError(f"units must be none or four, found {self.units!r}")
        if not 0.0 <= self.held_back < 1.0:
            raise ValueError(f"held_back must be from 0 to below 1, found {self.held_back!r}")


def followed_model(table: dict[str, Any]) -> FollowedModel:
    """Return the model that a table describes, as a file or a journal has it: lists for tuples, None for infinity.

    Raises:
        TypeError, ValueError: the table does not describe one.
    """
    slew = table.get("slew_V_per_s")
    told = table | {"units": tuple(table.get("units", ())), "slew_V_per_s": math.inf if slew is None else slew}
    for name in ("rate_um_per_s", "curvature_um_per_s2"):
        told[name] = math.inf if told[name] is None else told[name]
    return FollowedModel(**told)


@dataclass(frozen=True, slots=True)
class Loop:
    """How the host of a controller runs it, where that is not what the tuning assumed.

    Attributes:
        period_s: time between samples.
        limits: of the command.
        slew_V_per_s: bound of the command's rate.
        latency_frames: age of a measurement when the controller gets it.
        frame_weights: of the predicted readings in a frame.
        command_delay_s: from a measurement until the command acts.
        preview: the reference is known beforehand, and not shaped.
    """

    period_s: float
    limits: Limits
    slew_V_per_s: float
    latency_frames: int = 0
    frame_weights: tuple[float, ...] = (1.0,)
    command_delay_s: float = 0.0
    preview: bool = False


def horizon_ticks(model: FollowedModel, loop: Loop) -> int:
    """Return so many samples ahead the inverse meets the reference in a loop."""
    return (loop.preview and model.preview_horizon_ticks) or model.horizon_ticks


def look_ahead_s(model: FollowedModel, loop: Loop) -> float:
    """Return how long before its instant a controller wants a reference that is known beforehand."""
    return loop.command_delay_s + horizon_ticks(model, loop) * loop.period_s + model.dead_time_s


@at_the_plant
def describe_model(
    plant: Plant,
    path: Path,
    tolerance_um: float,
    slew_V_per_s: float,
    input_name: str | None,
    output_name: str | None,
    parameters: dict[str, float],
    quantities: Quantities,
) -> FollowedModel:
    """Return what there is to say of the model in an FMU before it is tuned: unshaped, inverted one sample ahead.

    Args:
        plant: says in which process the FMU is opened.
        path: the FMU.
        tolerance_um: of the inverse.
        slew_V_per_s: bound of the command's rate, inf for none.
        input_name: as in `FmuPlant`.
        output_name: as in `FmuPlant`.
        parameters: values by FMI name, where they are not the FMU's own.
        quantities: as in `FmuPlant`.

    Raises:
        InputError: the FMU cannot save its state.
        RunError: the FMU fails.
    """
    del plant
    with open_following_models(
        path, input_name=input_name, output_name=output_name, parameters=parameters, quantities=quantities
    ) as models:
        return FollowedModel(
            fmu=path.name,
            sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
            input=models.predictor.input.name,
            output=models.predictor.output.name,
            rate_um_per_s=math.inf,
            curvature_um_per_s2=math.inf,
            horizon_ticks=1,
            lead_s=models.lead_s,
            dead_time_s=models.dead_time_s,
            tolerance_um=tolerance_um,
            slew_V_per_s=slew_V_per_s,
            left_out=models.left_out,
            parameters=models.parameters,
            units=() if quantities == USUAL else (*quantities[:2], *quantities.stated),
        )


@at_the_plant
def run_following(
    plant: Plant,
    model: FollowedModel,
    fmu: Path,
    gains: Gains,
    loop: Loop,
    reference: Reference,
    sampling: Sampling,
    duration_s: float,
    rng: np.random.Generator | None = None,
) -> Trace:
    """Simulate the loop of a model-following controller, models and plant in one process.

    Args:
        plant: as in `simulate_following`, like the last four.
        model: what is followed.
        fmu: the model's FMU.
        gains: of the PID block.
        loop: as the controller believes it to be.
        reference: set-points.
        sampling: what the controller sees and when.
        duration_s: of the run.
        rng: of the noise.

    Raises:
        InputError: the FMU will not do.
        RunError: the plant or the model failed.
    """
    follower = follower_of(model, _kept_open(model, fmu), gains, loop)
    return simulate_following(plant, follower, reference, sampling, duration_s, rng, dead_time_s=model.dead_time_s)


_Key = tuple[Path, str, str, str]
_OPEN: dict[_Key, tuple[contextlib.ExitStack, FollowingModels]] = {}


def _kept_open(model: FollowedModel, fmu: Path) -> FollowingModels:
    """The models of the last run, or new ones: a tuning runs the same ones hundreds of times."""
    key = fmu, model.sha256, f"{model.input} {model.output}", repr(sorted(model.parameters.items()))
    if key not in _OPEN:
        _close_all()
        ends = contextlib.ExitStack()
        _OPEN[key] = ends, ends.enter_context(_opened(model, fmu))
    return _OPEN[key][1]


@atexit.register
def _close_all() -> None:
    while _OPEN:
        _OPEN.popitem()[1][0].close()


def _opened(model: FollowedModel, fmu: Path) -> contextlib.AbstractContextManager[FollowingModels]:
    quantities = USUAL
    if model.units:
        command, reading, *stated = model.units
        quantities = Quantities(command, reading, (stated[0], stated[1]))
    return open_following_models(
        fmu, input_name=model.input, output_name=model.output, parameters=model.parameters, quantities=quantities
    )


@contextlib.contextmanager
def open_follower(model: FollowedModel, fmu: Path, gains: Gains, loop: Loop) -> Iterator[ModelFollower]:
    """Open the models that a file names; they are closed when the context ends.

    Args:
        model: of the file.
        fmu: where the FMU is.
        gains: of the file.
        loop: in which the controller runs.

    Raises:
        InputError: the FMU is missing, not the one that was tuned with, or cannot save its state.
        RunError: the FMU fails.
    """
    require_same(model, fmu)
    with _opened(model, fmu) as models:
        yield follower_of(model, models, gains, loop)


def require_same(model: FollowedModel, fmu: Path) -> None:
    """Make sure that an FMU is the one that the gains were tuned with.

    Raises:
        InputError: it is missing, or another one.
    """
    try:
        digest = hashlib.sha256(fmu.read_bytes()).hexdigest()
    except OSError as error:
        raise InputError(f"{fmu}: {error.strerror}; expected the FMU that [model_following] names") from error
    if digest != model.sha256:
        raise InputError(f"{fmu}: is not the FMU that the gains were tuned with (sha256 {digest[:12]}); tune again")


def follower_of(model: FollowedModel, models: FollowingModels, gains: Gains, loop: Loop) -> ModelFollower:
    """Return the controller of a file around its open models."""
    return ModelFollower(
        inverted=models.inverted,
        predictor=models.predictor,
        gains=gains,
        limits=loop.limits,
        period_s=loop.period_s,
        slew_V_per_s=min(loop.slew_V_per_s, model.slew_V_per_s),
        shaper=None if loop.preview else Shaper(model.rate_um_per_s, model.curvature_um_per_s2),
        horizon_ticks=horizon_ticks(model, loop),
        lead_s=model.lead_s,
        latency_frames=loop.latency_frames,
        frame_weights=loop.frame_weights,
        command_delay_s=loop.command_delay_s,
        tolerance_um=model.tolerance_um,
        margin_um=model.rms_um,
        # nothing would give out what is held back of a known reference, or without an integral
        held_back=0.0 if loop.preview or gains.integral_V_per_um_s == 0.0 else model.held_back,
    )
