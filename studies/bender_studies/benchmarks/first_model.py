"""`bender benchmark model`: first models of systems drawn at random, their order and their simulation error."""

import argparse
import sys
from dataclasses import asdict, dataclass

HELP = "first models (`bender model fit`) of random linear systems: order, simulation error, time"
COLUMNS = ("number", "true order", "drive", "noise dB", "found", "error over the true model's", "s")
CLOSE = 1.1
"""Simulation error on the second record that passes, over that of the true system with the same noise."""


@dataclass(frozen=True, slots=True)
class Trial:
    """One system: what it is, what was found, and how well that simulates a record that no fit was given."""

    number: int
    order: int
    kind: str
    below_dB: float
    delay_s: float
    found: str
    found_order: int
    error_ratio: float
    seconds: float


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare how many systems, from which seed, and where the results go."""
    parser.add_argument("--systems", type=int, default=30, metavar="N", help="number of random systems (default: 30)")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="seed of the first system (default: 1)")


def run(arguments: argparse.Namespace) -> int:
    """Print the table and the shares, write model.json."""
    from bender_loop.errors import InputError
    from bender_loop.shell.files import prepare_directory, write_result
    from bender_loop.shell.progress import Progress, print_table

    if arguments.systems < 1 or arguments.seed < 0:
        raise InputError("--systems, --seed: expected at least 1 system and a seed of 0 or more")
    out = prepare_directory(arguments.out)
    trials = []
    with Progress("systems") as bar:
        for number in range(arguments.systems):
            trials.append(trial(number, arguments.seed))
            bar.update(number + 1, arguments.systems)
    rows = [[x.number, x.order, x.kind, x.below_dB, x.found, x.error_ratio, x.seconds] for x in trials]
    print_table(f"first models, seed {arguments.seed}", COLUMNS, rows)
    right = sum(x.found_order == x.order for x in trials)
    close = sum(x.error_ratio <= CLOSE for x in trials)
    sys.stdout.write(f"order right: {right} of {len(trials)}\n")
    sys.stdout.write(f"simulation error at most {CLOSE:g} times the true model's: {close} of {len(trials)}\n")
    write_result(out / "model.json", {"trials": [asdict(x) for x in trials]})
    sys.stdout.write(f"written: {out / 'model.json'}\n")
    return 0


def trial(number: int, seed: int) -> Trial:
    """Return what is found of one drawn system."""
    import math
    import time

    import numpy as np

    from bender_compiled.simulation import Drive, Simulator
    from bender_identify.first_model.choice import first_model
    from bender_identify.records.experiment import experiment_of
    from bender_identify.settings import Settings
    from bender_loop.records.record import Record
    from bender_proving.systems.played import played_system

    x = played_system(number, seed)
    begin = time.perf_counter()
    record = Record(x.time_s, x.voltage_V[0], x.reading_um[0])
    fit = first_model([experiment_of(record, "first", Settings())]).chosen
    seconds = time.perf_counter() - begin
    model = fit.structure.model(fit.values, fit.gain, fit.offsets[0])
    simulated = Simulator(Drive.of_rows(x.time_s, x.voltage_V[1])).run(model).reading_um
    error = float(np.sqrt(np.mean((x.reading_um[1] - simulated) ** 2)))
    true_error = float(np.sqrt(np.mean((x.reading_um[1] - x.clean_um[1] - 1.0) ** 2)))
    return Trial(
        number,
        x.system.order,
        x.kind,
        20.0 * math.log10(float(np.std(x.clean_um[0])) / x.noise_um),
        x.system.delay_s,
        fit.structure.name,
        fit.structure.order,
        error / true_error,
        seconds,
    )
