"""Figure 10: the simulated step of 10 µm, tuned by beetle antennae search and by the rule of Ziegler and Nichols."""

import math

from bender_loop.control.metrics import StepMetrics
from bender_loop.control.trace import Trace
from bender_report.page import Picture
from bender_report.picture_style import BAND, COLOURS, MUTED, OTHERS, TUNED, dress, new_figure, to_png, write_title
from bender_studies.reproduction.exhibit import Exhibit, Row, Shown, finite
from bender_studies.reproduction.printed import BAS_STEP, SIMULATED_TIME_S, ZN_STEP
from bender_studies.reproduction.searches import JUDGED_S, Beetles
from bender_studies.reproduction.shared_work import SharedWork
from bender_studies.reproduction.steps import PaperLoop, Response, Tuned

SETPOINT_UM = 10.0
FIGURES = {"rise": ("rise", "s"), "settling": ("settling, 2 %", "s"), "overshoot": ("overshoot", "%")}
QUIET_BELOW = 1.3


def show(shared: SharedWork) -> Exhibit:
    """The printed figures, the paper's task run as printed, and our loop; then gains that come near the print."""
    beetles, tuned, loop = shared.beetles, shared.tuned, shared.paper_loop
    ours = tuned.ours.metrics
    return Exhibit(
        name="Figure 10",
        finding=f"Ours settles in {ours.settling_time_s:.2g} s with {ours.overshoot_percent:.1f} % overshoot behind a "
        f"camera's delay; the paper's in {BAS_STEP['settling'].text} s without",
        paper_mode_is=f"the paper's task at 100 Hz without delay, seen for {JUDGED_S:g} s: medians over "
        f"{shared.scale.seeds} seeds of Algorithm 1 as printed; Ziegler-Nichols as (21) has it",
        ours_is="bender tune: 30 Hz, one frame of latency, 15 ms of exposure, a supply of 20 ms, judged between the "
        "frames too",
        rows=[*_bas(beetles, ours), *_zn(loop, tuned), *_nearest(loop)],
        picture=Picture(_draw(beetles, loop, tuned), "Step responses of all of these over six seconds"),
        remarks=[_sentence(loop.rule_says, "on the paper's task"), _sentence(tuned.rule_says, "on the bench")],
    )


def _bas(beetles: Beetles, ours: StepMetrics) -> list[Row]:
    def row(kind: str, figure: str, remark: str = "") -> Row:
        what, unit = FIGURES[figure]
        median = _finite(figure, beetles.median(kind, lambda metrics: _figure(metrics, figure)))
        return {
            "printed": Row(
                f"BAS-PID: {what}", unit, BAS_STEP[figure], median, _finite(figure, _figure(ours, figure)), remark
            ),
            "turned": Row(f"BAS, sign of (25) turned: {what}", unit, None, median, None, remark),
            "ours": Row(f"reliable_bas on the paper's task: {what}", unit, None, None, median, remark),
        }[kind]

    remarks = {
        "printed": "BAS-PID: as printed the search climbs and keeps about its first point, a loop that rings or never "
        "arrives; the paper prints no gains",
        "turned": "sign turned: raw gains from U[0, 1]³, whose one step length suits none of them",
        "ours": "on the paper's task: MSE (28) at 100 Hz without delay asks for a small error at the samples alone",
    }
    return [row(kind, figure, remarks[kind] if figure == "rise" else "") for kind in remarks for figure in FIGURES]


def _zn(loop: PaperLoop, tuned: Tuned) -> list[Row]:
    mode = None if loop.rule is None else loop.rule.metrics
    ours = None if tuned.rule is None else tuned.rule.metrics
    remarks = {
        "settling": f"ZN-PID settling: the paper simulated {SIMULATED_TIME_S.text} s, in which nothing can be seen to "
        "settle at 3.82 s; every run here lasts longer",
    }
    return [
        Row(f"ZN-PID: {what}", unit, ZN_STEP[figure], _shown(mode, figure), _shown(ours, figure),
            remarks.get(figure, ""))
        for figure, (what, unit) in FIGURES.items()
    ]  # fmt: skip


def _nearest(loop: PaperLoop) -> list[Row]:
    rows = []
    for name, printed, (response, miss) in zip(("BAS-PID", "ZN-PID"), (BAS_STEP, ZN_STEP), loop.nearest, strict=True):
        g = response.gains
        remark = (
            f"nearest to {name}: a search for the gains whose step on the paper's task comes nearest to the three "
            f"printed figures ends at Kp {g.proportional_V_per_um:.2g} V/µm, Ki {g.integral_V_per_um_s:.3g} V/(µm s), "
            f"Kd {g.derivative_V_s_per_um:.2g} V s/µm and misses one of them by {100.0 * miss:.0f} %"
        )
        for figure, (what, unit) in FIGURES.items():
            found = _finite(figure, _figure(response.metrics, figure))
            told = remark if figure == "rise" else ""
            rows.append(Row(f"nearest to {name}: {what}", unit, printed[figure], found, None, told))
    return rows


def _figure(metrics: StepMetrics, figure: str) -> float:
    return {
        "rise": metrics.rise_time_s,
        "settling": metrics.settling_time_s,
        "overshoot": metrics.overshoot_percent,
    }[figure]


def _shown(metrics: StepMetrics | None, figure: str) -> Shown:
    return "no rule" if metrics is None else _finite(figure, _figure(metrics, figure))


def _finite(figure: str, value: float) -> Shown:
    return finite(value, "runs away" if figure == "overshoot" else "never")


def _sentence(says: str, where: str) -> str:
    return f"Ziegler-Nichols {where}: {says.replace('/um', '/µm')}."


def _draw(beetles: Beetles, loop: PaperLoop, tuned: Tuned) -> bytes:
    figure = new_figure(10.5, 4.6)
    axes = figure.subplots()
    axes.axhspan(0.98 * SETPOINT_UM, 1.02 * SETPOINT_UM, color=BAND, zorder=0)
    curves: list[tuple[str, Trace | None, str, float]] = [
        ("BAS as printed", beetles.typical("printed").trace, COLOURS["zn"], 0.9),
        ("BAS, sign turned", beetles.typical("turned").trace, COLOURS["simc"], 1.2),
        ("Ziegler-Nichols, paper's task", _trace(loop.rule), OTHERS[0], 1.0),
        ("nearest to the paper's BAS-PID", loop.nearest[0][0].trace, OTHERS[1], 1.4),
        ("nearest to the paper's ZN-PID", loop.nearest[1][0].trace, OTHERS[2], 1.4),
        ("ours, on the bench's loop", tuned.ours.trace, TUNED, 2.2),
    ]
    for name, trace, colour, width in curves:
        if trace is not None:
            time, displacement = (
                (trace.time_s, trace.displacement_um)
                if trace.fine_time_s is None or trace.fine_displacement_um is None
                else (trace.fine_time_s, trace.fine_displacement_um)
            )
            axes.plot(time, displacement, color=colour, lw=width, alpha=0.6 if width < QUIET_BELOW else 1.0, label=name)
    for name, printed in (("BAS-PID", BAS_STEP), ("ZN-PID", ZN_STEP)):
        instant = float(printed["settling"].text)
        axes.axvline(instant, color=MUTED, lw=0.9, ls=(0, (1, 2)))
        axes.text(instant, 1.0, f" {name} settled,\n as printed", fontsize=8, color=MUTED)
    dress(axes, x_label="time (s)", y_label="tip (µm)")
    axes.set_xlim(0.0, JUDGED_S)
    axes.set_ylim(-0.5, 2.3 * SETPOINT_UM)
    axes.legend(fontsize=8, frameon=False, loc="upper right", ncols=2)
    settling = tuned.ours.metrics.settling_time_s
    found = "never" if math.isnan(settling) else f"{settling:.2g} s"
    write_title(figure, f"A step of 10 µm: ours settles in {found}", "each curve: the seed next to the median")
    return to_png(figure)


def _trace(response: Response | None) -> Trace | None:
    return None if response is None else response.trace
