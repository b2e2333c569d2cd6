"""What is known of an FMU that another model stands in for, and of its parameters that were suspected."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bender_report.wording import figure, listed

Array = NDArray[np.float64]

LINEAR_WITHIN = 1e-3
"""Of the spread; below it an FMU is called linear."""


@dataclass(frozen=True, slots=True)
class Suspected:
    """What the records say of the FMU's own parameters that were suspected.

    Attributes:
        moved: name, value as given, value found, standard deviation, unit of each that is off.
        unseen: why a parameter was left as it is, by name.
        combinations: parameters that act only together.
        rival: what would explain the records as well; None where nothing would.
    """

    moved: tuple[tuple[str, float, float, float, str], ...]
    unseen: Mapping[str, str]
    combinations: tuple[tuple[str, ...], ...]
    rival: str | None = None

    def sentences(self) -> list[str]:
        """Return what a user has to know of it."""
        found = [f"the parameter {name} is left as it is: {why}" for name, why in self.unseen.items()]
        found += [f"only together: {', '.join(x)}" for x in self.combinations]
        if self.rival:
            found.append(f"the records are explained as well by {self.rival}")
        if not self.moved:
            found.append("every suspected parameter agrees with its given value, as closely as the records tell")
        return found

    def ambiguity(self, effects: Sequence[str]) -> str:
        """Return what the records cannot distinguish, where a parameter explains as much as effects do; "" else."""
        if not self.rival:
            return ""
        moved = [f"{name} at {figure(found, 4)}" for name, _, found, *_ in self.moved]
        return f"These records cannot tell {listed([*moved, *effects])} from {self.rival}."

    def to_dict(self) -> dict[str, object]:
        """Return it as `diagnosis.json` has it."""
        return {
            "off": [x[0] for x in self.moved],
            "unseen": dict(self.unseen),
            "act_only_together": [list(x) for x in self.combinations],
            "rival": self.rival,
        }


@dataclass(frozen=True, slots=True)
class StandIn:
    """What is known of an FMU that another model stands in for.

    Attributes:
        fmu: its path.
        input: the variable that takes the voltage.
        output: the variable that is read.
        structure: of the stand-in, `gain+mode` for example.
        departure: rms of y(u) - 2 y(u / 2) over the spread of y, with y(0) counted once; 0 for a linear FMU.
        difference_um: rms of FMU minus stand-in over the records, taken from their readings.
        spread_um: standard deviation of the FMU's readings over the records.
        start_values: parameters of the FMU that were set, by name.
        beside: titles of what acts inside the FMU, and stands beside it in the corrected one.
        inner_step_s: of the corrected FMU; 0 where nothing was corrected.
        no_container: why there is no corrected FMU but the one of the stand-in; None where there is.
        differences_um: (n,) of every record, what FMU and stand-in differ by.
        suspected: what the records say of suspected parameters; None where none were named.
        further: further inputs of the FMU, which follow columns of the records.
    """

    fmu: str
    input: str
    output: str
    structure: str
    departure: float
    difference_um: float
    spread_um: float
    start_values: tuple[tuple[str, float], ...] = ()
    beside: tuple[str, ...] = ()
    inner_step_s: float = 0.0
    no_container: str | None = None
    differences_um: tuple[Array, ...] = field(default=(), repr=False, compare=False)
    suspected: Suspected | None = None
    further: tuple[str, ...] = ()

    @property
    def is_linear(self) -> bool:
        """Whether half the voltage gives half the answer."""
        return self.departure < LINEAR_WITHIN

    def sentences(self) -> list[str]:
        """Return what a user has to know of it."""
        kind = "linear" if self.is_linear else f"not linear ({100.0 * self.departure:.2g} % from proportional)"
        said = (
            f"the model is {self.fmu} ({self.input} to {self.output}), {kind}; {self.structure.replace('+', ' + ')} "
            f"stands in for it; the {figure(self.difference_um)} µm rms by which it deviates from the FMU over the "
            "records were subtracted from the readings before the search"
        )
        found = [said]
        if self.further:
            found.append(
                f"the further inputs {', '.join(self.further)} follow the records; effects act on {self.input} and on "
                f"{self.output} only"
            )
        if not self.is_linear:
            found.append(
                "the effects were put around the FMU itself and fitted again there"
                if self.no_container is None
                else "the effects were fitted around the stand-in, and hold for the FMU to first order"
            )
        if self.beside:
            found.append(
                f"{', '.join(self.beside)} acts inside the FMU. The corrected FMU adds the difference between the "
                "stand-in with and without it. If the FMU has a parameter for it, name that by --suspect"
            )
        if self.inner_step_s:
            found.append(f"the corrected FMU takes communication steps that are multiples of {self.inner_step_s!r} s")
        if self.no_container:
            found.append(f"{self.no_container}; the FMU that is written is that of the corrected stand-in")
        return found + (self.suspected.sentences() if self.suspected else [])

    def to_dict(self) -> dict[str, object]:
        """Return it as `diagnosis.json` has it."""
        return {
            "fmu": self.fmu,
            "input": self.input,
            "output": self.output,
            "stand_in": self.structure,
            "linear": self.is_linear,
            "departure": self.departure,
            "difference_um": self.difference_um,
            "further_inputs": list(self.further),
            "start_values": dict(self.start_values),
            "beside": list(self.beside),
            "inner_step_s": self.inner_step_s or None,
            "suspects": self.suspected.to_dict() if self.suspected else None,
        }
