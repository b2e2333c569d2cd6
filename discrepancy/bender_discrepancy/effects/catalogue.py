"""The catalogue of effects: what each one is, leaves behind, is mistaken for, and how large it usually is.

The words and numbers stand in `catalogue.toml`; units, enforced bounds and meanings of the parameters come from the
blocks themselves, so that nothing is said twice. The order is that of the contract: along the chain, from the
command to the reading.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bender_plant.blocks import BLOCKS, Block
from bender_plant.parameter import Meaning, meanings

FULL_VOLTAGE_V = 50.0
FULL_STROKE_um = 23.1
"""Full drive of the paper's actuator: the ranges of `relative` effects hold for it (50 V give 23.14 um)."""

CALIBRATION = "calibration"
_CALIBRATED_BY = {"gain_error": "gain", "offset": "offset_um"}
_POWERS = {
    "V": (1.0, 0.0),
    "1/V": (-1.0, 0.0),
    "um/V": (-1.0, 1.0),
    "um/V2": (-2.0, 1.0),
    "1/um": (0.0, -1.0),
    "1/um2": (0.0, -2.0),
}

Range = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Effect:
    """One effect.

    Attributes:
        id: the contract's name.
        title: a few words.
        stage: where in the chain it acts; "calibration" for what is freely recalibrated.
        summary: what it is, one line.
        signature: what it leaves in the residual.
        confusables: ids of the effects that leave something similar, the nearest first.
        separation: what tells them apart.
        excitation: which drive shows it.
        typical: parameter -> (low, high, where that comes from), of this kind of bench.
        covered: parameter -> (low, high) that a search covers at least.
        unusual: what makes it, or a large value of it, unusual for this actuator; None where nothing does.
        page: its page in the documentation, from the root of the repository.
        relative: the ranges hold for `FULL_VOLTAGE_V` and `FULL_STROKE_um` and scale with the record's own.
        example: parameters of the picture of its signature.
        drive: what the plant of that picture is driven with, see `signature_drives.DRIVES`.
        view: what that picture looks at, see `signature_views.VIEWS`.

    Ranges are those of the size where a parameter may have either sign.

    Raises:
        ValueError: a range is empty or names no parameter of the effect's block.
    """

    id: str
    title: str
    stage: str
    summary: str
    signature: str
    confusables: tuple[str, ...]
    separation: str
    excitation: str
    typical: dict[str, tuple[float, float, str]]
    covered: dict[str, Range]
    unusual: str | None
    page: str
    relative: bool
    example: dict[str, Any]
    drive: str
    view: str

    def __post_init__(self) -> None:
        known = self.parameters
        for name, (low, high, *_) in (self.typical | self.covered).items():
            if name not in known:
                raise ValueError(f"{self.id}: found a range of {name!r}, expected one of {', '.join(known)}")
            if not 0.0 <= low < high:
                raise ValueError(f"{self.id}.{name}: found the range {low!r} to {high!r}, expected 0 <= low < high")

    @property
    def block(self) -> Block:
        """The block of the plant that computes it."""
        return BLOCKS[CALIBRATION if self.stage == CALIBRATION else self.id]

    @property
    def parameters(self) -> dict[str, Meaning]:
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
        return self._scaled(self.typical.get(parameter), parameter, full_voltage_V, full_stroke_um)

    def covered_range(self, parameter: str, full_voltage_V: float, full_stroke_um: float) -> Range | None:
        """Return the covered sizes of a parameter on a bench with another full drive, None where none are stated."""
        return self._scaled(self.covered.get(parameter), parameter, full_voltage_V, full_stroke_um)

    def _scaled(
        self, limits: tuple[Any, ...] | None, parameter: str, full_voltage_V: float, full_stroke_um: float
    ) -> Range | None:
        if limits is None:
            return None
        volts, microns = _POWERS[self.parameters[parameter].unit] if self.relative else (0.0, 0.0)
        factor = (full_voltage_V / FULL_VOLTAGE_V) ** volts * (full_stroke_um / FULL_STROKE_um) ** microns
        return limits[0] * factor, limits[1] * factor


def _effect(effect_id: str, entry: Mapping[str, Any]) -> Effect:
    block = BLOCKS.get(effect_id)
    example = {name: tuple(x) if isinstance(x, list) else x for name, x in entry["example"].items()}
    return Effect(
        id=effect_id,
        title=block.title if block else entry["title"],
        stage=block.stage if block else CALIBRATION,
        summary=entry["summary"],
        signature=entry["signature"],
        confusables=tuple(entry["confusables"]),
        separation=entry["separation"],
        excitation=entry["excitation"],
        typical={name: (low, high, text) for name, (low, high, text) in entry["typical"].items()},
        covered={name: (low, high) for name, (low, high) in entry["covered"].items()},
        unusual=entry.get("unusual"),
        page=f"docs/effects/{effect_id}.md",
        relative=entry.get("relative", False),
        example=example,
        drive=entry["drive"],
        view=entry["view"],
    )


def _read() -> dict[str, Effect]:
    text = Path(__file__).with_name("catalogue.toml").read_text(encoding="utf-8")
    return {effect_id: _effect(effect_id, entry) for effect_id, entry in tomllib.loads(text).items()}


EFFECTS: dict[str, Effect] = _read()
