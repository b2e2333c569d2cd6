"""The blocks of the chain, each one file: cause, equation, parameters with units and bounds, source.

A block is a module with

    ID, STAGE, TITLE                               names
    MEMORY                                         whether its output depends on the past of its input
    Parameters                                     frozen dataclass, checked when made
    constants(settings, beam) -> tuple             numbers of the kernel
    initial(constants) -> state                    at rest
    step(state, constants, time_s, h, u0, um, u1) -> (state, y0, ym, y1)
    longest_step_s(settings, beam) -> (first, any) longest sub-step after a jump of the command, and at any time
    corner(state, constants, u0, um, u1)           optional: fraction at which the output has a corner, 1 for none
    ringing_step_s(settings, beam)                 optional: longest sub-step that resolves its own oscillation

A signal over a sub-step of length h is a parabola, given at its start (after a jump), middle and end. States are
tuples, so a step never changes what it was given.
"""

from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import Any

from . import (
    bending_modes,
    bouc_wen,
    calibration,
    learned_hysteresis,
    linear_transduction,
    prandtl_ishlinskii,
    source_resistance,
)

STAGES = ("supply", "material", "structure", "surroundings", "sensor")


@dataclass(frozen=True, slots=True)
class Block:
    """What the chain knows of a block module; see the list above."""

    id: str
    stage: str
    title: str
    memory: bool
    parameters: type
    constants: Callable[..., tuple[Any, ...]]
    initial: Callable[[Any], tuple[Any, ...]]
    step: Callable[..., tuple[tuple[Any, ...], float, float, float]]
    longest_step_s: Callable[..., tuple[float, float]]
    corner: Callable[..., float] | None
    ringing_step_s: Callable[..., float] | None
    transducer: bool


def _block(module: ModuleType, transducer: bool = False) -> Block:
    return Block(
        id=module.ID,
        stage=module.STAGE,
        title=module.TITLE,
        memory=module.MEMORY,
        parameters=module.Parameters,
        constants=module.constants,
        initial=module.initial,
        step=module.step,
        longest_step_s=module.longest_step_s,
        corner=getattr(module, "corner", None),
        ringing_step_s=getattr(module, "ringing_step_s", None),
        transducer=transducer,
    )


# In the order of the physics: a model may list its blocks as it likes, they act in this order. A transducer turns
# volts into the quasi-static displacement in um; every model has exactly one.
_IN_ORDER = (
    _block(source_resistance),
    _block(linear_transduction, transducer=True),
    _block(learned_hysteresis, transducer=True),
    _block(prandtl_ishlinskii, transducer=True),
    _block(bouc_wen, transducer=True),
    _block(bending_modes),
    _block(calibration),
)

BLOCKS: dict[str, Block] = {block.id: block for block in _IN_ORDER}
