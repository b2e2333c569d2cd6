"""Numbers found through the emulated camera: delays, lags and slew limits, held to the truth and the stated deviation.

What is hidden has the catalogue's own equation, so that its number has one true value; what is judged is what the
camera makes of it.
"""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING

from bender_studies.hidden_effects.figures import wilson
from bender_studies.hidden_effects.trial import MODEL, silence

if TYPE_CHECKING:
    import numpy as np

    from bender_discrepancy.diagnosis import Diagnosis
    from bender_proving import Case

EFFECTS = ("transport_delay", "source_resistance", "sensor_lag", "slew_limit")
NUMBERS: Mapping[str, Mapping[str, str]] = {
    "transport_delay": {"transport_delay": "delay_s"},
    "source_resistance": {"source_resistance": "time_constant_s", "sensor_lag": "time_constant_s"},
    "sensor_lag": {"sensor_lag": "time_constant_s", "source_resistance": "time_constant_s"},
    "slew_limit": {"slew_limit": "slew_rate_V_per_s"},
}
"""What a number is called, by the effect that is hidden and those that do the same to a linear plant."""
UNITS = {"slew_limit": "V/s"}
MOST_DEVIATIONS = 2.0


@dataclass(frozen=True, slots=True)
class CameraBench:
    """A bench, and how long its camera's shutter is open."""

    number: int
    case: "Case"
    exposure_s: float


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
class ThroughCamera:
    """One bench with the answer.

    Attributes:
        id: of the case.
        effect: that is hidden.
        truth: its number, in its unit.
        exposure_s: of the camera.
        lost: frames in which the tip was not found.
        answer: of the diagnosis.
    """

    id: str
    effect: str
    truth: float
    exposure_s: float
    lost: int
    answer: Number

    @property
    def deviations(self) -> float:
        """How many stated deviations the number is off; inf where there is none."""
        if not (math.isfinite(self.answer.found) and 0.0 < self.answer.deviation < math.inf):
            return math.inf
        return abs(self.answer.found - self.truth) / self.answer.deviation

    @property
    def is_within(self) -> bool:
        """Whether the number is within two stated deviations of the truth."""
        return self.deviations <= MOST_DEVIATIONS

    @property
    def in_words(self) -> str:
        """Truth, found and deviation."""
        unit, found = UNITS.get(self.effect, "s"), self.answer
        said = found.error or f"{found.verdict}: {' + '.join(found.effects) or 'nothing'}"
        return f"{self.effect} {self.truth:.5g} {unit}, {found.found:.5g} ± {found.deviation:.2g}; {said}"


def camera_bench(number: int, seed: int) -> tuple[CameraBench, "np.random.Generator"]:
    """Draw a bench: the effects go round, sizes and exposures are drawn; returns also what draws its record."""
    import numpy as np

    from bender_proving import Hidden, make_case
    from bender_studies.hidden_effects.camera_record import EXPOSURES_S

    rng = np.random.default_rng([seed, number])
    case = make_case("single", (EFFECTS[number % len(EFFECTS)],), int(rng.integers(2**31)), "camera")
    (drawn,) = case.effects
    plain = {
        "source_resistance": ("lumped", {"tau_s": drawn.magnitude, "second_tau_s": 0.0}),
        "sensor_lag": ("one_pole", {"tau_s": drawn.magnitude, "second_tau_s": 0.0}),
        "slew_limit": ("hard", {"rate_V_per_s": drawn.magnitude, "landing_s": 0.0}),
    }
    if drawn.id in plain:
        form, numbers = plain[drawn.id]
        case = replace(case, effects=(Hidden(drawn.id, form, drawn.magnitude, tuple(numbers.items())),))
    return CameraBench(number, case, float(rng.uniform(*EXPOSURES_S))), rng


def through_camera(numbers: Iterable[int], seed: int, folder: Path, jobs: int) -> Iterator[ThroughCamera]:
    """Draw benches, record them through the camera, diagnose and judge, in their order."""
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), initializer=silence) as pool:
        trials = [(camera_bench(k, seed)[0], pool.submit(_recorded_and_diagnosed, k, seed, folder)) for k in numbers]
        try:
            for bench, trial in trials:
                lost, answer = trial.result()
                (hidden,) = bench.case.effects
                yield ThroughCamera(bench.case.id, hidden.id, hidden.magnitude, bench.exposure_s, lost, answer)
        finally:
            pool.shutdown(cancel_futures=True)


def totals(found: Sequence[ThroughCamera]) -> list[list[str]]:
    """Return a row for each effect and one for all: effect, benches, within two deviations, 95 %, verdicts."""
    rows = []
    for name in (*EFFECTS, "all"):
        some = [x for x in found if name in (x.effect, "all")]
        if not some:
            continue
        within = sum(x.is_within for x in some)
        low, high = wilson(within / len(some), len(some))
        verdicts = ", ".join(f"{count} {word}" for word, count in Counter(x.answer.verdict for x in some).most_common())
        rows.append([name, str(len(some)), str(within), f"{100 * low:.0f} … {100 * high:.0f} %", verdicts])
    return rows


def misses(found: Sequence[ThroughCamera]) -> list[list[str]]:
    """Return a row for each number that is further off: id, effect, exposure, truth, found, deviation, answer."""
    return [
        [
            x.id, x.effect, f"{1e3 * x.exposure_s:.1f} ms", f"{x.truth:.6g}", f"{x.answer.found:.6g}",
            f"{x.answer.deviation:.2g}", x.answer.error or f"{x.answer.verdict}: {' + '.join(x.answer.effects)}",
        ]
        for x in found
        if not x.is_within
    ]  # fmt: skip


def _recorded_and_diagnosed(number: int, seed: int, folder: Path) -> tuple[int, Number]:
    """Record a bench and diagnose the file; the diagnosis is given nothing else."""
    import numpy as np

    from bender_loop.records.record import write_record
    from bender_studies.hidden_effects.camera_record import camera_record

    bench, rng = camera_bench(number, seed)
    seen = camera_record(bench.case, bench.exposure_s, rng)
    path = folder / f"{bench.case.id}.csv"
    write_record(path, seen.record)
    return int(np.isnan(seen.record.displacement_um).sum()), diagnosed(path, NUMBERS[bench.case.effect_ids[0]])


def diagnosed(path: Path, asked: Mapping[str, str]) -> Number:
    """Diagnose a record; `asked` says which number of which effect is wanted."""
    from bender_discrepancy.records.checks import read_model, read_records
    from bender_discrepancy.workflow import diagnose
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
