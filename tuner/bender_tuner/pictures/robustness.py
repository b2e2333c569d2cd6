"""Monte Carlo as a picture: the share of plants that have settled, over time."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bender_report.picture_style import NARROW_IN, colours_for, dress, new_figure, to_png, write_key, write_title
from bender_tuner.model.monte_carlo import MonteCarloResult
from bender_tuner.task.contenders import Contender

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_monte_carlo(contenders: Sequence[Contender], duration_s: float) -> bytes:
    """Draw all contenders that went through Monte Carlo, the first one in front; returns a PNG file.

    Args:
        contenders: at least one with a result.
        duration_s: length of the runs.
    """
    return to_png(monte_carlo_figure(contenders, duration_s))


def monte_carlo_figure(contenders: Sequence[Contender], duration_s: float, narrow: bool = False) -> "Figure":
    """Return the same as a figure, on demand one for a phone."""
    run = [(contender, contender.monte_carlo) for contender in contenders if contender.monte_carlo is not None]
    colours = colours_for([contender.method for contender in contenders])
    times = np.linspace(0.0, duration_s, 801)
    figure = new_figure(NARROW_IN, 5.0) if narrow else new_figure(10.5, 4.2)
    axes = figure.subplots()
    for place, (contender, result) in enumerate(run):
        share = settled_share(settling_times_s(result), times)
        colour = colours[contender.method]
        axes.step(times, 100.0 * share, where="post", color=colour, lw=2.2 if place == 0 else 1.5, zorder=9 - place)
        if narrow:
            continue
        axes.annotate(
            f"{contender.label}\n{_in_words(result)}",
            (1.015, 0.99 - 0.2 * place),
            xycoords="axes fraction",
            color=colour,
            fontsize=8.5,
            va="top",
        )
    dress(axes, x_label="time since the step (s)", y_label="plants settled within 2 % (%)")
    axes.set_xlim(0.0, duration_s)
    axes.set_ylim(0.0, 102.0)
    write_title(figure, _finding(*run[0]), "each plant with its own gain, latency, parameters and noise")
    if narrow:
        write_key(figure, [(f"{c.label}: {_in_words(x).replace(chr(10), ', ')}", colours[c.method]) for c, x in run])
    return figure


def settling_times_s(result: MonteCarloResult) -> NDArray[np.float64]:
    """Settling times of all plants, inf for one that never settles or is unstable."""
    times = np.array([math.nan if o.unstable else o.metrics.settling_time_s for o in result.outcomes], dtype=float)
    return np.where(np.isnan(times), math.inf, times)


def settled_share(settling_times: NDArray[np.float64], times_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of runs that have settled by each time."""
    return np.searchsorted(np.sort(settling_times), times_s, side="right") / settling_times.size


def _finding(contender: Contender, result: MonteCarloResult) -> str:
    count = len(result.outcomes)
    stable = f"{result.unstable} of {count} plants unstable" if result.unstable else f"none of {count} plants unstable"
    return f"{contender.label}: {stable}, half of them settled after {np.median(settling_times_s(result)):.2f} s"


def _in_words(result: MonteCarloResult) -> str:
    unsettled = int(np.count_nonzero(np.isinf(settling_times_s(result)))) - result.unstable
    words = [f"{result.unstable} unstable"] if result.unstable else ["all stable"]
    words += [f"{unsettled} never within the band"] if unsettled else []
    return "\n".join(words)
