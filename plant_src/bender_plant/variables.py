"""The table of FMI variables: one list from which the FMU, its documentation and the checks are made."""

from dataclasses import dataclass, replace
from typing import Any

from bender_plant.blocks import BLOCKS
from bender_plant.model import Model
from bender_plant.parameter import meanings, spoken_name


@dataclass(frozen=True, slots=True)
class Variable:
    """One variable of the plant FMU, as FMI 2.0 names its attributes."""

    name: str
    causality: str
    variability: str
    unit: str
    start: float | None
    minimum: float | None
    maximum: float | None
    description: str


SIGNALS = (
    Variable("voltage", "input", "continuous", "V", 0.0, None, None, "command, held over a communication step"),
    Variable(
        "displacement", "output", "continuous", "m", None, None, None,
        "what the sensor reads at the end of the step, before the next command acts",
    ),
    Variable("tip_displacement", "output", "continuous", "m", None, None, None, "true displacement of the tip"),
)  # fmt: skip


def _parameters(settings: Any, prefix: str, about: str) -> list[Variable]:
    found: list[Variable] = []
    for name, meaning in meanings(settings).items():
        value = getattr(settings, name)
        spoken = f"{prefix}.{spoken_name(name, meaning.unit)}"
        many = isinstance(value, tuple)
        for k, number in enumerate(value if many else (value,)):
            found.append(
                Variable(
                    name=f"{spoken}[{k + 1}]" if many else spoken,
                    causality="parameter",
                    variability="tunable" if meaning.tunable else "fixed",
                    unit=meaning.unit,
                    start=float(number),
                    minimum=meaning.low,
                    maximum=meaning.high,
                    description=f"{about}: {meaning.text}",
                )
            )
    return found


def _of_the_records(signal: Variable, model: Model) -> Variable:
    """Return a signal with what its unit stands for where the model was learned from records in others."""
    if model.origin is None:
        return signal
    usual, unit = ("V", model.origin.command_unit) if signal.causality == "input" else ("um", model.origin.reading_unit)
    if unit in ("", usual):
        return signal
    return replace(signal, description=f"{signal.description}; 1 {usual} stands for 1 {unit} of the records")


def variables(model: Model) -> tuple[Variable, ...]:
    """Return every variable of the plant FMU of a model: signals first, then parameters in chain order."""
    found = [_of_the_records(x, model) for x in SIGNALS]
    if model.beam is not None:
        found += _parameters(model.beam, "beam", "Composite beam")
        for k, layer in enumerate(model.beam.layers):
            found += _parameters(layer, f"beam.layer[{k + 1}]", f"Layer {k + 1} ({layer.name})")
    for settings in model.blocks:
        found += _parameters(settings.parameters, settings.id, BLOCKS[settings.id].title)
    return tuple(found)
