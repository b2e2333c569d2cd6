"""Figure 4: the simulated Bouc-Wen model learned back, and what 2.74e-6 % is."""

import numpy as np

from bender_identify.fitting.resimulation import with_transducer
from bender_identify.paper.paper_sindy import Unseen, naive_cubic, paper_recipe, plain_sindy_on
from bender_identify.paper.simulated_bouc_wen import (
    ALPHA,
    BETA,
    DURATION_S,
    GAMMA,
    Errors,
    equation_29_percent,
    growing_tone,
    learn_bouc_wen,
    nothing_else,
    one_tone,
    simulated,
    three_tones,
    truth,
    two_tones,
)
from bender_identify.regression.plain_sindy import plain_sindy
from bender_identify.settings import LIBRARIES
from bender_loop.records.record import Record
from bender_plant.model import Model
from bender_report.page import Picture
from bender_report.picture_style import COLOURS, INK, MUTED, TUNED, dress, new_figure, to_png, write_title
from bender_studies.reproduction.exhibit import Exhibit, Row
from bender_studies.reproduction.printed import BOUC_WEN, SIMULATED_ERROR_PERCENT
from bender_studies.reproduction.shared_work import SharedWork

ROW_S, NOISY_ROW_S, NOISE_PERCENT = 1e-3, 1e-2, 1.0
PARAMETERS = {"u'": ("α", 1.0), "w |u'|": ("β", -1.0), "|w| u'": ("γ", -1.0)}
"""Symbol and sign of each term's coefficient."""


def show(shared: SharedWork) -> Exhibit:
    """The published recipe in both metrics, the polynomials, and ours."""
    recipe, values = paper_recipe()
    cubic, unseen = naive_cubic()
    ours, candidate = learn_bouc_wen(ROW_S, 0.0, shared.rng(10), duration_s=shared.scale.exact_s)
    noisy_inputs = (three_tones, growing_tone)
    noisy, _ = learn_bouc_wen(NOISY_ROW_S, NOISE_PERCENT, shared.rng(11), noisy_inputs, shared.scale.noisy_s)
    plain = plain_sindy_on(NOISY_ROW_S, NOISE_PERCENT, shared.rng(11), noisy_inputs, shared.scale.noisy_s)
    found = {c.name: c.value for c in candidate.coefficients}
    coefficients = [
        Row(symbol, "1/V" if "w" in term else "µm/V", BOUC_WEN[term], sign * float(value), sign * found.get(term, 0.0))
        for (term, (symbol, sign)), value in zip(PARAMETERS.items(), values, strict=True)
    ]
    model = with_transducer(
        nothing_else(), "sparse_equation", terms=LIBRARIES["bouc_wen"], coefficients=tuple(map(float, values))
    )
    return Exhibit(
        name="Figure 4",
        finding=f"2.74e-6 % is a ratio of squares: in the paper's metric (29) the same solution errs "
        f"{recipe.trained:.2g} %",
        paper_mode_is="the published recipe: 1000 rows over 30 s, second-order differences, PySINDy's defaults, "
        "coefficients copied with three decimals",
        ours_is="PySINDy proposes, simulation refines and decides; rows 1 ms apart",
        rows=[*_errors(recipe, cubic, ours), *coefficients, _as_printed(), _noise(plain, noisy)],
        picture=Picture(
            _draw(model, unseen),
            "Left the loop on the training input, right the answers to two tones that were not trained on",
        ),
        remarks=["That the printed number is the squared one is inferred: it agrees to all its digits, and the recipe "
                 "is the one that the method's authors published (Chandra et al. 2023)."],
    )  # fmt: skip


def _errors(recipe: Errors, cubic: Errors, ours: Errors) -> list[Row]:
    return [
        Row("relative error, mean squares", "%", SIMULATED_ERROR_PERCENT, recipe.squared, ours.squared,
            "mean squares: the printed error comes out when the mean squared error is divided by the mean square; "
            "(29) divides the norms and gives the next row"),
        Row("relative error by (29)", "%", None, recipe.trained, ours.trained),
        Row("by (29), two tones not trained on", "%", None, recipe.unseen, ours.unseen),
        Row("polynomials to degree 3, trained input", "%", None, cubic.trained, ours.trained),
        Row("polynomials to degree 3, two tones", "%", None, cubic.unseen, ours.unseen,
            "polynomials: on one sine 1, u² and u'² are exactly collinear: a library with polynomials meets the "
            "training input and nothing else"),
    ]  # fmt: skip


def _as_printed() -> Row:
    """What comes back from data of (20) as printed, whose last term lacks |w|."""
    model = with_transducer(
        nothing_else(), "bouc_wen", linear_gain_um_per_V=0.0, alpha_um_per_V=ALPHA, beta_1_per_V=BETA,
        gamma_1_per_V=GAMMA, printed=True,
    )  # fmt: skip
    time_s = np.linspace(0.0, DURATION_S, 10_001)
    record = Record(time_s, one_tone(time_s), simulated(model, one_tone, time_s))
    found = plain_sindy(("u'", "w |u'|"), [record])
    return Row(
        "α from data of (20) as printed", "µm/V", BOUC_WEN["u'"], float(found[0]), None,
        "(20) as printed lacks |w| in its last term, so α and γ multiply the same u' and only their difference can be "
        "learned: γ u' is corrected to γ u' |w|, which is what gives the printed error",
    )  # fmt: skip


def _noise(plain: float, noisy: Errors) -> Row:
    return Row(
        f"with {NOISE_PERCENT:g} % noise, rows {1e3 * NOISY_ROW_S:g} ms apart, two tones", "%", None, plain,
        noisy.unseen,
        "with noise: both trained on three tones and a growing one; the plain regression differentiates the noise",
    )  # fmt: skip


def _draw(learned: Model, cubic: Unseen) -> bytes:
    figure = new_figure(10.5, 4.2)
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.7))
    time_s = np.linspace(0.0, DURATION_S, 6001)
    u, w = one_tone(time_s), truth(one_tone, time_s)
    left.plot(u, w, color=INK, lw=3.0, label="Bouc-Wen model")
    left.plot(u, simulated(learned, one_tone, time_s), color=TUNED, lw=1.2, label="learned")
    dress(left, x_label="u (V)", y_label="w (µm)")
    left.legend(fontsize=8, frameon=False)
    unseen = simulated(learned, two_tones, cubic.time_s)
    right.plot(cubic.time_s, cubic.truth_um, color=INK, lw=3.0, label="Bouc-Wen model")
    right.plot(cubic.time_s, unseen, color=TUNED, lw=1.2, label="learned with its three terms")
    right.plot(cubic.time_s, cubic.simulated_um, color=COLOURS["zn"], lw=1.2, label="learned with all cubics")
    right.axhline(0.0, color=MUTED, lw=0.5)
    dress(right, x_label="time (s)", y_label="w (µm)")
    right.legend(fontsize=8, frameon=False, loc="upper right")
    error = equation_29_percent(cubic.truth_um, cubic.simulated_um)
    write_title(figure, f"On an input that was not trained on, the cubics err {error:.0f} %", "trained on u = sin t")
    return to_png(figure)
