"""The paper's Fig. 10: step responses side by side, the command voltage below."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from bender_loop.control.metrics import StepMetrics, has_settled
from bender_report.picture_style import (
    BAND,
    INK,
    MUTED,
    NARROW_IN,
    colours_for,
    dress,
    new_figure,
    to_png,
    write_key,
    write_title,
)
from bender_report.wording import axis_text, relabelled
from bender_tuner.task.contenders import Contender
from bender_tuner.task.judgement import Judgement
from bender_tuner.task.settings import TuneSettings

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_TOP, _BOTTOM = 1.62, -0.12
_BAND_SHARE = 0.02


def draw_steps(
    contenders: Sequence[Contender], settings: TuneSettings, marks_s: Mapping[str, float] | None = None
) -> bytes:
    """Draw all judged contenders, in front the one that is written; returns a PNG file.

    Args:
        contenders: the tuned one first, which is written unless one of them follows a model; those without a judgement
            are left out.
        settings: of the tuning.
        marks_s: instants to mark on the time axis, by what they are.
    """
    return to_png(steps_figure(contenders, settings, marks_s))


def steps_figure(
    contenders: Sequence[Contender],
    settings: TuneSettings,
    marks_s: Mapping[str, float] | None = None,
    narrow: bool = False,
) -> "Figure":
    """Return the same as a figure, on demand one for a phone."""
    written_first = sorted(contenders, key=lambda x: x.following is None)
    judged = [(contender, contender.judgement) for contender in written_first if contender.judgement is not None]
    colours = colours_for([contender.method for contender, _ in judged])
    figure = new_figure(NARROW_IN, 7.0) if narrow else new_figure(10.5, 6.2)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.4, 1.0))
    rest_um = float(judged[0][1].trace.displacement_um[0])
    height_um = settings.setpoint_um - rest_um
    _draw_target(above, settings.setpoint_um, _BAND_SHARE * abs(height_um))
    for contender, judgement in reversed(judged):
        _draw_one(above, below, judgement, colours[contender.method], in_front=contender is judged[0][0])
    named = [(c.label, j, colours[c.method]) for c, j in judged]
    if narrow:
        write_key(figure, [_in_one_line(*entry, settings.duration_s) for entry in named])
    else:
        _label(above, named, settings.duration_s)
    for text, instant_s in (marks_s or {}).items():
        _mark(above, text, instant_s, settings)
    dress(above, y_label=axis_text("displacement (µm)"))
    dress(below, x_label="time (s)", y_label=relabelled("command (V)"))
    above.set_ylim(*sorted((rest_um + _BOTTOM * height_um, rest_um + _TOP * height_um)))
    above.set_xlim(0.0, settings.duration_s)
    finding = relabelled(_finding(judged[0][0].label, judged[0][1].metrics, settings))
    beside = "" if judged[0][0].following is None else f"; {contenders[0].label}: its gains, without the model"
    write_title(figure, finding, relabelled(_circumstances(settings)) + beside)
    return figure


def figures_in_words(metrics: StepMetrics, run_s: float) -> tuple[str, str]:
    """(times, overshoot) of a step response for people, seen for `run_s`."""
    overshoot = f"overshoot {metrics.overshoot_percent:.{0 if metrics.overshoot_percent >= 10.0 else 1}f} %"
    if math.isnan(metrics.settling_time_s):
        return f"does not settle, in the end {abs(metrics.steady_state_error_um):.2g} µm off", overshoot
    if not has_settled(metrics.settling_time_s, run_s):
        return f"rises in {duration_in_words(metrics.rise_time_s)}, has not settled within {run_s:g} s", overshoot
    rises, settles = (duration_in_words(t) for t in (metrics.rise_time_s, metrics.settling_time_s))
    return f"rises in {rises}, settles in {settles}", overshoot


def duration_in_words(duration_s: float) -> str:
    """Seconds, or milliseconds where it is short."""
    return f"{duration_s:.2f} s" if duration_s >= 0.1 else f"{1e3 * duration_s:.2g} ms"


def _finding(label: str, metrics: StepMetrics, settings: TuneSettings) -> str:
    times, overshoot = figures_in_words(metrics, settings.duration_s)
    return f"{label}: a step to {settings.setpoint_um:g} µm {times}, {overshoot}"


def _circumstances(settings: TuneSettings) -> str:
    frames = f"{settings.latency_frames} frame{'' if settings.latency_frames == 1 else 's'} of latency"
    exposure = f", exposure {settings.exposure_s * 1e3:.3g} ms" if settings.exposure_s else ""
    return f"simulated through the FMU, {settings.rate_Hz:g} Hz, {frames}{exposure}; band: ± 2 %"


def _draw_target(axes: "Axes", setpoint_um: float, band_um: float) -> None:
    axes.axhspan(setpoint_um - band_um, setpoint_um + band_um, color=BAND, zorder=0)
    axes.axhline(setpoint_um, color=MUTED, lw=0.8, ls=(0, (4, 3)), zorder=1)


def _draw_one(above: "Axes", below: "Axes", judgement: Judgement, colour: str, *, in_front: bool) -> None:
    trace = judgement.trace
    fine_time = trace.time_s if trace.fine_time_s is None else trace.fine_time_s
    fine = trace.displacement_um if trace.fine_displacement_um is None else trace.fine_displacement_um
    width, order = (2.0, 5) if in_front else (1.0, 3)
    above.plot(fine_time, fine, color=colour, lw=width, zorder=order)
    below.step(trace.time_s, trace.voltage_V, where="post", color=colour, lw=0.8 * width, zorder=order)


def _label(axes: "Axes", entries: Sequence[tuple[str, Judgement, str]], run_s: float) -> None:
    """Name each curve in its colour to the right of the panel, with its figures."""
    for place, (label, judgement, colour) in enumerate(entries):
        times, overshoot = figures_in_words(judgement.metrics, run_s)
        top = 1.0 - place * min(0.2, 1.0 / len(entries))
        axes.annotate(
            label, (1.015, top), xycoords="axes fraction", color=colour, fontweight="bold", fontsize=9.5, va="top"
        )
        axes.annotate(
            f"{times}\n{overshoot}, {_robustness_in_words(judgement)}",
            (1.015, top - 0.052),
            xycoords="axes fraction",
            color=INK,
            fontsize=8,
            va="top",
            linespacing=1.35,
        )


def _in_one_line(label: str, judgement: Judgement, colour: str, run_s: float) -> tuple[str, str]:
    times, overshoot = figures_in_words(judgement.metrics, run_s)
    return f"{label}: {times}, {overshoot}, {_robustness_in_words(judgement)}", colour


def _robustness_in_words(judgement: Judgement) -> str:
    worst = judgement.practitioner.worst_sensitivity_peak
    if math.isfinite(worst):
        return f"worst Ms {worst:.2f}"
    unstable = judgement.robustness.unstable_cases
    return f"unstable in {unstable} of {len(judgement.robustness.cases)} cases"


def _mark(axes: "Axes", text: str, instant_s: float, settings: TuneSettings) -> None:
    if instant_s > settings.duration_s:
        return
    axes.axvline(instant_s, ymax=0.93, color=MUTED, lw=0.9, ls=(0, (1, 2)), zorder=1)
    height = (_TOP - 0.02) * settings.setpoint_um
    axes.text(instant_s, height, text, ha="center", va="top", fontsize=8, color=MUTED, backgroundcolor="white")
