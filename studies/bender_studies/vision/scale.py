"""Error of the scale that is found from drawn pictures of a stage micrometer."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bender_emulator.microscope import Scene, SceneSettings
from bender_emulator.microscope.micrometer import render_micrometer
from bender_hil.calibration.fit import fit_ruler
from bender_hil.calibration.fringes import find_fringes

ALLOWED_PERCENT = 0.05
_PITCH_UM = 10.0

SCALE_CASES: Mapping[str, Mapping[str, float]] = {
    "1.0 um/px": {"um_per_px": 1.0},
    "1.5 um/px": {"um_per_px": 1.5},
    "2.0 um/px": {"um_per_px": 2.0},
    "distortion 1 %": {"distortion": 0.01},
    "distortion -3 %": {"distortion": -0.03},
    "noise 8, blur 2 px, dirt": {"noise_levels": 8.0, "blur_px": 2.0, "dust": 25, "specks": 60, "fibres": 2},
}


@dataclass(frozen=True, slots=True)
class ScaleErrors:
    """Errors of the scale, percent, and of the distortion, percent at the corner.

    Attributes:
        rms_percent, max_percent: of the scale.
        claimed_percent: mean standard uncertainty that the calibration gives.
        distortion_max_percent: of the distortion.
    """

    rms_percent: float
    max_percent: float
    claimed_percent: float
    distortion_max_percent: float


def measure_scale(changes: Mapping[str, float], rulers: int, seed: int) -> ScaleErrors:
    """Calibrate with one picture of each of `rulers` rulers, at any angle and off the middle."""
    errors, claimed, distortions = [], [], []
    for index in range(rulers):
        rng = np.random.default_rng([seed, index])
        # a scale that is no round number: its lines meet the pixels in every phase
        settings = SceneSettings.from_table(
            {**changes, "um_per_px": changes.get("um_per_px", 1.5) * rng.uniform(0.97, 1.03)}
        )
        offset_um = float(rng.uniform(-60.0, 60.0)), float(rng.uniform(-40.0, 40.0))
        picture = render_micrometer(
            Scene(settings, rng), pitch_um=_PITCH_UM, angle_deg=float(rng.uniform(-90.0, 90.0)), offset_um=offset_um
        )
        found = fit_ruler([find_fringes(picture, "ruler")], _PITCH_UM, 0.0, "drawn").calibration
        errors.append(100.0 * (found.um_per_px / settings.um_per_px - 1.0))
        claimed.append(100.0 * found.uncertainty / found.um_per_px)
        distortions.append(100.0 * (found.distortion - settings.distortion))
    return ScaleErrors(
        float(np.sqrt(np.mean(np.square(errors)))),
        float(np.abs(errors).max()),
        float(np.mean(claimed)),
        float(np.abs(distortions).max()),
    )
