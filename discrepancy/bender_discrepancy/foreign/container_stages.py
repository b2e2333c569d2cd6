"""What of a corrected stand-in stands around the FMU that it stands in for.

Supply and material act on the input; creep, a dead zone of the output, play, surroundings and sensor on the output.
What changes the inside of the plant, its modes and its lags, can stand on neither side: a black box has no place for
it. It stands beside the FMU: the stand-in with it gets the same input, and what that shows more than the stand-in
without it is added to the output. That is exact as far as the stand-in follows the FMU, and to first order where it
does not.
"""

import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from bender_discrepancy.conclusion.sentences import heading_of
from bender_effects.catalogue import EFFECTS
from bender_loop.fmu.file import co_simulation, read_description
from bender_loop.fmu.ports import Port
from bender_loop.tables.quantities import USUAL, Quantities
from bender_plant.blocks import (
    BLOCKS,
    backlash,
    calibration,
    creep,
    linear_transduction,
    output_dead_zone,
    transport_delay,
)
from bender_plant.model import BlockSettings, Model
from bender_plant.plant import sub_step_bounds_s

INPUT_STAGES, OUTPUT_STAGES = ("supply", "material"), ("surroundings", "sensor")
BEHIND = (creep.ID, output_dead_zone.ID, backlash.ID)
"""Of the stages between, what acts on the output alone."""
FEWEST_PARTS, PARTS, MOST_PARTS = 8, 256, 256
"""Inner steps between two rows: what rings between slow rows shows in no reading but in the sum of many jumps."""
PARTS_IN_PYTHON = 64
"""An FMU whose own steps run in Python takes some thirty times as long over each."""
MOST_INNER_STEPS = 2e6
"""Over all rows: seconds of driving; longer records take fewer parts of a row."""


@dataclass(frozen=True, slots=True)
class Original:
    """An FMU as it was given.

    Attributes:
        path: of the file.
        input: the variable that takes the command.
        output: the variable that is read.
        start_values: of parameters that were set, by name.
        rest_um: what it shows before anything moves.
        quantities: units of its input and output as they are driven and read, where they are not V and um.
    """

    path: Path
    input: Port
    output: Port
    start_values: Mapping[str, float]
    rest_um: float
    quantities: Quantities = USUAL

    @property
    def taken_units(self) -> dict[str, str]:
        """By variable, the units of the record in which its input and output are taken where it declares none."""
        stated = zip((self.input, self.output), self.quantities.stated, strict=True)
        return {port.name: unit for port, unit in stated if unit and not port.unit}

    @property
    def parts(self) -> int:
        """Inner steps between two rows that it is given."""
        with zipfile.ZipFile(self.path) as archive:
            in_python = any(x.startswith("resources/") and x.endswith(".py") for x in archive.namelist())
        return PARTS_IN_PYTHON if in_python else PARTS

    @property
    def takes_any_step(self) -> bool:
        """Whether its steps may differ from one another, as its description says."""
        return bool(co_simulation(read_description(self.path)).canHandleVariableCommunicationStepSize)

    @property
    def rest(self) -> float:
        """What it shows before anything moves, in its own unit."""
        return self.rest_um / self.output.internal


@dataclass(frozen=True, slots=True)
class Stages:
    """What stands around an FMU.

    Attributes:
        before: on its input, V to V; None for nothing.
        behind: on its output, um to um, both relative to rest; None for nothing.
        inside: the plant of the stand-in with what changes it, and without, V to um; None where nothing does.
        changed: titles of what does.
    """

    before: Model | None
    behind: Model | None
    inside: tuple[Model, Model] | None = None
    changed: tuple[str, ...] = ()

    @property
    def are_none(self) -> bool:
        """Whether nothing stands around the FMU."""
        return self.before is None and self.behind is None and self.inside is None

    @property
    def is_static(self) -> bool:
        """Whether they give at once what follows from their input: no step has to be short for them.

        What stands beside the FMU follows an input that is held however long the step is, as the FMU does.
        """
        return _is_static(self.before) and _is_static(self.behind)

    @property
    def only_delay(self) -> bool:
        """Whether nothing but a delay of the input has a state, and nothing stands beside the FMU."""
        return self.inside is None and _is_static(without_delay(self.before)[0]) and _is_static(self.behind)


def _is_static(model: Model | None) -> bool:
    return model is None or not any(BLOCKS[x.id].has_state for x in model.blocks)


def without_delay(before: Model | None) -> tuple[Model | None, float]:
    """Return the stages before an FMU without their delay, and the delay in s: it commutes with what is static."""
    if before is None:
        return None, 0.0
    delays = [x.parameters for x in before.blocks if x.id == transport_delay.ID]
    kept = replace(before, blocks=tuple(x for x in before.blocks if x.id != transport_delay.ID))
    return kept, sum(float(getattr(x, "delay_s")) for x in delays)  # noqa: B009


def stages_around(base: Model, corrected: Model, rest_um: float) -> Stages:
    """Return what of a corrected stand-in stands around the FMU.

    Args:
        base: the stand-in as it was fitted to the FMU.
        corrected: the stand-in with effects and calibration in it.
        rest_um: what the FMU shows before anything moves.

    Raises:
        ModelError: a number of the stages is out of the bounds of its block.
    """
    given = {x.id: x.parameters for x in base.blocks}
    after = {x.id: x.parameters for x in corrected.blocks}
    added = [x for x in corrected.blocks if x.id not in given]
    behind = [x for x in added if BLOCKS[x.id].stage in OUTPUT_STAGES or x.id in BEHIND]
    before = [x for x in added if x not in behind and not acts_inside(x.id, base)]
    before += _longer_delay(given, after)
    changed = [_title(x.id) for x in added if acts_inside(x.id, base)]
    changed += [_title(x) for x in given if x != calibration.ID and x in after and _is_other(x, given, after, before)]
    without = [x for x in base.blocks if x.id != calibration.ID]
    around = {x.id for x in (*before, *behind)} - set(given)
    inside = [x for x in corrected.blocks if x.id != calibration.ID and x.id not in around]
    moved = transport_delay.ID if any(x.id == transport_delay.ID for x in before) else ""
    inside = [next(y for y in without if y.id == x.id) if x.id == moved and x.id in given else x for x in inside]
    transducer = given.get(linear_transduction.ID)
    sensitivity = 1.0 if transducer is None else linear_transduction.constants(transducer, base.beam)[0]
    first = _chain("before", sensitivity, before, 1.0 / sensitivity, 0.0) if before else None
    gain, offset = _recalibrated(given, after, rest_um)
    plain = not behind and (gain, offset) == (1.0, 0.0)
    second = None if plain else _chain("behind", 1.0, behind, gain, offset)
    if not changed:
        return Stages(first, second)
    pair = (
        Model("inside", base.beam, tuple(inside), ", ".join(changed)),
        Model("without", base.beam, tuple(without), "the stand-in of the original"),
    )
    return Stages(first, second, pair, tuple(changed))


def acts_inside(block: str, base: Model) -> bool:
    """Return whether a block can stand on neither side of an FMU that a model stands in for.

    What a linear transducer makes of the voltage may be put before it. Where the transducer bends, what acts beside or
    behind it is inside.
    """
    if BLOCKS[block].stage in OUTPUT_STAGES or block in BEHIND:
        return False
    transducer = next(x.id for x in base.blocks if BLOCKS[x.id].transducer)
    order = list(BLOCKS)
    is_behind = order.index(block) > order.index(transducer) and transducer != linear_transduction.ID
    return is_behind or BLOCKS[block].stage not in INPUT_STAGES


def inner_step_s(original: Original, stand_in: Model, row_s: float, rows: int, *, once: bool = False) -> float:
    """Return the inner step that a container needs at most.

    Args:
        original: the FMU in it.
        stand_in: whose ringing and lags the step is short beside.
        row_s: usual time between two rows.
        rows: of all records.
        once: it is driven with the records once only, and so may take long.
    """
    parts = min(PARTS if once else original.parts, max(FEWEST_PARTS, MOST_INNER_STEPS / max(rows, 1)))
    return max(row_s / MOST_PARTS, min(row_s / parts, quickest_s(stand_in)))


def quickest_s(stand_in: Model) -> float:
    """Return a step that is short beside the ringing and the lags of a stand-in."""
    first_s, longest_s = sub_step_bounds_s(stand_in)
    return min(longest_s, 4.0 * first_s)


def scaled(behind: Model | None, gain: float, offset_um: float, rest_um: float) -> Model:
    """Return the stages behind an FMU, None for nothing, with one more gain and offset of what is read."""
    blocks = [x for x in behind.blocks if x.id not in (linear_transduction.ID, calibration.ID)] if behind else []
    was = next((x.parameters for x in behind.blocks if x.id == calibration.ID), None) if behind else None
    first = was if isinstance(was, calibration.Parameters) else calibration.Parameters()
    rest = gain * first.offset_um + (gain - 1.0) * rest_um + offset_um
    return _chain("behind", 1.0, blocks, gain * first.gain, rest)


def _chain(name: str, sensitivity: float, blocks: list[BlockSettings], gain: float, offset_um: float) -> Model:
    transducer = _settings(linear_transduction.ID, sensitivity_um_per_V=sensitivity)
    scale = _settings(calibration.ID, gain=gain, offset_um=offset_um)
    text = ", ".join(_title(x.id) for x in blocks) or "calibration"
    return Model(name, None, (transducer, *(x for x in blocks if x.id != calibration.ID), scale), text)


def _settings(block: str, **values: float) -> BlockSettings:
    return BlockSettings(block, BLOCKS[block].parameters(**values))


def _longer_delay(given: Mapping[str, object], after: Mapping[str, object]) -> list[BlockSettings]:
    delays = [getattr(x.get(transport_delay.ID), "delay_s", 0.0) for x in (given, after)]
    more_s = delays[1] - delays[0]
    return [_settings(transport_delay.ID, delay_s=more_s)] if transport_delay.ID in given and more_s > 0.0 else []


def _is_other(
    block: str, given: Mapping[str, object], after: Mapping[str, object], before: list[BlockSettings]
) -> bool:
    moved = block == transport_delay.ID and any(x.id == block for x in before)
    return given[block] != after[block] and not moved


def _recalibrated(given: Mapping[str, object], after: Mapping[str, object], rest_um: float) -> tuple[float, float]:
    """Return gain and offset of what differs from rest."""
    was, now = (x.get(calibration.ID, calibration.Parameters()) for x in (given, after))
    assert isinstance(was, calibration.Parameters)
    assert isinstance(now, calibration.Parameters)
    if was == now:
        return 1.0, 0.0
    gain = now.gain / was.gain
    return gain, now.offset_um - gain * was.offset_um + (gain - 1.0) * rest_um


def _title(block: str) -> str:
    return (heading_of(block) if block in EFFECTS else BLOCKS[block].title).lower()
