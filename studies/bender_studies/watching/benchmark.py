"""`bender benchmark watch`: hidden devices that change in mid-run, and devices that do not."""

import argparse
import math
import sys
import time
from collections.abc import Iterator, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bender_studies.watching.devices import Quiet
    from bender_studies.watching.short import Short
    from bender_studies.watching.trial import Trial

HELP = "false alarms, delay against the optimal test and the right effect, beside other detectors"
SEED = 5800
MOST_TIMED = 1e5
"""Rows of the record whose watch is timed."""
SHORT_EVERY = 1e6
"""Rows between two false alarms of the watch of a short record."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare how much is watched, and where the results go."""
    parser.add_argument("--effects", nargs="+", metavar="ID", help="that come in (default: twelve)")
    parser.add_argument("--sizes", nargs="+", type=float, metavar="N", help="rms over the noise (default: 1 3 10)")
    parser.add_argument("--quiet-devices", type=int, default=8, metavar="N", help="without a change (default: 8)")
    parser.add_argument(
        "--quiet-rows", type=float, default=1e5, metavar="N", help="of each of them (default: 1e5; 0: none)"
    )
    parser.add_argument(
        "--between-false-alarms", type=float, default=2e4, metavar="ROWS", help="mean that is asked for (default: 2e4)"
    )
    parser.add_argument(
        "--threshold-rows", type=float, default=1e6, metavar="N",
        help="without a change, from which thresholds of all methods are set (default: 1e6; 0: not side by side)",
    )  # fmt: skip
    parser.add_argument(
        "--short-records", type=int, default=25, metavar="N",
        help="begun in motion or after a pause, of each of four devices (default: 25 each; 0: none)",
    )  # fmt: skip
    parser.add_argument("--draws", type=int, default=1, metavar="N", help="of every change (default: 1)")
    parser.add_argument(
        "--diagnose", type=float, nargs="?", const=0.0, default=math.inf, metavar="SIZE",
        help="diagnose the alarms of changes of this size and above (without one: of all), some 10 s each",
    )  # fmt: skip
    parser.add_argument("--first-seed", type=int, default=SEED, metavar="N", help=f"of the draws (default: {SEED})")


def run(arguments: argparse.Namespace) -> int:
    """Watch, print the tables, write watch.json; an interrupt keeps what was watched."""
    from dataclasses import asdict, replace

    from bender_loop.shell.files import prepare_directory, write_result
    from bender_loop.shell.progress import Progress, print_table
    from bender_plant.model import load_model
    from bender_studies.watching.devices import EFFECTS, SHAPES, SIZES, Change, changed, quiet
    from bender_studies.watching.others import Expected
    from bender_studies.watching.short import Short, watched
    from bender_studies.watching.side_by_side import Beside, quiet_runs, side_by_side, table
    from bender_studies.watching.trial import Trial, judged
    from bender_watch.baseline.learn import learn
    from bender_watch.session import finite
    from bender_watch.settings import Settings

    out = prepare_directory(arguments.out)
    every, seed = arguments.between_false_alarms, arguments.first_seed
    sizes = arguments.sizes or SIZES
    model, training = load_model("paper"), quiet(seed).record(seed)
    baseline = learn(model, training, every)
    how = Settings(rows_between_false_alarms=every, diagnose=False, adopt=False)
    status = 0
    calm: dict[str, Any] = {}
    changes: list[Change] = []
    found: list[Trial] = []
    beside: list[Beside] = []
    short: list[Short] = []
    with Progress("watch benchmark") as bar:
        try:
            devices = [quiet(seed + 1000 + k) for k in range(arguments.quiet_devices)]
            calm |= _speed(model, training, baseline, how, devices, arguments.quiet_rows)
            for number, counted in enumerate(_quiet(arguments, baseline, devices), 1):
                calm |= counted
                bar.update(number, len(devices), "devices that do not change")
            effects = list(enumerate(arguments.effects or EFFECTS))
            for draw, (number, name), size, shape in product(range(arguments.draws), effects, sizes, SHAPES):
                change = changed(name, size, shape, seed + 10 + number + 100 * draw)
                if change is not None:
                    changes.append(change)
                    own = replace(how, diagnose=size >= arguments.diagnose)
                    found.append(judged(model, training, baseline, change, own))
                    bar.update(len(found), None, f"{name} {size:g} {shape}")
            if arguments.threshold_rows > 0.0:
                beside = side_by_side(
                    list(quiet_runs(baseline, devices, arguments.threshold_rows, seed + 100_000)),
                    list(quiet_runs(baseline, devices, arguments.threshold_rows, seed + 200_000)),
                    [(x, Expected.of(baseline, x.record).run(x.record.displacement_um)) for x in changes],
                    every,
                    lambda name: bar.update(len(found), None, name),
                )
            short.extend(
                watched(arguments.short_records, SHORT_EVERY, seed + 500_000, lambda x: bar.update(len(found), None, x))
            )
        except KeyboardInterrupt:
            status = 130
    _print_tables(arguments, found, calm, short)
    if beside:
        print_table(_beside_title(arguments, changes[0].added_um.size), *table(beside, sizes))
    lists = {"trials": found, "short": short, "side by side": beside}
    facts = {"quiet": calm} | {name: [asdict(x) for x in own] for name, own in lists.items()}
    write_result(out / "watch.json", finite(facts))
    sys.stdout.write(f"written: {out / 'watch.json'}\n")
    return status


def _print_tables(
    arguments: argparse.Namespace, found: "Sequence[Trial]", calm: dict[str, Any], short: "Sequence[Short]"
) -> None:
    from bender_loop.shell.progress import print_table
    from bender_studies.watching.devices import SIZES
    from bender_studies.watching.short import table_of_short

    title = f"Changes, one false alarm in {arguments.between_false_alarms:g} rows at most; delays in rows, medians"
    columns = ("size", "changes", "found", "median delay", "optimal", "ratio")
    columns += ("suspected first", "named first", "named first, or as either side of the linear device")
    print_table(title, columns, [_row(x, [y for y in found if y.size == x]) for x in arguments.sizes or SIZES])
    if calm:
        print_table("Devices that do not change", tuple(calm), [list(calm.values())])
    if short:
        print_table(f"Short records, one false alarm in {SHORT_EVERY:g} rows at most", *table_of_short(short))


def _beside_title(arguments: argparse.Namespace, rows: int) -> str:
    return (
        f"Side by side, each threshold set for one false alarm in {arguments.between_false_alarms:g} rows on "
        f"{arguments.threshold_rows:g} rows without a change; false alarms counted on as many others; runs of {rows} "
        "rows; delays in rows"
    )


def _speed(model: Any, training: Any, baseline: Any, how: Any, devices: "list[Quiet]", rows: float) -> dict[str, float]:
    """Watch one long record of a device that does not change; return rows a second, of a whole watch."""
    from bender_studies.watching.devices import lasting
    from bender_watch.follow.rows import Rows
    from bender_watch.watcher import Watcher

    if not devices or not rows:
        return {}
    part = Rows.of(lasting(devices, int(min(rows, MOST_TIMED))))
    watcher = Watcher(model, training, baseline, how)
    began_s = time.process_time()
    for _ in (*watcher.begin_record("quiet", part), *watcher.take(part)):
        pass
    return {"rows a second of one core": len(part) / (time.process_time() - began_s)}


def _quiet(arguments: argparse.Namespace, baseline: Any, devices: "list[Quiet]") -> Iterator[dict[str, Any]]:
    """Hold the tests against devices that do not change; yield what was counted so far, behind each of them.

    What is expected of a plan is computed once; each repeat has noise of its own, and all are one record without an
    end, as sums and windows of the tests see it.
    """
    from bender_studies.watching.others import Expected
    from bender_studies.watching.side_by_side import Counted, alarms_without_end

    alarms, rows = 0, 0
    for number, device in enumerate(devices if arguments.quiet_rows else ()):
        record = device.record(arguments.first_seed + 300_000 + number)
        found, judged = alarms_without_end(
            Expected.of(baseline, record), device, arguments.quiet_rows, arguments.first_seed + 400_000 + number
        )
        alarms, rows = alarms + found, rows + judged
        counted = Counted.of(alarms, rows)
        yield {
            "rows": rows,
            "false alarms": alarms,
            "expected at most": rows / arguments.between_false_alarms,
            "one in rows, at least": counted.low,
            "one in rows, at most": counted.high if alarms else None,
        }


def _row(size: float, trials: "Sequence[Trial]") -> list[Any]:
    from bender_studies.watching.trial import median

    known = [x for x in trials if x.optimal_rows is not None]
    ratios = [math.inf if x.rows is None else x.rows / (x.optimal_rows or 1) for x in known]
    explained = [x for x in trials if x.rows is not None]
    return [
        size,
        len(trials),
        len(explained),
        _finite(median([x.rows for x in known])),
        _finite(median([x.optimal_rows for x in known])),
        _finite(median(ratios)),
        _share([x.effect in x.suspected for x in explained]),
        _share([x.is_named for x in explained if x.named is not None]),
        _share([x.is_either for x in explained if x.named is not None]),
    ]


def _share(right: Sequence[bool]) -> str | None:
    """Return how many are right, with the interval of 95 % of their share; None of none."""
    from bender_studies.hidden_effects.figures import wilson

    if not right:
        return None
    low, high = wilson(sum(right) / len(right), len(right))
    return f"{sum(right)} of {len(right)} ({100.0 * low:.0f} to {100.0 * high:.0f} %)"


def _finite(value: float) -> float | str:
    return value if math.isfinite(value) else "never"
