"""The linear plant by itself: its Bode diagram and its answer to a step, as one picture."""

import math

import numpy as np

from bender_report.picture_style import INK, TUNED, dress, new_figure, to_png, write_title
from bender_report.wording import quantity, relabelled
from bender_tuner.model.sampled_model import SampledModel

_POINTS = 1200
_DECADES = 4.0


def draw_plant(model: SampledModel, name: str, circumstances: str) -> bytes:
    """Draw gain, phase and step response of a plant, in the units that are shown; returns a PNG file.

    Args:
        model: of the plant.
        name: of the plant, for the title.
        circumstances: where the model holds, in small print.
    """
    figure = new_figure(10.5, 5.6)
    panels = figure.subplot_mosaic([["gain", "step"], ["phase", "step"]], width_ratios=(1.1, 1.0))
    highest = math.pi / model.period_s
    omega = np.geomspace(
        max(highest * 10.0**-_DECADES, highest / (4.0 * model.pulse_um_per_V.size)), 0.98 * highest, _POINTS
    )
    response, frequency_Hz = model.frequency_response(omega), omega / (2.0 * math.pi)
    phase_deg = np.degrees(np.unwrap(np.angle(response)))
    panels["gain"].loglog(frequency_Hz, np.abs(response), color=TUNED, lw=1.8)
    panels["phase"].semilogx(frequency_Hz, phase_deg, color=TUNED, lw=1.8)
    steps = model.step_response(model.pulse_um_per_V.size + 1)
    panels["step"].plot(model.period_s * np.arange(steps.size), steps, color=TUNED, lw=1.8)
    gain = model.dc_gain_um_per_V
    if math.isfinite(gain):
        panels["step"].axhline(gain, color=INK, lw=0.8, ls=(0, (4, 3)))
    dress(panels["gain"], y_label=relabelled("gain (µm/V)"))
    dress(panels["phase"], x_label="frequency (Hz)", y_label="phase (°)")
    dress(panels["step"], x_label="time (s)", y_label=relabelled("answer to a step of 1 V (µm)"))
    shown = f"{quantity(gain, 'um/V', 4)} at rest" if math.isfinite(gain) else "it does not come to rest"
    write_title(figure, relabelled(f"{name}: {shown}"), relabelled(circumstances))
    return to_png(figure)
