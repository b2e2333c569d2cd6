"""The skeleton of a new effect: block, line in the chain, file of the catalogue, example with an oracle, page.

Nothing of it passes the tests before it is filled in: the step changes nothing yet, and the oracle raises.
"""

import re
from pathlib import Path

from bender_effects.documents import INDEX, SKELETON
from bender_plant.blocks import BLOCKS, STAGES

CHAIN = "plant_src/bender_plant/blocks/__init__.py"
_ID = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")

_BLOCK = '''"""{title}: TODO what happens, y -> y with {size} 0.

TODO: cause, equation, symbols, source.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "{id}"
STAGE = "{stage}"
TITLE = "{title}"


@dataclass(frozen=True, slots=True)
class Parameters:
    """Neutral at zero."""

    {size}: float = parameter(0.0, unit="{unit}", text="TODO", tunable=True)

    def __post_init__(self) -> None:
        check(self, ID)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return ({size},)."""
    del beam
    return (settings.{size},)


def changed(y: float, {size}: float) -> float:
    """Return TODO."""
    del {size}
    return y


def step(
    state: tuple[float, ...], constants: tuple[float, ...], time_s: float, h: float, y0: float, ym: float, y1: float
) -> tuple[tuple[float, ...], float, float, float]:
    """TODO."""
    del time_s, h
    {size} = constants[0]
    return state, changed(y0, {size}), changed(ym, {size}), changed(y1, {size})
'''

_EFFECT = '''"""{title}: TODO."""

from bender_effects.effect import Effect, Sizes
from bender_effects.form import Form, amplitude, simple

COVERED = {{"{size}": (0.1, 10.0)}}
"""At the paper's full drive, 50 V and 23.1 um."""


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    # an amplitude has either sign; a size of 0 or more is a `growth`, or a `scale` where it spans decades
    # numbers in V and um, 1/um2 or um/V are scaled to the records by `sized`; those without a unit or in s are not
    size = sizes.sized(amplitude("{size}", 0.1, 20.0), COVERED["{size}"], "{unit}")
    return (simple("{id}", size),)


EFFECT = Effect(
    id="{id}",
    summary="TODO: what it is",
    signature="TODO: what it leaves in the residual",
    resembles={{"{neighbour}": "TODO: what separates it"}},
    separation="TODO: what separates it from all of them",
    excitation="TODO: which drive shows it",
    typical={{"{size}": (0.0, 1.0, "TODO: where that comes from")}},
    covered=COVERED,
    drive="slow_triangle",
    view="reading",
    example={{"{size}": 1.0}},
    forms=_forms,
)
'''

_EXAMPLE = '''"""{title}: strong examples, and readings worked out without the plant's code."""

from typing import Any

import numpy as np

# TODO: VOLTS_V = np.array([...]) in the place of the stairs, where these do not show the effect
PARAMETERS: list[dict[str, Any]] = [{{"{size}": 1.0}}]


def oracle(parameters: dict[str, Any], voltages_V: np.ndarray, step_s: float, plain_um: np.ndarray) -> np.ndarray:
    """The readings in um at the end of every held voltage, TODO; `plain_um` are those without the effect."""
    raise NotImplementedError
'''


def problem(effect_id: str, stage: str, root: Path | None) -> str | None:
    """Return what keeps an effect of this id from being begun, None where nothing does."""
    if root is None:
        return f"effects new: found an installed package without {INDEX}, expected a checkout; clone the repository"
    if not _ID.fullmatch(effect_id):
        return f"effect: found {effect_id!r}, expected an id of small letters, digits and single underscores"
    if stage not in STAGES:
        return f"--stage: found {stage!r}, expected one of {', '.join(STAGES)}"
    if effect_id in BLOCKS:
        return f"effect: found {effect_id!r}, which is a block already, expected a new id"
    taken = [name for name in _files(effect_id, stage) if name != CHAIN and (root / name).exists()]
    return f"{taken[0]}: exists already; remove it or choose another id" if taken else None


def skeleton(effect_id: str, stage: str, root: Path) -> dict[str, str]:
    """Return the texts of the five files to write, by their paths from the root; see `problem` first."""
    files = _files(effect_id, stage)
    files[CHAIN] = _with_line((root / CHAIN).read_text(encoding="utf-8"), effect_id, stage)
    return files


def _files(effect_id: str, stage: str) -> dict[str, str]:
    title = effect_id.replace("_", " ").capitalize()
    unit = "V" if stage == "supply" else "um"
    words = {"id": effect_id, "stage": stage, "title": title, "neighbour": _last_of(stage)}
    words |= {"unit": unit, "size": f"size_{unit}"}
    return {
        f"plant_src/bender_plant/blocks/{effect_id}.py": _BLOCK.format_map(words),
        CHAIN: "",
        f"effects/bender_effects/library/{effect_id}.py": _EFFECT.format_map(words),
        f"tests/effect_examples/{effect_id}.py": _EXAMPLE.format_map(words),
        f"docs/effects/{effect_id}.md": SKELETON.format_map(words),
    }


def _last_of(stage: str) -> str:
    return [block.id for block in BLOCKS.values() if block.stage == stage and block.id != "calibration"][-1]


def _with_line(chain: str, effect_id: str, stage: str) -> str:
    """Return the chain's file with the block in its order, behind the last one of its stage."""
    last = [block.id for block in BLOCKS.values() if block.stage == stage][-1]
    line = f'    "{last}",\n'
    if chain.count(line) != 1:
        raise ValueError(f"{CHAIN}: found the line of {last!r} {chain.count(line)} times, expected once")
    return chain.replace(line, f'{line}    "{effect_id}",  # TODO: move to its place in the chain of the stage\n')
