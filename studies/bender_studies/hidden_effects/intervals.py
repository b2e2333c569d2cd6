"""Stated intervals held to the truth: numbers of single effects that are hidden in the catalogue's own equation.

Only there does a number have one true value. Everything else, the record and what it is read with, is drawn and
simulated by the independent generator.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import NormalDist
from typing import TYPE_CHECKING

from bender_studies.hidden_effects.figures import wilson
from bender_studies.hidden_effects.trial import MODEL
from bender_studies.runner import in_processes

if TYPE_CHECKING:
    from bender_discrepancy.diagnosis import Diagnosis
    from bender_proving import Case, Hidden

WITHIN = 0.95
DEVIATIONS = NormalDist().inv_cdf(0.5 + 0.5 * WITHIN)
DIGITS = 1e-9
"""Of a number, that a record's file does not hold."""
ROUNDED = "sensor_quantisation"
"""Rounds each reading; its benches take snapshots."""
EXPOSED = "exposed"
"""The row of all benches whose camera is exposed for some time."""
LAG = {"source_resistance": "time_constant_s", "sensor_lag": "time_constant_s"}
"""Before or behind a linear plant a lag is the same."""


@dataclass(frozen=True, slots=True)
class Number:
    """What a diagnosis said of one record.

    Attributes:
        verdict: the contract's word, "error" where it failed.
        effects: that it lists.
        found: the number asked for, nan where it is not among those.
        deviation: its stated standard deviation.
        error: what went wrong, "" where nothing did.
        interval: its stated interval of 95 %, None where there is none.
    """

    verdict: str
    effects: tuple[str, ...] = ()
    found: float = math.nan
    deviation: float = math.nan
    error: str = ""
    interval: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class Known:
    """An effect whose number has one true value.

    Attributes:
        form: of the generator, with the catalogue's own equation.
        numbers: the generator's, by the magnitude.
        asked: what the number is called, by the effects that do the same.
        truth: its value, of what is hidden.
    """

    form: str
    numbers: Callable[["Hidden"], Mapping[str, float]]
    asked: Mapping[str, str]
    truth: Callable[["Hidden"], float] = lambda hidden: hidden.magnitude


def _as_drawn(hidden: "Hidden") -> Mapping[str, float]:
    return dict(hidden.parameters)


KNOWN: Mapping[str, Known] = {
    "transport_delay": Known(
        "command", lambda x: {"command_s": x.magnitude, "reading_s": 0.0}, {"transport_delay": "delay_s"}
    ),
    "supply_quantisation": Known("half_to_even", _as_drawn, {"supply_quantisation": "step_V"}),
    "slew_limit": Known(
        "hard", lambda x: {"rate_V_per_s": x.magnitude, "landing_s": 0.0}, {"slew_limit": "slew_rate_V_per_s"}
    ),
    "supply_fall_lag": Known(
        "resistor", lambda x: {"tau_s": x.magnitude, "bleed_V": 0.0}, {"supply_fall_lag": "time_constant_s"}
    ),
    "source_resistance": Known("lumped", lambda x: {"tau_s": x.magnitude, "second_tau_s": 0.0}, LAG),
    "dead_zone": Known(
        "sharp", lambda x: {"half_width_V": x.magnitude, "shoulder_V": 0.0}, {"dead_zone": "threshold_V"}
    ),
    "tip_mass": Known(
        "added_mass",
        lambda x: {"frequency_ratio": 1.0 + x.magnitude, "static_gain": 1.0},
        {"tip_mass": "frequency_ratio"},
        lambda x: 1.0 + x.magnitude,
    ),
    "structural_damping": Known(
        "viscous",
        lambda x: {"damping_ratio": x.magnitude, "drag_per_um": 0.0},
        {"structural_damping": "damping_ratio"},
    ),
    "backlash": Known(
        "one_gap", lambda x: {"half_width_um": x.magnitude, "spread_um": 0.0}, {"backlash": "half_width_um"}
    ),
    "thermal_drift": Known(
        "exponential", _as_drawn, {"thermal_drift": "time_constant_s"}, lambda x: dict(x.parameters)["tau_s"]
    ),
    "periodic_disturbance": Known(
        "sine",
        lambda x: {**dict(x.parameters), "overtone": 0.0},
        {"periodic_disturbance": "frequency_Hz"},
        lambda x: dict(x.parameters)["frequency_Hz"],
    ),
    "sensor_lag": Known("one_pole", lambda x: {"tau_s": x.magnitude, "second_tau_s": 0.0}, LAG),
    "sensor_quantisation": Known("nearest", _as_drawn, {"sensor_quantisation": "step_um"}),
}


@dataclass(frozen=True, slots=True)
class StatedInterval:
    """What was said of the number of one bench.

    Attributes:
        number: of the bench.
        id: of the case.
        effect: that is hidden.
        truth: its number, in its own unit.
        rate_Hz: of even rows, at which a frequency looks like its aliases; 0 where rows are uneven.
        verdict: the contract's word, "error" where it failed.
        found: the number, nan where none was told.
        deviation: its stated standard deviation.
        interval: the stated interval of 95 %, where there is one.
        exposure_s: of the camera, over which a reading is the mean; 0 for snapshots.
    """

    number: int
    id: str
    effect: str
    truth: float
    rate_Hz: float
    verdict: str
    found: float
    deviation: float
    interval: tuple[float, float] | None = None
    exposure_s: float = 0.0

    @property
    def has_interval(self) -> bool:
        """Whether there is an interval; that of a step on whose multiples all readings lie has no width."""
        return math.isfinite(self.found) and 0.0 <= self.deviation < math.inf

    @property
    def off(self) -> float:
        """How far the number is above the truth; a frequency counts as its image in even rows."""
        truth, found = self.truth, self.found
        if self.effect == "periodic_disturbance" and self.rate_Hz > 0.0:
            truth, found = (abs(x - self.rate_Hz * round(x / self.rate_Hz)) for x in (truth, found))
        return math.copysign(max(abs(found - truth) - DIGITS * abs(truth), 0.0), found - truth)

    @property
    def deviations(self) -> float:
        """How many stated deviations the number is off."""
        if not self.has_interval or self.deviation == 0.0:
            return 0.0 if self.has_interval and self.off == 0.0 else math.inf
        return abs(self.off) / self.deviation

    @property
    def covers(self) -> bool:
        """Whether the 95 % interval holds the truth: the stated one, or that of the deviation where there is none."""
        if not self.has_interval or self.interval is None:
            return self.deviations <= DEVIATIONS
        below, above = self.found - self.interval[0], self.interval[1] - self.found
        if self.effect == "periodic_disturbance":
            # an image may be mirrored
            below = above = max(below, above)
        return -above <= self.off <= below

    @property
    def in_words(self) -> str:
        """Truth, found and deviation."""
        exposed = f", exposed for {1e3 * self.exposure_s:.1f} ms" if self.exposure_s else ""
        return f"{self.effect} {self.truth:.5g}, {self.found:.5g} ± {self.deviation:.2g}; {self.verdict}{exposed}"


def bench_of(number: int, seed: int) -> "Case":
    """Draw a bench: the effects go round; size, sensor, clock, gain and offset are drawn."""
    import numpy as np

    from bender_proving import INSIDE, Hidden, make_case

    rng: np.random.Generator = np.random.default_rng([seed, number])
    effect = tuple(KNOWN)[number % len(KNOWN)]
    sensors = tuple(INSIDE[effect].ranges)
    case = make_case("single", (effect,), int(rng.integers(2**31)), sensors[int(rng.integers(len(sensors)))])
    (drawn,), known = case.effects, KNOWN[effect]
    hidden = Hidden(effect, known.form, drawn.magnitude, tuple(known.numbers(drawn).items()))
    return replace(case, effects=(hidden,))


def numbers_of(count: int, effects: Sequence[str]) -> list[int]:
    """Return the numbers of so many benches that hide one of some effects of `KNOWN`; of any where none is given."""
    places = [k for k, name in enumerate(KNOWN) if name in effects or not effects]
    return [turn * len(KNOWN) + k for turn in range(count // len(places) + 1) for k in places][:count]


def exposure_of(case: "Case", number: int, seed: int) -> float:
    """Return how long a bench's camera is exposed: drawn for half of those that round nothing, else 0."""
    import numpy as np

    from bender_studies.hidden_effects.exposed_record import EXPOSURES_S

    rng = np.random.default_rng([seed, number, 1])
    exposed = rng.random() < 0.5 and case.sensor == "camera" and case.effect_ids != (ROUNDED,)
    return float(rng.uniform(*EXPOSURES_S)) if exposed else 0.0


def intervals(numbers: Iterable[int], seed: int, folder: Path, jobs: int | None) -> Iterator[StatedInterval]:
    """Draw benches, record and diagnose them in processes of their own, and judge, in their order."""
    return in_processes(_stated_interval, ((k, seed, folder) for k in numbers), jobs)


def _stated_interval(number: int, seed: int, folder: Path) -> StatedInterval:
    """Record a bench and diagnose the file; the diagnosis is given nothing else."""
    import numpy as np

    from bender_inference.records.spectrum import are_even
    from bender_loop.records.record import read_record, write_record
    from bender_proving import Bench
    from bender_studies.hidden_effects.exposed_record import exposed_record

    case = bench_of(number, seed)
    exposure_s = exposure_of(case, number, seed)
    bench, path = Bench(case), folder / f"{case.id}.csv"
    record = exposed_record(case, exposure_s) if exposure_s else bench.record(bench.excitation(), bench.noise())
    write_record(path, record)
    time_s = read_record(path).time_s
    (hidden,) = case.effects
    known = KNOWN[hidden.id]
    answer = diagnosed(path, known.asked)
    path.unlink()
    rate_Hz = 1.0 / float(np.median(np.diff(time_s))) if are_even(time_s) else 0.0
    said = (answer.verdict, answer.found, answer.deviation, answer.interval)
    return StatedInterval(number, case.id, hidden.id, known.truth(hidden), rate_Hz, *said, exposure_s)


def diagnosed(path: Path, asked: Mapping[str, str]) -> Number:
    """Diagnose a record; `asked` says which number of which effect is wanted."""
    from bender_discrepancy.workflow import diagnose
    from bender_inference.records.checks import read_model, read_records
    from bender_loop.errors import InputError, RunError

    try:
        return answered(diagnose(read_model(MODEL), read_records([path])), asked)
    except (InputError, RunError) as error:
        return Number("error", error=str(error))


def answered(diagnosis: "Diagnosis", asked: Mapping[str, str]) -> Number:
    """Return the number asked for: of the first effect listed that has it."""
    listed = tuple(x.id for x in diagnosis.effects)
    numbers = (n for x in diagnosis.effects if x.id in asked for n in x.numbers if n.name == asked[x.id])
    known = next(numbers, None)
    if known is None:
        return Number(diagnosis.verdict, listed)
    return Number(diagnosis.verdict, listed, known.value, known.std, interval=known.interval)


def totals(found: Sequence[StatedInterval]) -> list[list[str]]:
    """Return rows for each effect, exposed benches and all: effect, benches, intervals, that cover, share, interval."""
    rows = []
    for name in (*KNOWN, EXPOSED, "all"):
        some = [x for x in found if name in (x.effect, "all") or (name == EXPOSED and x.exposure_s)]
        told = [x for x in some if x.has_interval]
        if not told:
            continue
        cover = sum(x.covers for x in told)
        low, high = wilson(cover / len(told), len(told))
        share = f"{100 * cover / len(told):.1f} %"
        rows.append([name, str(len(some)), str(len(told)), str(cover), share, f"{100 * low:.0f} … {100 * high:.0f} %"])
    return rows


def misses(found: Sequence[StatedInterval]) -> list[list[str]]:
    """Return a row for each interval that misses, and each number that was not told."""
    return [
        [
            str(x.number), x.effect, f"{x.truth:.6g}", f"{x.found:.6g}", f"{x.deviation:.2g}",
            f"{x.deviations:.1f}", x.verdict,
        ]
        for x in found
        if not x.covers
    ]  # fmt: skip
