"""Figure 9: the gains over the iterations of the search."""

import numpy as np

from bender_report.page import Picture
from bender_report.picture_style import COLOURS, MUTED, TUNED, dress, new_figure, to_png, write_title
from bender_studies.reproduction.exhibit import Exhibit, Row
from bender_studies.reproduction.printed import CONVERGED_ITERATIONS
from bender_studies.reproduction.searches import STILL, Beetle, Beetles
from bender_studies.reproduction.shared_work import SharedWork

GAINS = (("Kp", "V/µm"), ("Ki", "V/(µm s)"), ("Kd", "V s/µm"))
DRAWN = {
    "noise": (MUTED, "on nothing but noise"),
    "printed": (COLOURS["zn"], "as printed"),
    "turned": (COLOURS["simc"], "sign of (25) turned"),
    "ours": (TUNED, "ours, best so far"),
}
DECAY = 0.95
LINEAR_TO = (0.1, 0.1, 0.01)
"""Below this the axes are linear: as printed the gains may pass zero."""


def show(shared: SharedWork) -> Exhibit:
    """When the gains stand still, on the task and on noise, and how good they are then."""
    beetles, count = shared.beetles, shared.scale.seeds
    noise = beetles.still_after("noise")
    return Exhibit(
        name="Figure 9",
        finding=f"On nothing but noise the gains come to rest after {noise:.0f} iterations too: it is the schedule",
        paper_mode_is="Algorithm 1 as printed on the paper's task (10 µm, 100 Hz, 2 s, (28)), raw gains, "
        f"d₀ = δ₀ = 1; medians of {count} seeds",
        ours_is="reliable_bas on the same task, the same number of evaluations and seeds",
        rows=[*_iterations(beetles), *_errors(beetles), *_gains(beetles)],
        picture=Picture(_draw(beetles), "The three gains over the iterations, for four searches of one seed"),
    )  # fmt: skip


def _iterations(beetles: Beetles) -> list[Row]:
    left_percent = 100.0 * DECAY ** float(CONVERGED_ITERATIONS.text)
    return [
        Row("iterations until the gains stand still", "", CONVERGED_ITERATIONS, beetles.still_after("printed"),
            beetles.still_after("ours"),
            f"stand still: all three within {100 * STILL:.0f} % of their travel from where they end. As printed the "
            "beetle climbs within a few steps onto the plateau of loops that fail, where sign(0) = 0 holds it"),
        Row("the same, sign of (25) turned", "", None, beetles.still_after("turned"), None),
        Row("the same, on nothing but noise", "", None, beetles.still_after("noise"), None,
            "on nothing but noise: δ of (27) shrinks by 5 % each time whatever is found, so the gains come to rest by "
            "the schedule; that is no sign of an optimum"),
        Row("travel left after 30 iterations", "%", None, left_percent, None,
            "travel left: the part of all steps δ that is still to come, from (27) alone"),
    ]  # fmt: skip


def _errors(beetles: Beetles) -> list[Row]:
    return [
        Row("mean squared error (28) in the end", "µm²", None, beetles.median_mse_um2("printed"),
            beetles.median_mse_um2("ours"),
            "mean squared error: (25) steps towards the antenna with the larger error while Algorithm 1 keeps the "
            "smaller one; what it keeps is about where it began"),
        Row("the same, sign of (25) turned", "µm²", None, beetles.median_mse_um2("turned"), None,
            "sign of (25) turned: still in raw gains that lie decades apart, with one step for all"),
    ]  # fmt: skip


def _gains(beetles: Beetles) -> list[Row]:
    ends = {kind: np.median([b.places[-1] for b in beetles.runs[kind]], axis=0) for kind in ("turned", "ours")}
    return [
        Row(f"{symbol} in the end, sign turned", unit, None, float(ends["turned"][k]), float(ends["ours"][k]))
        for k, (symbol, unit) in enumerate(GAINS)
    ]


def _draw(beetles: Beetles) -> bytes:
    figure = new_figure(10.5, 3.8)
    panels = figure.subplots(1, len(GAINS))
    for k, (axes, (symbol, unit)) in enumerate(zip(panels, GAINS, strict=True)):
        axes.set_yscale("symlog", linthresh=LINEAR_TO[k])
        for kind, (colour, name) in DRAWN.items():
            places = _chosen(beetles, kind).places[:, k]
            axes.plot(np.arange(places.size), places, color=colour, lw=1.8, label=name)
        axes.axvline(float(CONVERGED_ITERATIONS.text), color=MUTED, lw=0.9, ls=(0, (1, 2)))
        dress(axes, x_label="iteration", y_label=f"{symbol} ({unit})")
    panels[0].legend(fontsize=7.5, frameon=False)
    write_title(figure, "The schedule, not the task, brings the gains to rest", "dotted: 30 iterations, as printed")
    return to_png(figure)


def _chosen(beetles: Beetles, kind: str) -> Beetle:
    return beetles.runs[kind][0] if kind == "noise" else beetles.typical(kind)
