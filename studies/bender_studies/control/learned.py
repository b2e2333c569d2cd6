"""What iterative learning makes of a scan that repeats, on hidden benches, in virtual time.

The controller follows the nominal model, which knows nothing of what is hidden. Passes are learned from as
`bender hil --learn` does; the errors are those of the true displacement.
"""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import ArrayLike

from bender_loop.control import learning
from bender_loop.fmu.followed_model import Loop, open_follower
from bender_loop.fmu.plant import FmuPlant
from bender_loop.records.record import Array
from bender_loop.shell.progress import Cell
from bender_plant.model import load_model
from bender_proving import NOISE_UM, Case, make_case
from bender_studies.control.hidden_loop import noise_um, rms_um, run_hidden
from bender_studies.control.trial import MODEL, RATE_HZ, SLEW_V_PER_S, Following, tuned
from bender_tuner.results.gains_file import read_controller

PASSES = 8
ASKED = 1.0 / 20.0
"""Of the error of the first pass."""
COLUMNS = ("bench", "hidden", "noise of a reading, µm", "passes", "first pass, µm", "best pass, µm", "ratio")
_REST_S, _RISE_S, _SCAN_S = 0.4, 1.0, 6.0
_LOW_UM, _HIGH_UM, _SCAN_HZ = 5.0, 9.0, 1.0


@dataclass(frozen=True, slots=True)
class Learnt:
    """One bench and what the passes came to; `errors_um` is the rms of the true displacement in each."""

    id: str
    truth: tuple[str, ...]
    noise_um: float
    errors_um: tuple[float, ...]
    best: int

    @property
    def best_um(self) -> float:
        """Of the pass that was kept, by what was read."""
        return self.errors_um[self.best]

    @property
    def ratio(self) -> float:
        """Of that pass to the first one."""
        return self.best_um / self.errors_um[0]


@dataclass(frozen=True, slots=True)
class Straight:
    """A reference that runs straight between its samples."""

    times_s: Array
    setpoints_um: Array

    def sample(self, times: ArrayLike) -> Array:
        """Set-points in um at `times` in s."""
        return np.interp(np.asarray(times, dtype=float), self.times_s, self.setpoints_um)

    def value(self, time_s: float) -> float:
        """Set-point in um at `time_s`."""
        return float(self.sample(time_s))


def scan() -> Straight:
    """A rest, a rise, and a triangle of 1 Hz."""
    times_s = np.arange(round(_SCAN_S * RATE_HZ) + 1) / RATE_HZ
    phase = ((times_s - _RISE_S) * _SCAN_HZ) % 1.0
    height = _HIGH_UM - (_HIGH_UM - _LOW_UM) * np.abs(2.0 * phase - 1.0)
    rise = np.interp(times_s, [_REST_S, _RISE_S], [0.0, _LOW_UM])
    return Straight(times_s, np.where(times_s < _RISE_S, rise, height))


def cases(first_seed: int) -> Iterator[Case]:
    """Yield a bench with hysteresis, one with creep, and one with both, seed after seed."""
    for seed in count(first_seed):
        loop, creep = (make_case("single", (x,), seed, "camera") for x in ("rate_independent_hysteresis", "creep"))
        yield from (loop, creep, replace(loop, effects=(*loop.effects, *creep.effects)))


def learn_on(benches: Iterator[Case], passes: int, evaluations: int) -> Iterator[Learnt]:
    """Learn the scan on every bench, without noise and with that of its camera."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        for number, case in enumerate(benches):
            if number == 0:
                tuned(load_model(MODEL), case, folder, evaluations)
            for noisy in (False, True):
                yield _learnt(case, folder, passes, noisy=noisy)


def _learnt(case: Case, tuning: Path, passes: int, *, noisy: bool) -> Learnt:
    gains, limits, _, model = read_controller(tuning / "gains.toml")
    if model is None:
        raise ValueError("model following must be recommended for the nominal model, found gains alone")
    wanted, noise = scan(), NOISE_UM[case.sensor] if noisy else 0.0
    known, errors = learning.begin(wanted.setpoints_um), []
    loop = Loop(1.0 / RATE_HZ, limits, SLEW_V_PER_S, preview=True)
    best, begins = 0, learning.first_reached(model.dead_time_s, 1.0 / RATE_HZ)
    with (
        open_follower(model, tuning / model.fmu, gains, loop) as follower,
        closing(FmuPlant(tuning / model.fmu)) as like,
    ):
        ahead_s = follower.look_ahead_s + model.dead_time_s
        for number in range(passes):
            target = Straight(wanted.times_s, known.target_um)
            seed = passes * case.seed + number if noisy else None
            frames = wanted.times_s.size
            following = Following(follower, target, ahead_s)
            run = run_hidden(case, following, wanted, RATE_HZ, frames / RATE_HZ, seed, like)
            errors.append(rms_um(run, begins / RATE_HZ))
            read_um = run.displacement_um + noise_um(case, seed, frames)
            known = learning.learn(known, wanted.setpoints_um, read_um, noise, begins)
            best = number if known.idle == 0 else best
            if known.is_over:
                break
    return Learnt(case.id, case.effect_ids, noise, tuple(errors), best)


def rows(found: list[Learnt]) -> list[list[Cell]]:
    """One row for each bench with and without noise."""
    return [
        [x.id, " + ".join(x.truth), x.noise_um, len(x.errors_um), round(x.errors_um[0], 4), round(x.best_um, 4),
         round(x.ratio, 3)]
        for x in found
    ]  # fmt: skip


def claims(found: list[Learnt]) -> Iterator[tuple[str, str, str]]:
    """What is asked for, the bound and what was found."""
    silent, noisy = ([x for x in found if (x.noise_um > 0.0) is y] for y in (False, True))
    if silent:
        ratios = [x.ratio for x in silent]
        kept = sum(x <= ASKED for x in ratios)
        what = f"error of the best of {PASSES} passes to that of the first, without noise"
        yield what, f"{ASKED:g}", f"median {np.median(ratios):.3f}, worst {max(ratios):.3f}; {kept} of {len(ratios)}"
    if noisy:
        worse = max(x.best_um / x.noise_um for x in noisy)
        yield "true error of the best pass to the noise of a reading", "1", f"worst {worse:.2f}"
