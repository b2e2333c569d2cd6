"""A linear model of anybody's FMU at an operating point: A, B, C, D of one communication step with the input held.

An FMU for co-simulation shows no states, so they are those of a balanced realisation of its answer to a small step up
and the same step down (see `linear_model`, `state_space`). What differs between the two answers is told as a note.
"""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bender_loop.control.sampling import Sampling
from bender_loop.errors import InputError
from bender_loop.fmu.file import read_description
from bender_loop.tables.quantities import USUAL, Quantities
from bender_report.wording import relabelled, shown_in, unit_text
from bender_tuner.model.linear_model import OperatingPoint, model_of_steps, readings_after
from bender_tuner.model.sampled_model import SampledModel
from bender_tuner.model.state_space import StateSpace, realise
from bender_tuner.task.session import open_guarded

STEP_s, SETTLE_s = 0.001, 10.0
"""Where neither the user nor the default experiment of the FMU says otherwise."""
FRAMES = 1000
"""In a default experiment that states no step."""
MOST_FRAMES = 200_000
CHANGE_SHARE = 0.01
_UNLIKE = 0.02

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LinearisationRequest:
    """What is linearised, and where.

    Attributes:
        input_value: held at the operating point, in the input's unit.
        input_name: None for the only one.
        output_name: None for the only one.
        step_s: sampling time; None as the FMU's default experiment has it.
        settle_s: held before the step, and recorded after it; None for the length of the default experiment.
        change: of the input, up and down; None for 1 % of the operating point.
        quantities: units of both, where the FMU declares none.
    """

    input_value: float = 0.0
    input_name: str | None = None
    output_name: str | None = None
    step_s: float | None = None
    settle_s: float | None = None
    change: float | None = None
    quantities: Quantities = USUAL


@dataclass(frozen=True, slots=True, eq=False)
class LinearFmu:
    """A linear model of an FMU.

    Attributes:
        states: A, B, C; D is 0, since an output is read before the input of its instant acts.
        model: the pulse response that they realise.
        point: where it holds.
        names: of input and output.
        units: of both, as the numbers are in them.
        notes: what the user must know of the numbers.
    """

    states: StateSpace
    model: SampledModel
    point: OperatingPoint
    names: tuple[str, str]
    units: tuple[str, str]
    notes: tuple[str, ...]

    def table(self) -> dict[str, object]:
        """Return matrices, operating point and units by name."""
        states = self.states
        return {
            "A": states.A,
            "B": states.B,
            "C": states.C,
            "D": np.zeros((1, 1)),
            "states": [f"x{k + 1}" for k in range(states.A.shape[0])],
            "step_s": states.period_s,
            "inputs": [self.names[0]],
            "outputs": [self.names[1]],
            "input_unit": self.units[0],
            "output_unit": self.units[1],
            "input_at_rest": self.point.voltage_V,
            "output_at_rest": self.point.displacement_um,
            "dc_gain": self.model.dc_gain_um_per_V if math.isfinite(self.model.dc_gain_um_per_V) else None,
            "error_of_response": states.error,
            "notes": list(self.notes),
        }


def linearised_fmu(fmu: Path, asked: LinearisationRequest) -> LinearFmu:
    """Return the linear model of an FMU after its input has been held; it runs in a process of its own.

    Raises:
        InputError: the FMU or a number will not do, or the output does not answer.
        RunError: the FMU failed.
    """
    step_s, settle_s = _times(fmu, asked)
    change = CHANGE_SHARE * max(abs(asked.input_value), 1.0) if asked.change is None else asked.change
    numbers = {"--voltage": asked.input_value, "--step": step_s, "--settle": settle_s, "--change": change}
    for name, value in numbers.items():
        if not math.isfinite(value) or (name != "--voltage" and value <= 0.0):
            raise InputError(
                f"{name}: found {value!r}, expected a finite number{'' if name == '--voltage' else ' > 0'}"
            )
    frames = math.ceil(settle_s / step_s)
    if frames > MOST_FRAMES:
        raise InputError(
            f"--step, --settle: found {frames} steps of {step_s:g} s, expected at most {MOST_FRAMES}; give a longer "
            "--step or a shorter --settle"
        )
    names = (asked.input_name, asked.output_name)
    with open_guarded(fmu, *names, foreign=True, quantities=asked.quantities) as (plant, facts):
        sampling = Sampling(1.0 / step_s)
        held = OperatingPoint(asked.input_value, math.nan, frames, settled=True)
        still, up, down = (readings_after(plant, held, sampling, x) for x in (0.0, change, -change))
    if float(np.max(np.abs(up - down))) == 0.0:
        raise InputError(
            f"{fmu}: {facts.output} does not answer a change of {facts.input} by {change:g} {facts.units[0]} within "
            f"{settle_s:g} s; give another --voltage, a larger --change or a longer --settle"
        )
    model = model_of_steps(up, down, change, step_s)
    is_settled = float(np.ptp(still)) <= _UNLIKE * float(np.max(np.abs(up - down))) / 2.0
    point = replace(held, displacement_um=float(still[0]), settled=is_settled)
    states = realise(model)
    notes = _notes(point, up - still, down - still, step_s, states, facts.units)
    return LinearFmu(states, model, point, (facts.input, facts.output), facts.units, notes)


def _times(fmu: Path, asked: LinearisationRequest) -> tuple[float, float]:
    """Return sampling time and longest wait, from the default experiment where they were not given."""
    experiment = read_description(fmu).defaultExperiment
    stop_s, own_s = (float(getattr(experiment, name, None) or 0.0) for name in ("stopTime", "stepSize"))
    usual_s = stop_s if stop_s > 0.0 else SETTLE_s
    settle_s = usual_s if asked.settle_s is None else asked.settle_s
    own_step_s = own_s if own_s > 0.0 else settle_s / FRAMES if stop_s > 0.0 else STEP_s
    return own_step_s if asked.step_s is None else asked.step_s, settle_s


def _notes(
    point: OperatingPoint, up: Array, down: Array, step_s: float, states: StateSpace, units: tuple[str, str]
) -> tuple[str, ...]:
    notes = []
    with shown_in(*units):
        if not point.settled:
            notes.append(
                f"the output still moves after {point.frames * step_s:g} s at the operating point; what it does by "
                "itself is taken off, but a longer --settle would be right"
            )
        size = float(np.max(np.abs(up - down))) / 2.0
        unlike = float(np.max(np.abs(up + down))) / 2.0
        if unlike > _UNLIKE * size:
            apart = relabelled(f"{unlike:.3g} {unit_text('um')}")
            notes.append(
                f"the answers to more and to less differ by {apart} at most, {100.0 * unlike / size:.0f} % of the "
                "answer itself: a curve or a loop; the matrices have their mean"
            )
        if states.error > 1e-3:
            notes.append(f"{states.A.shape[0]} states miss {100.0 * states.error:.2g} % of the largest response")
    return tuple(notes)
