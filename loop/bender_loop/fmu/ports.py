"""Which variables of an FMU are used: its input, its output, its parameters."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

from fmpy.model_description import BaseUnit, ModelDescription, ScalarVariable

from bender_loop.errors import InputError
from bender_loop.tables import units
from bender_loop.tables.quantities import MICROMETRE, USUAL, VOLT, Quantities, factor

_VOLT = {"kg": 1, "m": 2, "s": -3, "A": -1}
_METRE = {"m": 1}
_BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
_UNSTATED = ("", "-", "1")
_STANDS_FOR = re.compile(r"1 (V|um) stands for 1 (.+) of the records$")
"""How the FMU of a model of another device ends the description of its input and its outputs."""
DEFAULT_UNITS = ("V", "m")
"""Of an input and an output for which neither the FMU nor anybody states one."""
REALS = ("Real", "Float64", "Float32")
"""Types of real numbers in FMI 2.0 and 3.0."""
_PORTS = ("Real", "Float64")
_WHOLE = ("Integer", "Boolean", *(f"{sign}Int{bits}" for bits in (8, 16, 32, 64) for sign in ("", "U")))


@dataclass(frozen=True, slots=True)
class Port:
    """An input or output of the FMU.

    Attributes:
        name: of the variable.
        reference: its value reference.
        type: Real, or Float64 in FMI 3.0.
        unit: as declared, None where it is not.
        internal: V per unit of an input, um per unit of an output.
        stands_for: what 1 V of it, or 1 um, is in the records that its model was learned from; "" for just that.
    """

    name: str
    reference: int
    type: str
    unit: str | None
    internal: float
    stands_for: str = ""


class Setting(NamedTuple):
    """A value for a parameter of the FMU, its type in the words of FMI 2.0 or 3.0."""

    type: str
    reference: int
    value: float


def find_input(path: Path, description: ModelDescription, name: str | None = None, own: Quantities = USUAL) -> Port:
    """The voltage input: `name`, or the only Real input, or the one called `voltage`.

    An input without unit is in V, or in what `own` states; one of another kind than a voltage is set as it stands, one
    unit per volt. Where `own` has the unit of another quantity, the input is brought to that; without a unit it is in
    what people stated.

    Raises:
        InputError: there is no such variable, or it cannot be told which.
    """
    variable = _find(path, description, name, "input", "voltage")
    if own.command != VOLT:
        return _port_of(path, variable, own.command, own.stated[0], VOLT)
    return _port(description, variable, units.VOLTAGE_V, _VOLT, own.stated[0] or DEFAULT_UNITS[0])


def find_output(path: Path, description: ModelDescription, name: str | None = None, own: Quantities = USUAL) -> Port:
    """The displacement output: `name`, or the only Real output, or the one called `displacement`.

    An output without unit is in m, or in what `own` states; one of another kind than a length is read as it stands, one
    um per unit. Where `own` has the unit of another quantity, the output is brought to that; without a unit it is in
    what people stated.

    Raises:
        InputError: there is no such variable, or it cannot be told which.
    """
    variable = _find(path, description, name, "output", "displacement")
    if own.reading != MICROMETRE:
        return _port_of(path, variable, own.reading, own.stated[1], MICROMETRE)
    return _port(description, variable, units.LENGTH_UM, _METRE, own.stated[1] or DEFAULT_UNITS[1])


def find_further_input(path: Path, description: ModelDescription, name: str, unit: str) -> Port:
    """An input beside the command; `internal` is what a value in its own unit is in the given one.

    Raises:
        InputError: there is no such input, or the unit is of another quantity.
    """
    variable = _find(path, description, name, "input", name)
    return _port_of(path, variable, unit, "") if unit else _as_it_stands(variable)


def find_controller_ports(
    path: Path, description: ModelDescription, names: tuple[str, str, str] = ("setpoint", "measurement", "command")
) -> tuple[Port, Port, Port]:
    """The ports of a controller: set-point and measurement, lengths, and its command, a voltage.

    `internal` is um per unit of the inputs and V per unit of the output; without a declared unit they are in m and V.

    Raises:
        InputError: there is no such variable.
    """
    setpoint, measurement = (_find(path, description, name, "input", name) for name in names[:2])
    command = _find(path, description, names[2], "output", names[2])
    first, second = (_port(description, x, units.LENGTH_UM, _METRE, DEFAULT_UNITS[1]) for x in (setpoint, measurement))
    return first, second, _port(description, command, units.VOLTAGE_V, _VOLT, DEFAULT_UNITS[0])


def is_port(variable: ScalarVariable) -> bool:
    """Return whether a variable is a single real number, as inputs and outputs are: Real, or Float64 in FMI 3.0."""
    return variable.type in _PORTS and not variable.dimensions


def parameter_settings(path: Path, description: ModelDescription, values: Mapping[str, float]) -> list[Setting]:
    """The parameters in `values` by type and value reference.

    Raises:
        InputError: an unknown name, a variable that is no parameter, or a value of the wrong type or out of the
            declared bounds.
    """
    return [_setting(path, description, name, value) for name, value in values.items()]


def _find(
    path: Path, description: ModelDescription, name: str | None, causality: Literal["input", "output"], usual: str
) -> ScalarVariable:
    reals = [
        variable for variable in description.modelVariables if variable.causality == causality and is_port(variable)
    ]
    names = [variable.name for variable in reals]
    if name is None:
        name = names[0] if len(names) == 1 else usual
        if name not in names:
            if not names:
                raise InputError(
                    f"{path}: found no {causality} that is one real number, expected one: an FMU with an "
                    "input to drive and an output to read"
                )
            found = f"{len(names)} Real {causality}s, none called {usual}"
            raise InputError(f"{path}: found {found}; choose one with --{causality} NAME ({units.near(usual, names)})")
    variable = _by_name(description, name)
    if variable is None:
        raise InputError(f"{path}: found no variable {name!r}, expected a Real {causality}; {units.near(name, names)}")
    if variable.causality != causality or not is_port(variable):
        kind = f"{variable.type} array," if variable.dimensions else variable.type
        raise InputError(
            f"{path}: {name!r} is a {kind} {variable.causality or 'local'}, expected a Real {causality}; "
            f"{units.near(name, names)}"
        )
    return variable


def _by_name(description: ModelDescription, name: str) -> ScalarVariable | None:
    return next((variable for variable in description.modelVariables if variable.name == name), None)


def _port(
    description: ModelDescription,
    variable: ScalarVariable,
    table: dict[str, units.Scale],
    dimension: dict[str, int],
    stated: str,
) -> Port:
    declared = variable.unit or (variable.declaredType.unit if variable.declaredType else None)
    unit = None if declared is None or declared.strip() in _UNSTATED else declared
    reference = int(variable.valueReference)
    known = units.find(table, unit or stated)
    if known is not None:
        meant = _unit_of_records(variable) if unit else ""
        return Port(variable.name, reference, variable.type, unit, known[0] / known[1], meant)
    base: Any = next((entry.baseUnit for entry in description.unitDefinitions if entry.name == unit), None)
    if base is not None and all(_exponent(base, name) == dimension.get(name, 0) for name in _BASE):
        internal = 1e6 if dimension is _METRE else 1.0
        return Port(variable.name, reference, variable.type, unit, internal * float(base.factor))
    return Port(variable.name, reference, variable.type, unit, 1.0)


def _unit_of_records(variable: ScalarVariable) -> str:
    """Return what 1 V of an input, or 1 um of an output, of the FMU of a model stands for; "" for nothing else."""
    found = _STANDS_FOR.search(variable.description or "")
    return found[2] if found else ""


def _port_of(path: Path, variable: ScalarVariable, shown: str, stated: str, usual: str = "") -> Port:
    """Return a port of another quantity than volts and lengths, in the unit that a record has."""
    declared = variable.unit or (variable.declaredType.unit if variable.declaredType else None)
    unit = None if declared is None or declared.strip() in _UNSTATED else declared
    meant = _unit_of_records(variable) if usual and unit else ""
    try:
        if meant and unit:
            internal = factor(unit, usual) * factor(meant, shown)
        else:
            internal = factor(unit or stated or shown, shown)
    except InputError as problem:
        raise InputError(f"{path}: {variable.name}: {problem}; say what the record has by --units") from None
    return Port(variable.name, int(variable.valueReference), variable.type, unit, internal)


def _as_it_stands(variable: ScalarVariable) -> Port:
    return Port(variable.name, int(variable.valueReference), variable.type, variable.unit, 1.0)


def _exponent(base: BaseUnit, name: str) -> int:
    return int(getattr(base, name) or 0)


def _setting(path: Path, description: ModelDescription, name: str, value: float) -> Setting:
    parameters = [variable.name for variable in description.modelVariables if variable.causality == "parameter"]
    variable = _by_name(description, name)
    if variable is None:
        raise InputError(f"{path}: found no parameter {name!r}; {units.near(name, parameters)}")
    if variable.causality not in ("parameter", "input"):
        raise InputError(
            f"{path}: {name!r} is a {variable.causality or 'local'} variable, expected a parameter; "
            f"{units.near(name, parameters)}"
        )
    if not math.isfinite(value):
        raise InputError(f"{path}: parameter {name!r}: found {value!r}, expected a finite number")
    kind = variable.type
    if kind not in (*REALS, *_WHOLE) or (kind in _WHOLE and value != int(value)) or variable.dimensions:
        raise InputError(f"{path}: parameter {name!r}: found {value!r}, expected a value of type {kind}")
    lower, upper = (math.nan if bound is None else float(bound) for bound in (variable.min, variable.max))
    if value < lower or value > upper:
        bounds = f"at least {lower:g}" if value < lower else f"at most {upper:g}"
        unit = f" {variable.unit}" if variable.unit not in (None, "", "1") else ""
        raise InputError(f"{path}: parameter {name!r}: found {value!r}, expected {bounds}{unit}")
    return Setting(kind, int(variable.valueReference), float(value))
