"""`bender benchmark watch`: hidden devices that change in mid-run, and devices that do not."""

import argparse
import math
import sys
import time
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bender_studies.watching.trial import Trial

HELP = "false alarms, delay against the optimal test and the right effect, beside other detectors"
SEED = 5800


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare how much is watched, and where the results go."""
    parser.add_argument("--effects", nargs="+", metavar="ID", help="that come in (default: twelve)")
    parser.add_argument("--sizes", nargs="+", type=float, metavar="N", help="rms over the noise (default: 1 3 10)")
    parser.add_argument("--quiet-devices", type=int, default=4, metavar="N", help="without a change (default: 4)")
    parser.add_argument("--quiet-rows", type=float, default=1e5, metavar="N", help="of each of them (default: 1e5)")
    parser.add_argument(
        "--between-false-alarms", type=float, default=2e4, metavar="ROWS", help="mean that is asked for (default: 2e4)"
    )
    parser.add_argument("--diagnose", action="store_true", help="diagnose every alarm: some minutes each")
    parser.add_argument("--first-seed", type=int, default=SEED, metavar="N", help=f"of the draws (default: {SEED})")
    parser.add_argument("--out", type=Path, metavar="DIR", default=Path("results/benchmark-watch"))


def run(arguments: argparse.Namespace) -> int:
    """Watch, print the tables, write watch.json; an interrupt keeps what was watched."""
    from dataclasses import asdict

    from bender_loop.shell.files import prepare_directory, write_result
    from bender_loop.shell.progress import Progress, print_table
    from bender_plant.model import load_model
    from bender_studies.watching.devices import EFFECTS, SHAPES, SIZES, changed, nominal
    from bender_studies.watching.others import OTHERS, setting
    from bender_studies.watching.trial import Trial, judged, quiet_residual
    from bender_watch.baseline.learn import learn
    from bender_watch.settings import Settings

    out = prepare_directory(arguments.out)
    every, seed = arguments.between_false_alarms, arguments.first_seed
    model, (_, training) = load_model("paper"), nominal(seed)
    baseline = learn(model, training, every)
    how = Settings(rows_between_false_alarms=every, diagnose=arguments.diagnose, adopt=False)
    status = 0
    with Progress("watch benchmark") as bar:
        quiet = _quiet(arguments, model, training, baseline, how, bar)
        calm = quiet_residual(baseline, nominal(seed + 1)[1])
        others = {name: setting(x, calm, min(every, calm.size / 2.0)) for name, x in OTHERS.items()}
        found: list[Trial] = []
        asked = product(enumerate(arguments.effects or EFFECTS), arguments.sizes or SIZES, SHAPES)
        try:
            for (number, name), size, shape in asked:
                change = changed(name, size, shape, seed + 10 + number)
                if change is not None:
                    found.append(judged(model, training, baseline, change, how, others))
                    bar.update(len(found), None, f"{name} {size:g} {shape}")
        except KeyboardInterrupt:
            status = 130
    columns = ("size", "changes", "found", "median delay", "optimal", "ratio", "suspected right", *OTHERS)
    rows = [_row(size, [x for x in found if x.size == size], list(OTHERS)) for size in arguments.sizes or SIZES]
    print_table(f"Changes, one false alarm in {every:g} rows; delays in rows, medians", columns, rows)
    print_table("Devices that do not change", tuple(quiet), [list(quiet.values())])
    write_result(out / "watch.json", {"quiet": quiet, "thresholds": others, "trials": [asdict(x) for x in found]})
    sys.stdout.write(f"written: {out / 'watch.json'}\n")
    return status


def _quiet(
    arguments: argparse.Namespace, model: Any, training: Any, baseline: Any, how: Any, bar: Any
) -> dict[str, Any]:
    """Watch devices that do not change: their false alarms with the 95 % interval of the rate, and rows a second."""
    from scipy.stats import chi2

    from bender_studies.watching.devices import nominal
    from bender_watch.follow.rows import Rows
    from bender_watch.watcher import Watcher

    alarms, rows, busy_s = 0, 0, 0.0
    for device in range(arguments.quiet_devices):
        own = 0
        while own < arguments.quiet_rows:
            _, record = nominal(arguments.first_seed + 1000 + 100_000 * device + own)
            watcher = Watcher(model, training, baseline, how)
            part = Rows.of(record)
            began_s = time.process_time()
            events = [*watcher.begin_record("quiet", part), *watcher.take(part)]
            busy_s += time.process_time() - began_s
            alarms += sum(x["event"] == "alarm" for x in events)
            own += len(part)
        rows += own
        bar.update(device + 1, arguments.quiet_devices, "devices that do not change")
    low = float(chi2.ppf(0.025, 2 * alarms)) / 2.0 if alarms else 0.0
    high = float(chi2.ppf(0.975, 2 * alarms + 2)) / 2.0
    return {
        "rows": rows,
        "false alarms": alarms,
        "expected at most": rows / arguments.between_false_alarms,
        "one in rows, at least": rows / high,
        "one in rows, at most": rows / low if low else None,
        "rows a second of one core": rows / busy_s if busy_s else math.nan,
    }


def _row(size: float, trials: "Sequence[Trial]", others: Sequence[str]) -> list[Any]:
    from bender_studies.watching.trial import median

    known = [x for x in trials if x.optimal_rows is not None]
    ratios = [math.inf if x.rows is None else x.rows / (x.optimal_rows or 1) for x in known]
    right = [x.effect in (x.named[:1] or x.suspected) for x in known if x.rows is not None]
    beside = [_finite(median([x.other_rows[name] for x in known])) for name in others]
    return [
        size,
        len(trials),
        sum(x.rows is not None for x in trials),
        _finite(median([x.rows for x in known])),
        _finite(median([x.optimal_rows for x in known])),
        _finite(median(ratios)),
        f"{sum(right)} of {len(right)}",
        *beside,
    ]


def _finite(value: float) -> float | str:
    return value if math.isfinite(value) else "never"
