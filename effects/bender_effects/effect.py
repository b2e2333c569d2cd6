"""One effect of the catalogue: what it is, leaves behind, is mistaken for, and how a search puts it into a model.

Every effect is said once, in a file of its own in `library/`. Title, stage, units, enforced bounds and meanings of the
parameters come from its block, so that nothing is said twice.
"""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from bender_effects.form import Form, Free
from bender_effects.witnessed import Witnessed
from bender_plant.blocks import BLOCKS, Block
from bender_plant.parameter import Meaning, meanings

FULL_VOLTAGE_V = 50.0
FULL_STROKE_um = 23.1
"""Full drive of the paper's actuator: the ranges of `relative` effects hold for it (50 V give 23.14 um)."""

LEAST_OF_A_ROW, MOST_OF_A_RECORD, LONGEST_S = 0.2, 0.3, 4e5
"""A lag that is shorter moves no reading, one that is longer is a drift; blocks take twice as many seconds at most."""
UNSEEN_OF_A_ROW = 0.05
"""A lag that is shorter is over before the next row, to 2e-9."""
RELAXING_RECORDS = 3.0
"""The slowest relaxation that is sought, over the longest record."""

CALIBRATION = "calibration"
ALL_RIGS, PIEZO_BENDERS, OTHER_RIGS = "all", "piezo benders", "others"
_CALIBRATED_BY = {"gain_error": "gain", "offset": "offset_um"}

Range = tuple[float, float]


def powers_of_unit(unit: str) -> tuple[int, int]:
    """Return the powers of V and of um in a unit: (-2, 1) of um/V2, (0, 0) of s."""
    above, _, below = unit.partition("/")
    powers = {"V": 0, "um": 0}
    for part, sign in ((above, 1), (below, -1)):
        for factor in part.strip("()").split("."):
            found = re.fullmatch(r"(V|um)(\d*)", factor)
            if found:
                powers[found[1]] += sign * int(found[2] or 1)
    return powers["V"], powers["um"]


def scaling(unit: str, full_voltage_V: float, full_stroke_um: float) -> float:
    """Return by how much a number in a unit is larger at a full drive than at that of the paper's actuator."""
    volts, microns = powers_of_unit(unit)
    return (full_voltage_V / FULL_VOLTAGE_V) ** volts * (full_stroke_um / FULL_STROKE_um) ** microns


@dataclass(frozen=True, slots=True)
class Sizes:
    """What a search is sized by.

    Attributes:
        span_V: largest voltage of the records.
        stroke_um: peak-to-peak of the readings.
        duration_s: of the longest record.
        first_Hz: first resonance of the model.
        highest_Hz: that the rows show without an alias: half as many as there are in a second.
        piezo_bender: the model is one; starts of its effects are those of the paper's actuator, whatever the records
            span. Those of other rigs scale with the records.
        lowest_Hz: of the commands, below which they hold nothing; 0 where they step or stand.
        quickest_line_Hz: of the spectra of the records; rows at uneven times show lines beyond `highest_Hz`.
        furthest_V: the voltage of the records that is furthest from 0, with its sign; 0 where it is not known.
    """

    span_V: float
    stroke_um: float
    duration_s: float
    first_Hz: float
    piezo_bender: bool = True
    highest_Hz: float = math.inf
    damping_ratio: float = 0.0
    lowest_Hz: float = 0.0
    quickest_line_Hz: float = math.inf
    furthest_V: float = 0.0

    @property
    def row_s(self) -> float:
        """Time between two rows."""
        return 0.5 / self.highest_Hz

    def sized(self, free: Free, covered: Range, unit: str) -> Free:
        """Return a free number in a unit of the paper's actuator as these records need it.

        Its bounds reach what is covered at their full drive; on another rig its starts scale with it too.
        """
        own = scaling(unit, self.span_V, self.stroke_um)
        scaled = free if self.piezo_bender else free.times(own)
        return scaled.reaching(own * covered[0], own * covered[1])

    def relaxing(self) -> Range:
        """Return the time constants that records of another rig show relax: from a row to a few records."""
        return self.row_s, max(RELAXING_RECORDS * self.duration_s, 100.0 * self.row_s)

    def lasting(self, covered: Range) -> Range:
        """Return the range of a time constant: on another rig from a part of a row to a part of the longest record."""
        if self.piezo_bender:
            return covered
        least_s = LEAST_OF_A_ROW * self.row_s if self.row_s > 0.0 else covered[0]
        return least_s, min(max(covered[1], MOST_OF_A_RECORD * self.duration_s), LONGEST_S)


def _no_form(sizes: Sizes) -> tuple[Form, ...]:
    del sizes
    return ()


@dataclass(frozen=True, slots=True)
class Effect:
    """One effect.

    Attributes:
        id: the contract's name.
        summary: what it is, one line.
        signature: what it leaves in the residual.
        resembles: ids of the effects that leave something similar, the nearest first, and what separates each of them.
        separation: what separates it from all of them, in short.
        excitation: which drive shows it.
        typical: parameter -> (low, high, where that comes from), of this kind of bench.
        covered: parameter -> (low, high) that a search covers at least.
        drive: what the plant of its picture is driven with, see `report.signature.drives.DRIVES`.
        view: what that picture looks at, see `report.signature.views.VIEWS`.
        example: parameters of that picture.
        forms: the forms in which a search puts it into a model.
        found_by: how it is found where no form is searched.
        unusual: what makes it, or a large value of it, unusual for a piezo actuator; None where nothing does.
        relative: the ranges hold for `FULL_VOLTAGE_V` and `FULL_STROKE_um` and scale with the record's own.
        rigs: whether it is sought in all models, or only in those of piezo benders or of others, see `effects.rigs`.
        generalises: ids of effects that it is, with some of its numbers alike: it fits as well wherever one of them
            does, and is no rival there.
        includes: ids of effects that its name is true of as well, though no form of it has their corners: where
            structure is left in any case, they are no rivals of it.
        title: a few words, of a calibration; every other effect has that of its block.
        elsewhere: its title in devices of other quantities than a voltage and a displacement; "" where it is the same.
        in_general: its summary for devices that are no piezo benders; "" where it is the same.
        same_on_other_side: id of the effect that is the same behind, or before, a plant that is linear.
        superposes: what it does to two commands adds up: a lag may as well act before it as behind it.
        splits_into: ids of effects that together may look like it.
        of_the_record: it belongs to the day and the room of a record, and is not carried to the next one.
        slow: an excerpt of a long record may not show it.
        bends_slow_reading: behind the transducer it bends, folds or holds back what is read, however slowly it moves.
        curve_of_reading: behind the plant it is a curve without memory: two of them together are one curve, and
            no record tells which two.
        told_as: how its numbers are told where they are many: "loop", "relaxations", or "" one by one.
        witnessed: what channels beside the readings tell of it; None where they tell nothing.
        read_off: the step that all readings are multiples of, read off them; of one effect.

    Ranges are those of the size where a parameter may have either sign.

    Raises:
        ValueError: a range is empty or names no parameter of the effect's block, or nothing finds the effect.
    """

    id: str
    summary: str
    signature: str
    resembles: Mapping[str, str]
    separation: str
    excitation: str
    typical: Mapping[str, tuple[float, float, str]]
    covered: Mapping[str, Range]
    drive: str
    view: str
    example: Mapping[str, Any]
    forms: Callable[[Sizes], tuple[Form, ...]] = _no_form
    found_by: str = ""
    unusual: str | None = None
    relative: bool = False
    rigs: str = ALL_RIGS
    generalises: tuple[str, ...] = ()
    includes: tuple[str, ...] = ()
    title: str = ""
    elsewhere: str = ""
    in_general: str = ""
    same_on_other_side: str = ""
    superposes: bool = False
    splits_into: tuple[tuple[str, ...], ...] = ()
    of_the_record: bool = False
    slow: bool = False
    bends_slow_reading: bool = False
    curve_of_reading: bool = False
    told_as: Literal["", "loop", "relaxations"] = ""
    witnessed: Witnessed | None = None
    read_off: bool = False
    stage: str = field(init=False)

    def __post_init__(self) -> None:
        block = BLOCKS.get(self.id)
        object.__setattr__(self, "title", block.title if block else self.title)
        object.__setattr__(self, "stage", block.stage if block else CALIBRATION)
        known = self.parameters
        for name, (low, high, *_) in [*self.typical.items(), *self.covered.items()]:
            if name not in known:
                raise ValueError(f"{self.id}: found a range of {name!r}, expected one of {', '.join(known)}")
            if not 0.0 <= low < high:
                raise ValueError(f"{self.id}.{name}: found the range {low!r} to {high!r}, expected 0 <= low < high")
        if self.rigs not in (ALL_RIGS, PIEZO_BENDERS, OTHER_RIGS):
            raise ValueError(f"{self.id}.rigs: found {self.rigs!r}, expected 'all', 'piezo benders' or 'others'")
        if (self.forms is _no_form) == (self.found_by == ""):
            raise ValueError(f"{self.id}: found forms and found_by, or neither, expected one of them")

    @property
    def confusables(self) -> tuple[str, ...]:
        """The ids of the effects that leave something similar, the nearest first."""
        return tuple(self.resembles)

    def is_sought_in(self, piezo_bender: bool) -> bool:
        """Return whether a search tries it where the model is one of a piezo bender, or is not."""
        return self.rigs == ALL_RIGS or piezo_bender == (self.rigs == PIEZO_BENDERS)

    @property
    def page(self) -> str:
        """Its page in the documentation, from the root of the repository."""
        return f"docs/effects/{self.id}.md"

    @property
    def block(self) -> Block:
        """The block of the plant that computes it."""
        return BLOCKS[CALIBRATION if self.stage == CALIBRATION else self.id]

    @property
    def parameters(self) -> Mapping[str, Meaning]:
        """Unit, enforced bounds and meaning of its parameters, by their names in the model file."""
        known = meanings(self.block.parameters)
        return {name: known[name] for name in (_CALIBRATED_BY[self.id],)} if self.stage == CALIBRATION else known

    @property
    def defaults(self) -> dict[str, Any]:
        """What each parameter is where a model file does not say, forms included."""
        neutral = self.block.parameters()
        names = self.parameters if self.stage == CALIBRATION else self.block.parameters.__dataclass_fields__
        return {name: getattr(neutral, name) for name in names}

    def typical_range(self, parameter: str, full_voltage_V: float, full_stroke_um: float) -> Range | None:
        """Return the typical sizes of a parameter on a bench with another full drive, None where none are known."""
        return self._scaled(self.typical.get(parameter), parameter, full_voltage_V, full_stroke_um, self.relative)

    def covered_range(
        self, parameter: str, full_voltage_V: float, full_stroke_um: float, *, piezo_bender: bool = True
    ) -> Range | None:
        """Return the covered sizes of a parameter on a bench with another full drive, None where none are stated.

        On rigs that are no piezo benders every size is in proportion to their full drive.
        """
        relative = self.relative or not piezo_bender
        return self._scaled(self.covered.get(parameter), parameter, full_voltage_V, full_stroke_um, relative)

    def _scaled(
        self,
        limits: tuple[Any, ...] | None,
        parameter: str,
        full_voltage_V: float,
        full_stroke_um: float,
        relative: bool,
    ) -> Range | None:
        if limits is None:
            return None
        unit = self.parameters[parameter].unit
        factor = scaling(unit, full_voltage_V, full_stroke_um) if relative else 1.0
        return limits[0] * factor, limits[1] * factor
