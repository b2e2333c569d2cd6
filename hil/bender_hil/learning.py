"""`bender hil --learn N`: a profile is run again and again, each time with what the passes before have taught."""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bender_hil.bench_file import BenchFile
from bender_hil.log.results import RECORD
from bender_hil.runner.voltages import Voltages, read_profile_file
from bender_loop.control import learning
from bender_loop.control.learning import Array, Learned
from bender_loop.errors import InputError
from bender_loop.records.record import Record, read_record
from bender_loop.shell.files import prepare_directory, write_atomically

if TYPE_CHECKING:
    from bender_loop.control.references import Profile

LEARNED = "learned.csv"
MOST_PASSES = 100
_SAME_TIME = 0.01
"""Of a frame: a set-point that begins so soon after a sample counts as there, since a file rounds its times."""
_PARTS = 8
"""A profile holds each set-point until the next, and frames come when they come: between the samples of what is learned
its target runs straight, in so many parts."""
_REST_S = 0.3
"""Before the first move of most profiles the tip rests: the scatter of these frames is the noise."""

RunPass = Callable[[argparse.Namespace], int]


def learn_on_bench(arguments: argparse.Namespace, bench: BenchFile, run_pass: RunPass, dead_time_s: float = 0.0) -> int:
    """Run a profile until nothing more is learned, at most as often as asked; the best target goes to `learned.csv`.

    Every pass is a run of its own, from rest to rest, in a folder `pass-1`, `pass-2`, … of `--out`. The file that is
    left is a profile: `bender hil --profile learned.csv` with the same gains plays it.

    Args:
        arguments: of `bender hil`, with `learn`, `profile` and `out`.
        bench: on which it runs.
        run_pass: runs the profile that its arguments name; returns the exit status.
        dead_time_s: of the model; before it is over, no command has reached the tip.

    Returns:
        0, or the status of the pass that was ended.

    Raises:
        InputError: there is no profile of set-points.
    """
    if not 1 <= arguments.learn <= MOST_PASSES:
        raise InputError(f"--learn: found {arguments.learn}, expected 1 to {MOST_PASSES} passes")
    if arguments.profile is None:
        raise InputError("--learn needs the set-points that repeat; name them with --profile FILE")
    profile = read_profile_file(arguments.profile)
    if isinstance(profile, Voltages):
        raise InputError(f"{arguments.profile}: found a profile of voltages, expected one with setpoint_um")
    out = prepare_directory(arguments.out)
    grid_s = np.arange(profile.times_s[0], profile.times_s[-1] + 0.5 / bench.rate_Hz, 1.0 / bench.rate_Hz)
    wanted = profile.sample(grid_s + _SAME_TIME / bench.rate_Hz)
    known, noise_um = learning.begin(wanted), 0.0
    begins = learning.first_reached(dead_time_s, 1.0 / bench.rate_Hz)
    for number in range(1, arguments.learn + 1):
        target = out / f"target-{number}.csv"
        write_profile(target, grid_s, np.clip(known.target_um, *bench.guard.travel_um), wanted)
        folder = out / f"pass-{number}"
        status = run_pass(argparse.Namespace(**vars(arguments) | {"profile": str(target), "out": folder}))
        if status:
            return status
        record = read_record(folder / RECORD)
        noise_um = noise_of(record, profile)
        known = learning.learn(known, wanted, read_at(record, grid_s, wanted), noise_um, begins)
        write_profile(out / LEARNED, grid_s, np.clip(known.best_um, *bench.guard.travel_um), wanted)
        sys.stdout.write(f"pass {number}: {known.errors_um[-1]:.4g} µm rms from the set-points\n")
        if known.is_over:
            break
    sys.stdout.write(f"{_sentence(known, noise_um)}\nwritten: {out / LEARNED}\n")
    return 0


def write_profile(path: Path, time_s: Array, target_um: Array, wanted_um: Array) -> None:
    """Write a target as a profile, with the set-points that it is meant to reach in a further column.

    It runs straight from one instant to the next.
    """
    places = np.arange(_PARTS * (time_s.size - 1) + 1) / _PARTS
    columns = (np.interp(places, np.arange(time_s.size), x).tolist() for x in (time_s, target_um, wanted_um))
    lines = [f"{t:.12g},{p:.9g},{r:.9g}\n" for t, p, r in zip(*columns, strict=True)]
    write_atomically(path, "time_s,setpoint_um,wanted_um\n" + "".join(lines))


def read_at(record: Record, grid_s: Array, wanted_um: Array) -> Array:
    """Return the readings of a run at the instants of the profile.

    Frames come when they come. What is missed from the set-points runs straight from one frame to the next; the
    readings turn where the profile does, and would be cut short there.

    Args:
        record: of the run.
        grid_s: (n,) instants of the profile.
        wanted_um: (n,) set-points there.
    """
    sound = np.isfinite(record.displacement_um)
    frames_s = record.time_s[sound]
    missed_um = np.interp(frames_s, grid_s, wanted_um) - record.displacement_um[sound]
    return wanted_um - np.interp(grid_s, frames_s, missed_um)


def noise_of(record: Record, profile: "Profile") -> float:
    """Return the scatter of the readings while the profile rests at its beginning, 0 where it does not."""
    moves = [t for t, x in zip(profile.times_s, profile.setpoints_um, strict=True) if x != profile.setpoints_um[0]]
    rest = record.displacement_um[record.time_s < min(moves, default=0.0)]
    still = rest[np.isfinite(rest)]
    return float(still.std()) if still.size >= 5 and min(moves) > _REST_S else 0.0


def _sentence(known: Learned, noise_um: float) -> str:
    first, best = known.errors_um[0], known.best_error_um
    ended = "nothing more is learned" if known.is_over else "the passes are over"
    noise = f"; the noise of a reading alone is {noise_um:.4g} µm" if noise_um else ""
    return (
        f"after {len(known.errors_um)} passes {ended}: {first:.4g} µm rms in the first, {best:.4g} µm in the best, "
        f"{best / first:.3g} of it{noise}"
    )
