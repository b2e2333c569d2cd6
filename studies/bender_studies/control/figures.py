"""The table of the benches, and what holds them to the bounds."""

import math
from collections.abc import Sequence

import numpy as np

from bender_loop.shell.progress import Cell
from bender_studies.control.trial import Tried

WORSE, ALLOWED_PERCENT = 1.05, 2.0
"""Times a figure of the PID block alone; an overshoot up to so much is none."""
HYSTERESIS, DRIFT = "rate_independent_hysteresis", "thermal_drift"
CLAIMS = "what", "asked", "found"
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


def claims(found: Sequence[Tried]) -> list[list[Cell]]:
    """What is asked for, the bound, and what was found over all runs of all benches."""
    run = [x for x in found if x.tracking]
    wrong = sum(bool(x.wrong) for x in found)
    given = f", {wrong} with an effect in the model that is not there" if wrong else ""
    counted = f"{len(run)} of {len(found)}; refused {sum(not x.recommended for x in found)}"
    rows: list[list[Cell]] = [[f"benches run with the model{given}", None, counted]]
    if not run:
        return rows
    ratios = np.array([two / one for x in run for _, one, two in x.tracking])
    tracking = f"rms with the model to the PID block alone, known references, {ratios.size} runs: "
    stairs = [x.stairs_um[1] / x.stairs_um[0] for x in run]
    settled = [x.settling_s[1] / x.settling_s[0] for x in run if not any(map(math.isnan, x.settling_s))]
    never = [sum(math.isnan(x.settling_s[k]) for x in run) for k in (0, 1)]
    rows += [
        [f"{tracking}median", "0.25", f"{np.median(ratios):.3f}"],
        [f"{tracking}90 % below", "0.5", f"{np.quantile(ratios, 0.9):.3f}"],
        [f"{tracking}worst", "1.05", f"{ratios.max():.3f}"],
        ["rms of stairs with the model to the PID block alone: worst", "1.05", f"{max(stairs):.3f}"],
        ["largest overshoot of stairs with the model", "2 %", f"{max(x.overshoot_percent[1] for x in run):.2f} %"],
        ["benches on which stairs do not settle: PID block alone, with the model", None, f"{never[0]}, {never[1]}"],
    ]
    what = "benches on which the model makes rms, settling or overshoot of stairs worse by more than 5 %"
    rows.append([what, "0", f"{sum(map(is_worse, run))} of {len(run)}"])
    if settled:
        what = f"settling of stairs, ratio, {len(settled)} benches: median"
        rows.append([what, "0.5", f"{np.median(settled):.3f}"])
    # what drifts meanwhile opens the loop too, and belongs to the record
    if loops := [x.open_loop_percent for x in run if HYSTERESIS in x.truth and DRIFT not in x.truth]:
        what = "hysteresis left by the inverse alone, of a slow triangle where nothing drifts: worst"
        rows.append([what, "2.5 %", f"{max(loops):.1f} %"])
    for what, least in (
        ("the dead time alone costs", [x.dead_time_um for x in run]),
        ("no controller can avoid on these benches", [x.possible_um for x in run]),
    ):
        above = np.array([_above(x, least_um) for x, least_um in zip(run, least, strict=True)])
        text = f"{np.median(above):.0f} %, {above.max():.0f} %"
        rows.append([f"rms of stairs above what {what}: median, worst", "15 %", text])
    if spread := sum(x.spread for x in run):
        what = "unstable with gain 0.7 to 1.3, resonance 0.8 to 1.4, one frame later"
        rows.append([what, "0", f"{sum(x.unstable for x in run)} of {spread}"])
    return rows


def is_worse(x: Tried) -> bool:
    """Whether the stairs with the model are worse than with the PID block alone; a level that is never reached is."""
    times = [math.inf if math.isnan(y) else y for y in x.settling_s]
    most_percent = max(ALLOWED_PERCENT, WORSE * x.overshoot_percent[0])
    slower = times[1] > WORSE * times[0]
    return slower or x.stairs_um[1] > WORSE * x.stairs_um[0] or x.overshoot_percent[1] > most_percent


def _above(x: Tried, least_um: float) -> float:
    """By how many per cent the rms of the stairs with the model is above another one."""
    return 100.0 * (x.stairs_um[1] / least_um - 1.0)


def _median(x: Tried) -> float:
    return float(np.median([two / one for _, one, two in x.tracking]))
