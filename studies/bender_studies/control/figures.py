"""The table of the benches, and the sentences that hold them to the bounds."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from bender_loop.shell.progress import Cell
from bender_studies.control.trial import Tried

HYSTERESIS = "rate_independent_hysteresis"
COLUMNS = (
    "bench", "hidden", "verdict", "worst Ms", "tracking, ratio", "settling, s", "overshoot, %", "stairs, rms, ratio",
    "to the dead time", "to the possible", "open loop, %",
)  # fmt: skip


def rows(found: Sequence[Tried]) -> list[list[Cell]]:
    """One row for each bench: the PID block alone, then with the model."""
    return [_row(x) for x in found]


def _row(x: Tried) -> list[Cell]:
    wrong = f" (model also: {x.wrong})" if x.wrong else ""
    name = [x.id, " + ".join(x.truth) + wrong, x.verdict]
    if not x.tracking:
        return [*name, None, "not recommended", None, None, None, None, None, None]
    return [
        *name,
        round(x.worst_ms, 2),
        f"{_median(x):.2f}",
        " → ".join("never" if math.isnan(y) else f"{y:.2f}" for y in x.settling_s),
        " → ".join(f"{y:.1f}" for y in x.overshoot_percent),
        f"{x.stairs_um[1] / x.stairs_um[0]:.2f}",
        f"{_above(x, x.dead_time_um):+.0f} %",
        f"{_above(x, x.possible_um):+.0f} %",
        round(x.open_loop_percent, 1),
    ]


def sentences(found: Sequence[Tried]) -> Iterator[str]:
    """What is asked for, and what was found, over all runs of all benches."""
    run = [x for x in found if x.tracking]
    failed = [x for x in found if x.error]
    refused = sum(not x.recommended for x in found)
    yield f"{len(found)} benches: {len(run)} run with the model, {refused} not recommended"
    yield from (f"{x.id}: {x.error}" for x in failed)
    if not run:
        return
    ratios = np.array([two / one for x in run for _, one, two in x.tracking])
    yield (
        f"tracking of known references, rms with the model to rms of the PID block alone, {ratios.size} runs: median "
        f"{np.median(ratios):.3f} (asked: 0.25), 90 % below {np.quantile(ratios, 0.9):.3f} (0.5), worst "
        f"{ratios.max():.3f} (1.05)"
    )
    stairs = [x.stairs_um[1] / x.stairs_um[0] for x in run]
    yield f"rms of stairs, with the model to the PID block alone: worst {max(stairs):.3f} (1.05)"
    if spread := sum(x.spread for x in run):
        unstable = sum(x.unstable for x in run)
        yield f"gain 0.7 to 1.3, resonance 0.8 to 1.4, one frame later: {unstable} of {spread} runs unstable (asked: 0)"
    settled = [x.settling_s[1] / x.settling_s[0] for x in run if not any(map(math.isnan, x.settling_s))]
    if settled:
        yield f"settling of stairs, ratio: median {np.median(settled):.3f} (asked: 0.5), {len(settled)} benches"
    yield f"overshoot of stairs with the model: largest {max(x.overshoot_percent[1] for x in run):.2f} % (asked: 2 %)"
    if loops := [x.open_loop_percent for x in run if HYSTERESIS in x.truth]:
        yield f"hysteresis left by the inverse alone: worst {max(loops):.1f} % of a slow triangle (asked: 2.5 %)"
    for what, least in (
        ("what the dead time alone costs", [x.dead_time_um for x in run]),
        ("what dead time and bounds of the command cost", [x.possible_um for x in run]),
    ):
        above = np.array([_above(x, least_um) for x, least_um in zip(run, least, strict=True)])
        yield f"rms of stairs above {what}: median {np.median(above):.0f} %, worst {above.max():.0f} % (asked: 15 %)"


def _above(x: Tried, least_um: float) -> float:
    """By how many per cent the rms of the stairs with the model is above another one."""
    return 100.0 * (x.stairs_um[1] / least_um - 1.0)


def _median(x: Tried) -> float:
    return float(np.median([two / one for _, one, two in x.tracking]))
