"""What `bender identify` is held to, claim by claim, computed afresh."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bender_export.build import checkout_folder
from bender_identify.fitting.resimulation import quasi_static
from bender_identify.identification import identify
from bender_identify.paper.paper_sindy import naive_cubic, paper_recipe
from bender_identify.paper.simulated_bouc_wen import growing_tone, learn_bouc_wen, three_tones
from bender_identify.records.experiment import experiment_of
from bender_identify.settings import Settings
from bender_loop.control.inverse import commands_for
from bender_loop.errors import InputError
from bender_loop.fmu.following_models import open_following_models
from bender_loop.records.record import Array, Record, read_record
from bender_native.ready import ready_plant_fmu
from bender_studies.reproduction.printed import COEFFICIENTS, EXPERIMENTAL_ERROR_PERCENT, SIMULATED_ERROR_PERCENT
from bender_studies.reproduction.shared_work import SharedWork

if TYPE_CHECKING:
    from bender_identify.identification_result import Identification

STACK = Path("shared") / "data" / "piezo_stack_1Hz.csv"
RAMPS = STACK.parent / "rigs" / "piezo_stack_ramps.csv"
LEAST_V, MOST_V, NEAR_UM = -100.0, 200.0, 1e-3
"""Commands that the inverse of the stack may ask for, and how near it comes."""
CUBIC_PERCENT = (140.0, 160.0)
NOISY_S = 100.0


@dataclass(frozen=True, slots=True)
class Claim:
    """One claim.

    Attributes:
        what: is measured.
        bound: what it is held to, in words.
        found: the figure, or words.
        met: whether it holds; None where it could not be tried here.
    """

    what: str
    bound: str
    found: float | str
    met: bool | None


def claims(shared: SharedWork, seeds: Sequence[int]) -> Iterator[Claim]:
    """Yield every claim with what was found; those with noise at their worst over the seeds."""
    yield from _simulated(seeds)
    yield from _recovered(shared.identification, shared.bench.how_sine)
    yield from _stack(shared)
    yield from _inverse(shared)
    yield from _refused()


def _simulated(seeds: Sequence[int]) -> Iterator[Claim]:
    recipe, _ = paper_recipe()
    printed = SIMULATED_ERROR_PERCENT
    yield Claim("published recipe, mean square over mean square, %", f"rounds to the paper's {printed.text}",
                recipe.squared, printed.is_met_by(recipe.squared))  # fmt: skip
    yield Claim("the same solution in the paper's metric (29), %", "shown", recipe.trained, True)
    ours, _ = learn_bouc_wen(1e-3, 0.0, np.random.default_rng(0))
    yield _at_most("ours, re-simulated, (29), rows 1 ms apart, %", 1e-6, ours.trained)
    yield _at_most("ours, two tones never trained on, (29), %", 1e-4, ours.unseen)
    cubic, _ = naive_cubic()
    yield Claim("all cubics, one tone trained on, two tones asked, (29), %", "about 150", cubic.unseen,
                CUBIC_PERCENT[0] <= cubic.unseen <= CUBIC_PERCENT[1])  # fmt: skip
    noisy = [_noisy(seed) for seed in seeds]
    rows = f"1 % noise, rows 10 ms apart, two records of {NOISY_S:g} s"
    yield _at_most(f"{rows}: two tones never trained on, worst over {len(noisy)} seed(s), %", 0.03, max(noisy))


def _noisy(seed: int) -> float:
    inputs = (three_tones, growing_tone)
    return learn_bouc_wen(1e-2, 1.0, np.random.default_rng(seed), inputs, NOISY_S)[0].unseen


def _recovered(outcome: "Identification", how: str) -> Iterator[Claim]:
    learned = outcome.rows[0]
    bound = float(EXPERIMENTAL_ERROR_PERCENT.text)
    yield _at_most("(30) from 10 sin(πt + 0.5), 30 frames/s, held out, (29), %", bound,
                   learned.held_out.equation_29_percent)  # fmt: skip
    yield Claim("how that was recorded", "shown", how, True)
    found = {c.name: c for c in learned.candidate.coefficients}
    inside = [
        term
        for term, true in COEFFICIENTS.items()
        if term in found and abs(found[term].value - float(true.text)) <= (found[term].half_width or 0.0)
    ]
    yield Claim("intervals that hold the truth", f"all {len(COEFFICIENTS)}", f"{len(inside)}: {', '.join(inside)}",
                len(inside) == len(COEFFICIENTS))  # fmt: skip
    weak = outcome.identifiability.weak
    yield Claim(
        "the voltage coefficient is reported as weakly identified", "u among them", ", ".join(weak), "u" in weak
    )


def _stack(shared: SharedWork) -> Iterator[Claim]:
    what, path = "piezo_stack_1Hz.csv, best operator, held-out half, %", _beside_checkout(STACK)
    if path is None:
        yield Claim(what, "<= 2.5", f"{STACK} is not beside this checkout", None)
        return
    settings = Settings(library="paper", ensemble=0, held_out_share=0.5)
    experiment = experiment_of(read_record(path), path.name, settings)
    outcome = identify([experiment], shared.paper_model, settings, np.random.default_rng(0))
    best = min(outcome.rows, key=lambda row: row.held_out.rms_um)
    yield _at_most(f"{what[:-3]} ({best.candidate.title}), %", 2.5, best.held_out.error_percent)
    yield Claim("floor from cycle to cycle, %", "shown", outcome.floor_percent, True)
    warned = [line for line in outcome.findings if "cannot separate relaxation" in line]
    yield Claim("one frequency cannot separate relaxation from hysteresis", "warned", (*warned, "no warning")[0],
                bool(warned))  # fmt: skip


def _inverse(shared: SharedWork) -> Iterator[Claim]:
    """The command of one record from its displacement, by the inverse of what another record has taught."""
    what = "command of piezo_stack_1Hz.csv by the inverse learned on its ramps, rms of the span, %"
    learned_on, asked = _beside_checkout(RAMPS), _beside_checkout(STACK)
    if learned_on is None or asked is None:
        yield Claim(what, "<= 2", f"{RAMPS} or {STACK} is not beside this checkout", None)
        return
    settings = Settings()
    experiment = experiment_of(read_record(learned_on), learned_on.name, settings)
    outcome = identify([experiment], quasi_static(shared.paper_model), settings, np.random.default_rng(0))
    record = read_record(asked)
    wanted_um, bounds_V = record.displacement_um.tolist(), (LEAST_V, MOST_V)
    with open_following_models(ready_plant_fmu(outcome.written.candidate.model)) as models:
        found_V = commands_for(models.inverted, record.time_s.tolist(), wanted_um, bounds_V, NEAR_UM)
    span_V = float(np.ptp(record.voltage_V))
    line = np.polynomial.Polynomial.fit(record.displacement_um, record.voltage_V, 1)(record.displacement_um)
    # the last reading has none behind it that its command could meet
    yield _at_most(what, 2.0, 100.0 * _rms((found_V - record.voltage_V)[:-1]) / span_V)
    yield Claim(
        "the same by a straight line fitted to it, %", "shown", 100.0 * _rms(line - record.voltage_V) / span_V, True
    )


def _beside_checkout(place: Path) -> Path | None:
    """Return a file of the shared data, None where it is not there."""
    folder = checkout_folder()
    path = None if folder is None else folder.parents[1] / place
    return path if path is not None and path.is_file() else None


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(error**2)))


def _refused() -> Iterator[Claim]:
    time_s = np.arange(100) / 30.0
    sine = np.sin(time_s)
    for what, voltage, reading in (
        ("a voltage that stands still", np.full(100, 5.0), sine),
        ("a reading that stands still", 10.0 * sine, np.full(100, 3.0)),
        ("a reading that is noise alone", 10.0 * sine, np.random.default_rng(0).standard_normal(100)),
    ):
        try:
            experiment_of(Record(time_s, voltage, reading), "record.csv", Settings())
            said, refused = "accepted", False
        except InputError as error:
            said, refused = str(error), True
        yield Claim(what, "refused with the reason", said, refused)


def _at_most(what: str, bound: float, found: float) -> Claim:
    return Claim(what, f"<= {bound:g}", found, found <= bound)
