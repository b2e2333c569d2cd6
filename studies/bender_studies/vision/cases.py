"""The conditions under which the tip's error is measured."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from bender_emulator.microscope import SceneSettings

CLEAN = "clean"


@dataclass(frozen=True, slots=True)
class Case:
    """One condition.

    Attributes:
        what: in a few words.
        changes: to the settings of the scene.
        smear_px: how far the tip moves during the exposure.
        limit_px: rms error that is allowed.
    """

    what: str
    changes: Mapping[str, float] = field(default_factory=dict)
    smear_px: float = 0.0
    limit_px: float = 0.10

    def scene(self) -> SceneSettings:
        """The settings of this case."""
        return SceneSettings.from_table(dict(self.changes))


CASES: Mapping[str, Case] = {
    CLEAN: Case("in focus, noise 3 levels", limit_px=0.05),
    "noise": Case("noise 8 levels", {"noise_levels": 8.0}),
    "defocus": Case("blur of 3.5 px", {"blur_px": 3.5}),
    "motion": Case("6 px of motion while the shutter is open", smear_px=6.0),
    "jpeg": Case("JPEG of quality 80", {"jpeg_quality": 80}),
    "dirt": Case(
        "dirt, dark corners, slanting light",
        {"dust": 25, "specks": 60, "fibres": 2, "vignette": 0.6, "light_slope": 0.4},
    ),
    "all": Case(
        "noise 6, blur 2.5 px, 4 px of motion, JPEG 80, dirt and dark corners",
        {
            "noise_levels": 6.0, "blur_px": 2.5, "jpeg_quality": 80,
            "dust": 25, "specks": 60, "fibres": 2, "vignette": 0.6, "light_slope": 0.4,
        },
        smear_px=4.0,
    ),
}  # fmt: skip
