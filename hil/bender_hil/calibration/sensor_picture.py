"""The picture of a sensor's calibration: points on the curve, and how far they lie beside it.

Whoever sees the points bend away from the line knows that it wants another degree.
"""

from collections.abc import Sequence

import numpy as np

from bender_hil.calibration.sensor_scale import SensorCalibration
from bender_report.picture_style import GRID, INK, MUTED, TUNED, dress, new_figure, to_png, write_title

_WIDTH_IN, _HEIGHT_IN = 7.0, 5.2
_PLACES = 200
_SURE = 2.0
"""Standard uncertainties on either side that are drawn."""


def sensor_picture(fit: SensorCalibration, readings: Sequence[float], displacements_um: Sequence[float]) -> bytes:
    """Return a PNG of the points with the curve, and of what lies between them, in µm."""
    places = np.linspace(fit.low, fit.high, _PLACES)
    curve_um = [fit.to_um(x) for x in places]
    beside_um = [y - fit.to_um(x) for x, y in zip(readings, displacements_um, strict=True)]
    sure_um = _SURE * np.array([fit.uncertainty_um(x) for x in places])
    figure = new_figure(_WIDTH_IN, _HEIGHT_IN)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.0))
    above.plot(places, curve_um, color=TUNED, lw=1.6)
    above.plot(readings, displacements_um, "o", color=INK, ms=4)
    below.fill_between(places, -sure_um, sure_um, color=GRID, lw=0.0)
    below.axhline(0.0, color=MUTED, lw=0.9)
    below.plot(readings, beside_um, "o", color=INK, ms=4)
    dress(above, y_label="displacement (µm)")
    dress(below, x_label=f"reading ({fit.unit})", y_label="point − curve (µm)")
    degree = len(fit.coefficients_um) - 1
    form = "line" if degree == 1 else f"curve of degree {degree}"
    write_title(
        figure,
        f"{fit.points} points lie {fit.residual_um:.3g} µm rms beside a {form}",
        f"grey: ± {_SURE:g} standard uncertainties of the curve",
    )
    return to_png(figure)
