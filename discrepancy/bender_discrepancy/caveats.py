"""What a person should know beside the verdict: unusual values, readings set aside, what the records cannot show."""

from dataclasses import dataclass

import numpy as np

from .catalogue import EFFECTS
from .diagnose import Diagnosis
from .excitation import describe
from .findings import Findings, Named
from .parameters import Number
from .wording import fields, figure, quantity

# of rows set aside that are listed one by one
MOST_LISTED = 50
# of the file in which row 0 stands
FIRST_LINE = 2


@dataclass(frozen=True, slots=True)
class SetAside:
    """Readings of one record that did not count: rows are those of the record, the first is 0."""

    rows: int
    lost: int
    outlying: tuple[int, ...]


def set_aside(diagnosis: Diagnosis) -> list[SetAside]:
    """Return for every record which readings did not count."""
    found = []
    for x in diagnosis.bench.observations:
        seen = np.isfinite(x.measured_um)
        outlying = np.flatnonzero(seen & ~x.usable)
        found.append(SetAside(seen.size, int(np.count_nonzero(~seen)), tuple(int(row) for row in outlying)))
    return found


def warnings(findings: Findings) -> list[str]:
    """Return the warnings, the weightiest first."""
    found = [x for effect in findings.effects for x in _unusual(effect)]
    found += [x for effect in findings.added for x in _undetermined(effect)]
    found += _left_out(findings)
    found += _untried(findings.diagnosis)
    found += _counted(findings.diagnosis)
    return found


def _unusual(effect: Named) -> list[str]:
    about = EFFECTS[effect.id]
    found = [
        f"{effect.id}.{x.name} = {quantity(x.value, x.unit)} is unusual, {_typical(x)}"
        for x in effect.numbers
        if x.unusual
    ]
    if found and about.unusual:
        found[0] += f"; {about.unusual}"
    return found


def _typical(number: Number) -> str:
    low, high = number.typical or (0.0, 0.0)
    ends = f"{figure(low)} to {quantity(high, number.unit)}"
    return f"typical sizes are {ends} ({number.why})" if number.why else f"typical sizes are {ends}"


def _undetermined(effect: Named) -> list[str]:
    names = [field for field, known in fields(effect.numbers).items() if all(_is_open(x) for x in known)]
    if not names:
        return []
    return [f"{effect.id}: the records hardly determine {', '.join(names)}; take the values as one choice of many"]


def _is_open(number: Number) -> bool:
    return not np.isfinite(number.std) or number.std > abs(number.value) > 0.0


def _left_out(findings: Findings) -> list[str]:
    coarse = findings.lattice
    if coarse is None or coarse.is_worth_it:
        return []
    return [
        f"the readings are multiples of {quantity(coarse.step_um, 'um')}; that counts in the noise floor, but is not "
        "put into the model: rounding the simulation would not bring it nearer"
    ]


def _untried(diagnosis: Diagnosis) -> list[str]:
    if not diagnosis.untried:
        return []
    names = ", ".join(diagnosis.untried)
    return [f"{names}: not tried, since the ringing would have to be simulated in full over the whole record"]


def _counted(diagnosis: Diagnosis) -> list[str]:
    found = []
    for k, x in enumerate(set_aside(diagnosis)):
        name = f"record {k + 1}: " if len(diagnosis.records) > 1 else ""
        if x.lost:
            found.append(f"{name}{x.lost} of {x.rows} frames were lost and did not count")
        if x.outlying:
            listed = ", ".join(str(row + FIRST_LINE) for row in x.outlying[:8]) + (", …" if len(x.outlying) > 8 else "")
            found.append(f"{name}{len(x.outlying)} outlying readings were set aside, lines {listed}")
    return found


def excitation_of(diagnosis: Diagnosis) -> list[str]:
    """Return what every record was driven with, in words."""
    return [describe(x.time_s, x.drive.voltage_V) for x in diagnosis.bench.observations]
