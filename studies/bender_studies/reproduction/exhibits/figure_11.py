"""Figure 11: the step of 20 um on the bench, with the gains of the simulation."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bender_loop.control.metrics import StepMetrics, step_metrics
from bender_loop.control.pid import Gains
from bender_loop.control.trace import Trace
from bender_report.page import Picture
from bender_report.picture_style import BAND, COLOURS, OTHERS, TUNED, dress, new_figure, to_png, write_title
from bender_studies.reproduction.exhibit import Exhibit, Printed, Row, finite
from bender_studies.reproduction.printed import BAS_ON_THE_BENCH, ZN_ON_THE_BENCH
from bender_studies.reproduction.shared_work import SharedWork

SETPOINT_UM, DURATION_S = 20.0, 6.0
LATE_S = 2.0
BAS, ZN, OURS = "nearest to the paper's BAS-PID", "Ziegler-Nichols", "ours"
FILES = {BAS: "bas", ZN: "zn", OURS: "ours"}
COLOUR_OF = {BAS: OTHERS[1], ZN: COLOURS["zn"], OURS: TUNED}


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """One closed loop on the bench."""

    name: str
    trace: Trace
    metrics: StepMetrics

    @property
    def swing_um(self) -> float:
        """Peak to peak of what the camera saw after two seconds."""
        late = self.trace.measured_um[self.trace.time_s >= LATE_S]
        return float(np.ptp(late)) if late.size else float("inf")


def show(shared: SharedWork) -> Exhibit:
    """The paper's gains as its own ways give them, and ours, on one bench."""
    tuned = shared.tuned
    printed = _run(shared, BAS, shared.paper_loop.nearest[0][0].gains)
    rule = None if tuned.rule is None else _run(shared, ZN, tuned.rule.gains)
    ours = _run(shared, OURS, shared.tuned_at(SETPOINT_UM))
    runs = [run for run in (rule, printed, ours) if run is not None]
    return Exhibit(
        name="Figure 11",
        finding=f"On the bench ours reaches 20 µm with {ours.metrics.overshoot_percent:.1f} % overshoot and settles in "
        f"{_words(ours.metrics.settling_time_s)}",
        paper_mode_is="the paper prints no gains: those whose simulated step comes nearest to its BAS-PID of Figure "
        "10; Ziegler-Nichols on the loop of the bench",
        ours_is="bender tune for 20 µm: ITAE, two frames of latency, noise, bounded slew; all of these gains on "
        f"{shared.bench.how}",
        # ours has no second row: it stands beside the paper's tuned gains, and Ziegler-Nichols by itself
        rows=[*_rows("BAS-PID", BAS_ON_THE_BENCH, printed, ours), *_rows("ZN-PID", ZN_ON_THE_BENCH, rule, None)],
        picture=Picture(_draw(runs), "The tip at the frames, and the commands"),
        remarks=[
            *(f"{run.name}: the run was ended before its time." for run in runs if run.trace.diverged),
            "The paper describes Figure 11 in words; numbers for its curves are not printed.",
            "All figures are taken from what the camera saw. Commands change by 225 V/s at most, as the guard of the "
            "bench wants it; that takes the sharpest of the swings.",
        ],
    )


def _run(shared: SharedWork, name: str, gains: Gains) -> Run:
    trace = shared.bench.step(FILES[name], gains, SETPOINT_UM, DURATION_S)
    if not trace.diverged:
        shared.kept(f"step-{FILES[name]}.csv", trace.to_record())
    return Run(name, trace, step_metrics(trace, SETPOINT_UM))


def _rows(name: str, words: Printed, mode: Run | None, ours: Run | None) -> list[Row]:
    def row(what: str, unit: str, figure: Callable[[Run], float], otherwise: str) -> Row:
        found, own = (None if run is None else finite(figure(run), otherwise) for run in (mode, ours))
        return Row(f"{name}: {what}", unit, None, found, own)

    return [
        Row(f"{name}: in words", "", words, None, None),
        row("rise", "s", lambda run: run.metrics.rise_time_s, "never"),
        row("settling, 2 %", "s", lambda run: run.metrics.settling_time_s, "never"),
        row("overshoot", "%", lambda run: run.metrics.overshoot_percent, "runs away"),
        row("swing after 2 s", "µm", lambda run: run.swing_um, "runs away"),
    ]


def _words(settling_s: float) -> str:
    return "more than was run" if math.isnan(settling_s) else f"{settling_s:.2g} s"


def _draw(runs: list[Run]) -> bytes:
    figure = new_figure(10.5, 5.0)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.2, 1.0))
    above.axhspan(0.98 * SETPOINT_UM, 1.02 * SETPOINT_UM, color=BAND, zorder=0)
    for run in runs:
        colour = COLOUR_OF[run.name]
        above.plot(run.trace.time_s, run.trace.displacement_um, color=colour, lw=1.5, label=run.name)
        below.step(run.trace.time_s, run.trace.voltage_V, where="post", color=colour, lw=1.0)
    dress(above, y_label="tip (µm)")
    dress(below, x_label="time (s)", y_label="command (V)")
    above.legend(fontsize=8, frameon=False, loc="lower right")
    above.set_xlim(0.0, DURATION_S)
    write_title(figure, "A step of 20 µm on the bench")
    return to_png(figure)
