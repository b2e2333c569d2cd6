"""The tuned loop over frequency, the plant beside it: Bode, Nyquist and the four sensitivity functions, one picture."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bender_loop.control.pid import Gains
from bender_report.palette import light
from bender_report.picture_style import GRID, INK, MUTED, TUNED, dress, new_figure, to_png, write_title
from bender_report.wording import relabelled
from bender_tuner.model.ensemble import Case
from bender_tuner.model.loop_transfer import DelayedPlant
from bender_tuner.model.margins import Margins, margins
from bender_tuner.model.sensitivities import Sensitivities, lowest_drawn_Hz, sensitivities
from bender_tuner.task.problem import TuningProblem

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_POINTS = 1600
_BESIDE_CIRCLES, _LOWEST_L = 0.1, -2.4
_LOWEST_SHARE = 1e-3
_FEW_DECADES, _FLAT = 100.0, 1.001
_MARK = {"color": MUTED, "lw": 0.9, "ls": (0, (4, 3)), "zorder": 2}
_LAYOUT: list[Any] = [
    ["plant", "gain", "nyquist", "complementary", "load"],
    ["step", "phase", "nyquist", "sensitivity", "control"],
]
_PLANT = light("given")

Curve = tuple[Sensitivities, str, float, int]
"""Responses with the colour, the width and the place in depth of their lines."""


def draw_loop(problem: TuningProblem, gains: Gains) -> bytes:
    """Draw plant, L and the four sensitivity functions of the nominal loop, other cases thin behind; returns a PNG."""
    return to_png(loop_figure(problem, gains))


def loop_figure(problem: TuningProblem, gains: Gains) -> "Figure":
    """Return the same as a figure.

    The plant's gain and its answer to a step stand by themselves, its phase beside that of L.
    """
    nominal = problem.ensemble.nominal
    found = margins(gains, nominal.delayed)
    figure = new_figure(17.5, 6.4)
    panels = figure.subplot_mosaic(_LAYOUT, width_ratios=(1.0, 1.0, 1.25, 1.0, 1.0))
    from_Hz = lowest_drawn_Hz(nominal.delayed, found.crossover_rad_per_s)
    behind = [case for case in problem.ensemble.cases if case is not nominal]
    curves = [(_thinned(case, gains, from_Hz), MUTED, 0.7, 3) for case in behind]
    curves.append((_thinned(nominal, gains, from_Hz), TUNED, 2.0, 5))
    _draw_plant(panels, curves[-1][0], nominal.delayed)
    _draw_bode(panels["gain"], panels["phase"], curves, found)
    _draw_nyquist(panels["nyquist"], curves, problem.settings.max_ms)
    _draw_magnitude(
        panels["sensitivity"], curves, "|S|, of a disturbance", lambda x: x.sensitivity, found.sensitivity_peak
    )
    _draw_magnitude(
        panels["complementary"],
        curves,
        "|T|, of noise and set-point",
        lambda x: x.complementary,
        found.complementary_peak,
    )
    _draw_magnitude(panels["load"], curves, "|GS|, of a load (µm/V)", lambda x: x.load_um_per_V)
    _draw_magnitude(panels["control"], curves, "|CS|, command for noise (V/µm)", lambda x: x.control_V_per_um)
    for name in ("phase", "sensitivity", "control"):
        panels[name].set_xlabel("frequency (Hz)", fontsize=9, color=INK)
    _write_plain_numbers([axes for name, axes in panels.items() if name not in ("nyquist", "step")])
    write_title(figure, loop_in_words(found), "thin: other gains and latencies")
    return figure


def loop_in_words(found: Margins) -> str:
    """Return the margins of a loop for people."""
    if not found.stable:
        return "the nominal loop is unstable: its sensitivity functions mean nothing"
    gain = "any" if math.isinf(found.gain_margin) else f"{found.gain_margin:.2g}"
    phase = "any" if math.isinf(found.phase_margin_deg) else f"{found.phase_margin_deg:.0f}°"
    delay = "any" if math.isinf(found.delay_margin_s) else _time(found.delay_margin_s)
    peaks = f"Ms {found.sensitivity_peak:.2f}, Mt {found.complementary_peak:.2f}"
    return f"gain margin {gain}, phase margin {phase}, delay margin {delay}; peaks: {peaks}"


def _time(seconds: float) -> str:
    """Return a time in the unit that suits it."""
    return f"{1e3 * seconds:.0f} ms" if seconds < 1.0 else f"{seconds:.3g} s"


def _thinned(case: Case, gains: Gains, from_Hz: float) -> Sensitivities:
    """The responses from a frequency on, at no more points than a picture can show."""
    found = sensitivities(gains, case.delayed)
    first = int(np.searchsorted(found.frequency_Hz, from_Hz))
    last = found.frequency_Hz.size - 1
    wanted = np.geomspace(found.frequency_Hz[first], found.frequency_Hz[last], _POINTS)
    rows = np.unique(np.clip(np.searchsorted(found.frequency_Hz, wanted), first, last))
    return Sensitivities(**{name: getattr(found, name)[rows] for name in found.__dataclass_fields__})


def _draw_plant(panels: dict[str, "Axes"], responses: Sensitivities, plant: DelayedPlant) -> None:
    above, below = panels["plant"], panels["step"]
    model = plant.model
    response = model.frequency_response(2.0 * math.pi * responses.frequency_Hz)
    size = np.abs(response)
    if float(size.max()) < _FLAT * float(size.min()):
        # before the curve: matplotlib finds no limits of its own for one that is flat to the last digit
        above.set_yscale("log")
        above.set_ylim(0.5 * float(size.min()), 2.0 * float(size.max()))
    above.loglog(responses.frequency_Hz, size, color=_PLANT, lw=2.0)
    phase_deg = np.degrees(np.unwrap(np.angle(response)))
    panels["phase"].semilogx(responses.frequency_Hz, phase_deg, color=_PLANT, lw=1.4, zorder=4)
    steps = model.step_response(model.pulse_um_per_V.size + 1)
    below.plot(model.period_s * np.arange(steps.size), steps, color=_PLANT, lw=2.0)
    if math.isfinite(model.dc_gain_um_per_V):
        below.axhline(model.dc_gain_um_per_V, **_MARK)
    dress(above, x_label="frequency (Hz)", y_label=relabelled("|G|, of the plant (µm/V)"))
    dress(below, x_label="time (s)", y_label=relabelled("plant after a step of 1 V (µm)"))


def _draw_bode(above: "Axes", below: "Axes", curves: list[Curve], found: Margins) -> None:
    for responses, colour, width, order in curves:
        style = {"color": colour, "lw": width, "zorder": order}
        above.loglog(responses.frequency_Hz, np.abs(responses.loop), **style)
        below.semilogx(responses.frequency_Hz, _phase_deg(responses.loop), **style)
    above.axhline(1.0, **_MARK)
    below.axhline(-180.0, **_MARK)
    if math.isfinite(found.crossover_rad_per_s):
        for axes in (above, below):
            axes.axvline(found.crossover_rad_per_s / (2.0 * math.pi), **_MARK)
    below.set_ylim(max(below.get_ylim()[0], -720.0), None)
    below.set_yticks(np.arange(-720.0, 91.0, 90.0)[_in_view(below)])
    dress(above, y_label="|L|")
    dress(below, y_label="phase of L; of G, pale (°)")


def _write_plain_numbers(panels: list["Axes"]) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    plain = FuncFormatter(lambda value, _: f"{value:g}")
    for axes in panels:
        axes.xaxis.set_major_formatter(plain)
        axes.xaxis.set_minor_formatter(NullFormatter())
        if axes.get_yscale() == "log":
            low, high = axes.get_ylim()
            if high < _FEW_DECADES * low:
                axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axes.yaxis.set_major_formatter(plain)
            axes.yaxis.set_minor_formatter(NullFormatter())


def _in_view(axes: "Axes") -> NDArray[np.bool_]:
    low, high = axes.get_ylim()
    ticks = np.arange(-720.0, 91.0, 90.0)
    return (ticks >= low) & (ticks <= high)


def _phase_deg(loop: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Continuous, from the branch nearest to that of an integrator at the slow end."""
    phase = np.degrees(np.unwrap(np.angle(loop)))
    return phase - 360.0 * np.round((phase[0] + 90.0) / 360.0)


def _draw_nyquist(axes: "Axes", curves: list[Curve], bound: float) -> None:
    for responses, colour, width, order in curves:
        axes.plot(responses.loop.real, responses.loop.imag, color=colour, lw=width, zorder=order)
    turn = np.linspace(0.0, 2.0 * math.pi, 181)
    axes.plot(np.cos(turn), np.sin(turn), color=GRID, lw=1.0, zorder=1)
    axes.plot(-1.0 + np.cos(turn) / bound, np.sin(turn) / bound, **_MARK)
    axes.plot([-1.0], [0.0], "+", color=INK, ms=9, zorder=6)
    axes.annotate(f"Ms = {bound:g}", (-1.0, 1.0 / bound), ha="center", va="bottom", fontsize=8, color=MUTED)
    # the panel shows more above and below, as far as it is higher than it is wide
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlim(-1.0 - 1.0 / bound - _BESIDE_CIRCLES, 1.0 + _BESIDE_CIRCLES, auto=True)
    axes.set_ylim(_LOWEST_L, 1.0 + _BESIDE_CIRCLES, auto=True)
    dress(axes, x_label="real part of L", y_label="imaginary part of L")


def _draw_magnitude(
    axes: "Axes",
    curves: list[Curve],
    label: str,
    pick: Callable[[Sensitivities], NDArray[np.complex128]],
    peak: float = math.nan,
) -> None:
    highest = 0.0
    for responses, colour, width, order in curves:
        size = np.abs(pick(responses))
        highest = max(highest, float(np.max(size)))
        axes.loglog(responses.frequency_Hz, size, color=colour, lw=width, zorder=order)
    if math.isfinite(peak):
        axes.axhline(peak, **_MARK)
        axes.annotate(
            f"{peak:.2f}", (0.01, peak), xycoords=("axes fraction", "data"), va="bottom", fontsize=8, color=MUTED
        )
    low, high = axes.get_ylim()
    axes.set_ylim(max(low, _LOWEST_SHARE * highest), high)
    dress(axes, y_label=relabelled(label))
