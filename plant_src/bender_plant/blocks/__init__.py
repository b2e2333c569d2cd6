"""The blocks of the chain, each one file: cause, equation, parameters with units and bounds, source.

A block is a module with

    ID, STAGE, TITLE                  names
    Parameters                        frozen dataclass, checked when made
    constants(settings, beam)         the numbers of the kernel, a tuple
    initial(constants)                its state at rest, a tuple; left out where there is none

and one of these kernels, according to what it acts on:

    command(state, constants, voltage, step_s) -> (state, pieces)
        the held command, before anything else: pieces are (duration, voltage)
    step(state, constants, time_s, h, u0, um, u1) -> (state, y0, ym, y1)
        the signal of the chain
    beside(state, constants, time_s, h, y0, ym, y1, x0, xm, x1) -> (state, y0, ym, y1)
        the signal y of the chain with another one beside it: BESIDE = "voltage" is what enters the transducer,
        "quasi_static" what enters the structure
    modify(settings, modes) -> modes
        the parameters of the bending modes

and, where they apply,

    MEMORY = True                     its output depends on the past of its input
    longest_step_s(settings, beam)    (right after a jump of the command, at any time): longest sub-steps
    ringing_step_s(settings, beam)    longest sub-step that resolves the oscillation it makes
    corner(state, constants, ...)     fraction of the sub-step at which its output has a corner, 1 for none; takes the
                                      same signals as the kernel

A signal over a sub-step of length h is a parabola, given at its start (after a jump), middle and end. States are
tuples, so a step never changes what it was given.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import Any

from bender_plant.blocks import (
    ageing,
    backlash,
    bending_modes,
    bouc_wen,
    calibration,
    charge_leakage,
    creep,
    dead_zone,
    electrostriction,
    learned_hysteresis,
    lens_distortion,
    linear_transduction,
    periodic_disturbance,
    prandtl_ishlinskii,
    rate_independent_hysteresis,
    saturation,
    second_mode,
    sensor_lag,
    sensor_quantisation,
    slew_limit,
    source_resistance,
    sparse_equation,
    stiffening,
    structural_damping,
    supply_fall_lag,
    supply_quantisation,
    thermal_drift,
    tip_mass,
    transport_delay,
)

STAGES = ("supply", "material", "structure", "surroundings", "sensor")


@dataclass(frozen=True, slots=True)
class Block:
    """What the chain knows of a block module; see the list above."""

    id: str
    stage: str
    title: str
    parameters: type
    constants: Callable[..., tuple[Any, ...]]
    initial: Callable[[Any], tuple[Any, ...]]
    step: Callable[..., tuple[tuple[Any, ...], float, float, float]] | None
    command: Callable[..., tuple[tuple[Any, ...], list[tuple[float, float]]]] | None
    modify: Callable[..., Any] | None
    beside: str | None
    memory: bool
    longest_step_s: Callable[..., tuple[float, float]]
    ringing_step_s: Callable[..., float]
    corner: Callable[..., float] | None
    transducer: bool
    module: ModuleType


def _no_state(constants: Any) -> tuple[Any, ...]:
    del constants
    return ()


def _no_constants(settings: Any, beam: Any) -> tuple[Any, ...]:
    del settings, beam
    return ()


def _no_bounds(settings: Any, beam: Any) -> tuple[float, float]:
    del settings, beam
    return math.inf, math.inf


def _no_ringing(settings: Any, beam: Any) -> float:
    del settings, beam
    return math.inf


def _block(module: ModuleType, transducer: bool = False) -> Block:
    return Block(
        id=module.ID,
        stage=module.STAGE,
        title=module.TITLE,
        parameters=module.Parameters,
        constants=getattr(module, "constants", _no_constants),
        initial=getattr(module, "initial", _no_state),
        step=getattr(module, "step", None) or getattr(module, "beside", None),
        command=getattr(module, "command", None),
        modify=getattr(module, "modify", None),
        beside=getattr(module, "BESIDE", None),
        memory=getattr(module, "MEMORY", False),
        longest_step_s=getattr(module, "longest_step_s", _no_bounds),
        ringing_step_s=getattr(module, "ringing_step_s", _no_ringing),
        corner=getattr(module, "corner", None),
        transducer=transducer,
        module=module,
    )


# In the order of the physics: a model may list its blocks as it likes, they act in this order. A transducer turns
# volts into the quasi-static displacement in um; every model has exactly one.
_IN_ORDER = (
    _block(supply_quantisation),
    _block(transport_delay),
    _block(slew_limit),
    _block(supply_fall_lag),
    _block(source_resistance),
    _block(dead_zone),
    _block(charge_leakage),
    _block(saturation),
    _block(linear_transduction, transducer=True),
    _block(learned_hysteresis, transducer=True),
    _block(sparse_equation, transducer=True),
    _block(prandtl_ishlinskii, transducer=True),
    _block(bouc_wen, transducer=True),
    _block(rate_independent_hysteresis),
    _block(electrostriction),
    _block(creep),
    _block(tip_mass),
    _block(structural_damping),
    _block(stiffening),
    _block(bending_modes),
    _block(second_mode),
    _block(backlash),
    _block(ageing),
    _block(thermal_drift),
    _block(periodic_disturbance),
    _block(sensor_lag),
    _block(lens_distortion),
    _block(calibration),
    _block(sensor_quantisation),
)

BLOCKS: dict[str, Block] = {block.id: block for block in _IN_ORDER}
