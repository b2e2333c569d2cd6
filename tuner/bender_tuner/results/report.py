"""The robustness report: what a set of gains is worth beyond one step response."""

import math
from dataclasses import asdict, dataclass
from typing import Any

from bender_loop.control.pid import Gains
from bender_tuner.model.disturbances import LoadRejection, load_rejection, noise_gain_V_per_um
from bender_tuner.model.ensemble import Ensemble
from bender_tuner.model.margins import Margins, margins


@dataclass(frozen=True, slots=True)
class CaseMargins:
    """Margins of one case of the ensemble."""

    gain_factor: float
    latency_frames: int
    margins: Margins
    rival: str = ""


@dataclass(frozen=True, slots=True)
class RobustnessReport:
    """Robustness of one set of gains.

    Attributes:
        nominal: margins of the nominal loop.
        worst_sensitivity_peak: largest Ms over the ensemble; inf if a case is unstable.
        unstable_cases: number of unstable cases.
        noise_gain_V_per_um: command noise per measurement noise, nominal loop.
        load_rejection: answer of the nominal loop to a voltage of 1 V added to the command.
        cases: margins of every case.
    """

    nominal: Margins
    worst_sensitivity_peak: float
    unstable_cases: int
    noise_gain_V_per_um: float
    load_rejection: LoadRejection
    cases: tuple[CaseMargins, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain nested data for JSON; a figure that is infinite or does not exist is None."""
        return json_ready(asdict(self))


def robustness_report(gains: Gains, ensemble: Ensemble) -> RobustnessReport:
    """Margins of all cases; noise gain and load rejection of the nominal one."""
    cases = tuple(
        CaseMargins(case.gain_factor, case.latency_frames, margins(gains, case.delayed), case.rival)
        for case in ensemble.cases
    )
    nominal = ensemble.nominal.delayed
    return RobustnessReport(
        nominal=margins(gains, nominal),
        worst_sensitivity_peak=max(case.margins.sensitivity_peak for case in cases),
        unstable_cases=sum(not case.margins.stable for case in cases),
        noise_gain_V_per_um=noise_gain_V_per_um(gains, nominal),
        load_rejection=load_rejection(gains, nominal),
        cases=cases,
    )


def json_ready(value: Any) -> Any:
    """Nested data with tuples as lists and every number that JSON has no word for as None."""
    if isinstance(value, dict):
        return {key: json_ready(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [json_ready(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
