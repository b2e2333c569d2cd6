"""The blocks of the chain, each one file: cause, equation, parameters with units and bounds, source.

The folder grows by a file for each block and holds nothing else; every file says its STAGE, and STAGES has their order.

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
    TRANSDUCER = True                 it turns volts into the quasi-static displacement in um; a model has exactly one
    STATE_OF_ANY_LENGTH = True        how many numbers its state has follows from the parameters; its step
                                      then ends with `kernels.state.of_any_length`
    longest_step_s(settings, beam)    (right after a jump of the command, at any time): longest sub-steps
    ringing_step_s(settings, beam)    longest sub-step that resolves the oscillation it makes
    commands(settings, voltage_V)     of a command block whose rule holds for all commands at once: (how much later they
                                      act in s, what becomes of them in V)
    AFTER = "dead_zone"               of a block of another package: behind which it acts
    corner(state, constants, ...)     fraction of the sub-step at which its output has a corner, 1 for none; takes the
                                      same signals as the kernel

A signal over a sub-step of length h is a parabola, given at its start (after a jump), middle and end. States are
tuples, so a step never changes what it was given. What several blocks share stands in `bender_plant.kernels`.
"""

import importlib
import math
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import Any

STAGES = ("supply", "material", "structure", "surroundings", "sensor")
_KERNELS = ("command", "step", "beside", "modify")


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
    commands: Callable[..., tuple[float, Any]] | None
    modify: Callable[..., Any] | None
    beside: str | None
    memory: bool
    longest_step_s: Callable[..., tuple[float, float]]
    ringing_step_s: Callable[..., float]
    corner: Callable[..., float] | None
    transducer: bool
    state_of_any_length: bool
    module: ModuleType

    @property
    def has_state(self) -> bool:
        """Whether what it gives depends on more than its input and the time of the moment."""
        return self.initial is not _no_state


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


def _block(module: ModuleType) -> Block:
    if sum(hasattr(module, kernel) for kernel in _KERNELS) != 1:
        raise TypeError(f"block {module.ID}: found none or several of {_KERNELS}, expected exactly one kernel")
    return Block(
        id=module.ID,
        stage=module.STAGE,
        title=module.TITLE,
        parameters=module.Parameters,
        constants=getattr(module, "constants", _no_constants),
        initial=getattr(module, "initial", _no_state),
        step=getattr(module, "step", None) or getattr(module, "beside", None),
        command=getattr(module, "command", None),
        commands=getattr(module, "commands", None),
        modify=getattr(module, "modify", None),
        beside=getattr(module, "BESIDE", None),
        memory=getattr(module, "MEMORY", False),
        longest_step_s=getattr(module, "longest_step_s", _no_bounds),
        ringing_step_s=getattr(module, "ringing_step_s", _no_ringing),
        corner=getattr(module, "corner", None),
        transducer=getattr(module, "TRANSDUCER", False),
        state_of_any_length=getattr(module, "STATE_OF_ANY_LENGTH", False),
        module=module,
    )


# In the order of the physics: a model may list its blocks as it likes, they act in this order.
_IN_ORDER = (
    "supply_quantisation",
    "transport_delay",
    "slew_limit",
    "supply_fall_lag",
    "source_resistance",
    "dead_zone",
    "asymmetric_dead_zone",
    "asymmetric_gain",
    "charge_leakage",
    "saturation",
    "linear_transduction",
    "learned_hysteresis",
    "sparse_equation",
    "prandtl_ishlinskii",
    "bouc_wen",
    "rate_independent_hysteresis",
    "electrostriction",
    "presliding_friction",
    "creep",
    "plant_lag",
    "square_root_outflow",
    "radiation_loss",
    "speed_drag",
    "bearing_friction",
    "tip_mass",
    "structural_damping",
    "stiffening",
    "quadratic_spring",
    "coulomb_friction",
    "quadratic_drag",
    "hysteretic_spring",
    "bending_modes",
    "second_mode",
    "output_dead_zone",
    "backlash",
    "output_limit",
    "residual_equation",
    "ageing",
    "thermal_drift",
    "periodic_disturbance",
    "fold",
    "sensor_lag",
    "lens_distortion",
    "output_curve",
    "calibration",
    "sensor_quantisation",
)

GROUP = "piezo_bender.blocks"
"""Entry points by which other packages add blocks: modules like those here, with AFTER."""


def _added() -> list[ModuleType]:
    """Return the modules of other packages: installed, or inside an FMU beside those of the chain."""
    beside = [x.name for x in pkgutil.iter_modules(__path__) if x.name not in _IN_ORDER]
    found = [importlib.import_module(f"{__name__}.{name}") for name in beside]
    if __name__ != "bender_plant.blocks":  # inside an FMU
        return found
    from importlib.metadata import entry_points

    return found + [point.load() for point in entry_points(group=GROUP)]


def _chain() -> dict[str, Block]:
    names: list[str] = [*_IN_ORDER]
    blocks = {name: _block(importlib.import_module(f"{__name__}.{name}")) for name in names}
    for module in _added():
        block, after = _block(module), getattr(module, "AFTER", "")
        if block.id in blocks or after not in blocks:
            raise ImportError(
                f"{module.__name__}: found the block {block.id!r} with AFTER = {after!r}, expected an id of its own, "
                "and in AFTER that of the block behind which it acts"
            )
        blocks[block.id] = block
        names.insert(names.index(after) + 1, block.id)
    return {name: blocks[name] for name in names}


BLOCKS: dict[str, Block] = _chain()
