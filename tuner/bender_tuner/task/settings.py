"""What a tuning is asked to do, checked when it is made. Costs nothing to import: the command line reads it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any

from bender_loop.control.pid import Limits
from bender_loop.errors import InputError
from bender_tuner.optimisers.methods import DEFAULT_BUDGET, METHODS

if TYPE_CHECKING:
    from bender_loop.control.sampling import Sampling

RULES = {"zn": "Ziegler-Nichols rule, PID", "simc": "SIMC, Skogestad's rule"}
"""Closed formulas, with what they are."""

OBJECTIVES = ("practitioner", "mse", "itae")
WISHES = ("max_ms", "max_overshoot_percent", "settle_within_s", "max_noise_gain_V_per_um")
"""Bounds that the practitioner's objective keeps."""
WEIGHTS = {
    "bounds": "bound_weight",
    "effort": "effort_weight",
    "final_error": "final_error_weight",
    "overshoot": "overshoot_weight",
    "worst_case": "worst_share",
}
"""Weights of the practitioner's objective, by their names on the command line, and what they are in `Priorities`."""
GAIN_UNITS = {"kp": "V/µm", "ki": "V/(µm s)", "kd": "V s/µm"}
"""Gains that can have bounds, by their names on the command line, with their units."""
_GAIN_SIZES = 1e-12, 1e12
PAPER_METHOD = "bas_printed"
GAIN_ERROR_PERCENT, LATE_FRAMES = 30.0, 1
"""Of a device that nobody has measured against its model."""

_CAMERA = {"rate_Hz": 30.0, "latency_frames": 1}
_PAPER = {"rate_Hz": 100.0, "latency_frames": 0, "exposure_s": 0.0}
LENGTH_S, LENGTH_FRAMES = 2.0, 60
"""Of a run: so long, and so many frames at least."""
_LONGEST_EXPOSURE_S = 0.015
_EXPOSED_SHARE = 0.45
_LEAST_EXPOSED_SHARE = 0.05
"""Of a period: a shorter exposure is an instant, and would cost a step of the plant for each of its lengths."""

_LARGEST_WEIGHT = 1e6
_MOST_FRAMES, _MOST_SUBSTEPS = 1_000_000, 1000
_BOUNDS: dict[str, tuple[float, float, str]] = {
    "setpoint_um": (1e-9, 1e6, "an atom is 1e-4 µm, a metre 1e6 µm"),
    "rate_Hz": (1e-4, 1e6, "a frame in three hours to a million in a second"),
    "latency_frames": (0, 1000, "a loop that waits longer cannot be tuned in a run"),
    "noise_um": (0.0, 1e6, "a metre"),
    "lower_V": (0.0, 1e5, "a hundred kilovolts"),
    "upper_V": (0.0, 1e5, "a hundred kilovolts"),
    "slew_V_per_s": (1e-6, 1e12, "slower, a run never leaves its start"),
    "late_frames": (0, 10, "a loop that waits longer cannot be tuned in a run"),
    "evaluations": (1, 10_000_000, "each is a whole run"),
    "seed": (0, 2**63, "of the random numbers"),
    "monte_carlo": (0, 1_000_000, "each is a whole run"),
}
"""Smallest and largest size of a setting, with the reason; beyond them numbers overflow or a run has no end."""


@dataclass(frozen=True, slots=True)
class TuneSettings:
    """One tuning.

    Attributes:
        method: a search of `METHODS` or a rule of `RULES`.
        objective: one of `OBJECTIVES`.
        setpoint_um: height of the step.
        rate_Hz: frames and commands per second.
        latency_frames: age of a frame when the controller gets it.
        exposure_s: a frame shows the mean over this time.
        noise_um: standard deviation of the measurement noise in the runs of the search.
        duration_s: length of a run.
        lower_V: smallest command.
        upper_V: largest command.
        slew_V_per_s: bound of the command's rate, inf for none.
        evaluations: budget of each search.
        seed: of searches, noise and Monte Carlo.
        monte_carlo: number of plants drawn at random for each set of gains, 0 for none.
        compare: further methods, each tuned with the same budget.
        max_ms: bound of Ms over gain and latency; this bound and the next three are those of the practitioner.
        max_overshoot_percent: bound of the nominal overshoot.
        settle_within_s: bound of the nominal settling time (2 %), None for any.
        max_noise_gain_V_per_um: bound of the command's noise per noise of the reading, None for any.
        weights: of the practitioner's objective that are not the standard ones, (name of `WEIGHTS`, value) each.
        gain_error_percent: the gain of the device may be off by so much either way; gains are judged at both ends too.
            None where nobody knows: gains then hold for `GAIN_ERROR_PERCENT`, and whether a model is followed is
            decided by what its diagnosis leaves open.
        late_frames: a frame may come later than planned by up to so many; gains are judged with that too. None as
            above, for `LATE_FRAMES`.
        decades: the search box spans so many powers of ten below and above the first guess.
        gain_bounds: of gains that are searched between given bounds instead, (name of `GAIN_UNITS`, low, high) each.

    Raises:
        InputError: a method or objective is unknown.
        ValueError: a number is out of its range.
    """

    method: str = "reliable_bas"
    objective: str = "practitioner"
    setpoint_um: float = 10.0
    rate_Hz: float = 30.0
    latency_frames: int = 1
    exposure_s: float = 0.015
    noise_um: float = 0.0
    duration_s: float = LENGTH_S
    lower_V: float = 0.0
    upper_V: float = 50.0
    slew_V_per_s: float = math.inf
    evaluations: int = DEFAULT_BUDGET
    seed: int = 0
    monte_carlo: int = 0
    compare: tuple[str, ...] = ()
    max_ms: float = 1.7
    max_overshoot_percent: float = 2.0
    settle_within_s: float | None = None
    max_noise_gain_V_per_um: float | None = None
    gain_error_percent: float | None = None
    late_frames: int | None = None
    decades: float = 1.5
    weights: tuple[tuple[str, float], ...] = ()
    gain_bounds: tuple[tuple[str, float, float], ...] = ()

    def __post_init__(self) -> None:
        for method in (self.method, *self.compare):
            if method not in METHODS and method not in RULES:
                raise InputError(f"method {method!r} is unknown: choose one of {', '.join((*METHODS, *RULES))}")
        if self.objective not in OBJECTIVES:
            raise InputError(f"objective {self.objective!r} is unknown: choose one of {', '.join(OBJECTIVES)}")
        if not math.isfinite(self.setpoint_um) or self.setpoint_um == 0.0:
            raise ValueError(f"setpoint must be a finite number other than 0, found {self.setpoint_um!r}")
        if not self.slew_V_per_s > 0.0:
            raise ValueError(f"slew must be > 0 V/s, found {self.slew_V_per_s!r}")
        for name, least in (("evaluations", 1), ("late_frames", 0), ("seed", 0), ("monte_carlo", 0)):
            value = getattr(self, name)
            if value is not None and value < least:
                raise ValueError(f"{name} must be >= {least}, found {getattr(self, name)!r}")
        if not (math.isfinite(self.lower_V) and math.isfinite(self.upper_V)):
            raise ValueError(f"voltage limits must be finite, found {self.lower_V!r} and {self.upper_V!r}")
        self._check_wishes()
        self._check_gain_bounds()
        self._check_sizes()
        self.sampling.ticks(self.duration_s)
        _ = self.limits

    def _check_wishes(self) -> None:
        for name, low, high in (
            ("max_ms", 1.05, 100.0), ("max_overshoot_percent", 0.01, 1000.0), ("settle_within_s", 1e-6, 1e6),
            ("max_noise_gain_V_per_um", 1e-9, 1e9), ("decades", 0.1, 6.0),
            ("gain_error_percent", 0.0, 90.0),
        ):  # fmt: skip
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise ValueError(f"{name} must be {low:g} to {high:g}, found {value!r}")
        for name, value in self.weights:
            most = 1.0 if name == "worst_case" else _LARGEST_WEIGHT
            if name not in WEIGHTS:
                raise InputError(f"weight {name!r} is unknown: choose one of {', '.join(WEIGHTS)}")
            if not 0.0 <= value <= most:
                raise ValueError(f"weight {name} must be 0 to {most:g}, found {value!r}")
        if self.settle_within_s is not None and self.settle_within_s > self.duration_s:
            raise ValueError(
                f"settle_within_s must be at most duration_s, {self.duration_s:g} s, found {self.settle_within_s!r}"
            )

    def _check_gain_bounds(self) -> None:
        for name, low, high in self.gain_bounds:
            if name not in GAIN_UNITS:
                raise InputError(f"bounds of {name!r}: there is no such gain, choose one of {', '.join(GAIN_UNITS)}")
            if not _GAIN_SIZES[0] <= low < high <= _GAIN_SIZES[1]:
                raise InputError(
                    f"bounds of {name}: found {low:g} to {high:g} {GAIN_UNITS[name]}, expected a low end above 0 (the "
                    f"search is logarithmic, from {_GAIN_SIZES[0]:g} to {_GAIN_SIZES[1]:g}) and a higher high end"
                )
        raw = [x for x in self.searches if METHODS[x].space == "raw"]
        if self.gain_bounds and raw:
            raise InputError(
                f"bounds of gains: found with {raw[0]}, which searches without bounds; leave one of them out"
            )
        if self.gain_bounds and not self.searches:
            raise InputError(f"bounds of gains: found with {self.method}, a rule that searches nothing; name a search")

    def _check_sizes(self) -> None:
        for name, (low, high, why) in _BOUNDS.items():
            value = getattr(self, name)
            if (
                value is not None
                and not low <= abs(value) <= high
                and not (name == "slew_V_per_s" and value == math.inf)
            ):
                raise ValueError(f"{name} must be {low:g} to {high:g} in size ({why}), found {value!r}")
        if 0.0 < self.exposure_s < 1.0 / (self.rate_Hz * _MOST_SUBSTEPS):
            raise ValueError(
                f"exposure_s must be 0 or at least 1/{_MOST_SUBSTEPS} of the period {1.0 / self.rate_Hz:.3g} s, found "
                f"{self.exposure_s!r}"
            )
        if self.duration_s * self.rate_Hz > _MOST_FRAMES:
            raise ValueError(
                f"duration_s must be at most {_MOST_FRAMES / self.rate_Hz:g} s, {_MOST_FRAMES} frames of a run at "
                f"{self.rate_Hz:g} Hz, found {self.duration_s!r}"
            )

    @property
    def sampling(self) -> "Sampling":
        """What the controller sees, with just as many plant steps in a period as the exposure asks for."""
        from bender_loop.control.sampling import Sampling

        substeps = 1
        if self.exposure_s > 0.0 and math.isfinite(self.exposure_s) and self.rate_Hz > 0.0:
            substeps = max(2, math.ceil(2.0 / (self.exposure_s * self.rate_Hz) - 1e-9))
        return Sampling(self.rate_Hz, self.latency_frames, self.exposure_s, self.noise_um, substeps=substeps)

    @property
    def limits(self) -> Limits:
        """Of the command."""
        return Limits(self.lower_V, self.upper_V)

    @property
    def gain_factors(self) -> tuple[float, ...]:
        """On the gain of the model: the plants that the gains must hold for."""
        percent = GAIN_ERROR_PERCENT if self.gain_error_percent is None else self.gain_error_percent
        error = percent / 100.0
        return (1.0 - error, 1.0, 1.0 + error) if error else (1.0,)

    @property
    def extra_frames(self) -> tuple[int, ...]:
        """Beyond `latency_frames`: the latencies that the gains must hold for."""
        late = LATE_FRAMES if self.late_frames is None else self.late_frames
        return (0, late) if late else (0,)

    @property
    def searches(self) -> tuple[str, ...]:
        """The methods that search, the asked one first, each once."""
        return tuple(dict.fromkeys(method for method in (self.method, *self.compare) if method in METHODS))


def make_settings(**given: Any) -> TuneSettings:
    """Settings from what was given, None standing for the default that suits objective and method.

    The practitioner's objective and ITAE see the plant through a camera: 30 Hz, one frame of latency, an exposure of
    15 ms or 45 % of the period, none in a slow loop (below 3.3 Hz). The paper's MSE, and its method, see it at 100 Hz
    without delay. A run lasts 2 s, or 60 frames where that is longer.

    Raises:
        InputError: a method or objective is unknown, or a number is out of its range.
    """
    known = {name: value for name, value in given.items() if value is not None}
    if isinstance(known.get("compare"), str):
        known["compare"] = (known["compare"],)
    _check_kinds(known)
    known.setdefault("objective", "mse" if known.get("method") == PAPER_METHOD else "practitioner")
    if "weights" in known:
        known["weights"] = tuple(dict(known["weights"]).items())
    if "gain_bounds" in known:
        known["gain_bounds"] = tuple({x[0]: x for x in known["gain_bounds"]}.values())
    wishes = [name for name in (*WISHES, "weights") if known.get(name) not in (None, ())]
    if wishes and known["objective"] != "practitioner":
        raise InputError(f"{', '.join(wishes)}: found with the objective {known['objective']}, expected practitioner")
    for name, value in (_PAPER if known["objective"] == "mse" else _CAMERA).items():
        known.setdefault(name, value)
    if known["rate_Hz"] > 0.0:
        known.setdefault("duration_s", max(LENGTH_S, LENGTH_FRAMES / known["rate_Hz"]))
        exposure_s = min(_LONGEST_EXPOSURE_S, _EXPOSED_SHARE / known["rate_Hz"])
        known.setdefault("exposure_s", exposure_s if exposure_s * known["rate_Hz"] >= _LEAST_EXPOSED_SHARE else 0.0)
    try:
        return TuneSettings(**known)
    except ValueError as error:
        raise InputError(str(error)) from error


def _check_kinds(given: Mapping[str, Any]) -> None:
    """Refuse names that are no setting, and what is no number where one is needed."""
    settings = {x.name: x for x in fields(TuneSettings)}
    for name, value in given.items():
        if name not in settings:
            raise InputError(f"{name}: no such setting, expected one of {', '.join(settings)}")
        numeric = isinstance(settings[name].default, float) or name in (*_BOUNDS, "gain_error_percent")
        if numeric and (isinstance(value, bool) or not isinstance(value, Real)):
            raise InputError(f"{name}: found {value!r}, expected a number")
        whole = isinstance(settings[name].default, int) or name == "late_frames"
        if whole and not isinstance(value, Integral):
            raise InputError(f"{name}: found {value!r}, expected a whole number")
