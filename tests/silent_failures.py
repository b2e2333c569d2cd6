"""Silent failures: frames from which a wrong displacement is read without a word."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from mishaps import MISHAPS
from numpy.typing import NDArray

from bender_emulator.microscope import Scene, SceneSettings
from bender_loop.errors import RunError
from bender_vision import Tracker, TrackerSettings
from bender_vision.scale import Calibration

ALLOWED_PX = 0.5
_FRAMES_PER_SCENE = 60
_TRAVEL_UM = 120.0
_REST_FRAMES = 10


@dataclass(frozen=True, slots=True)
class Silent:
    """A frame that was read wrongly.

    Attributes:
        mishap: what was wrong with it.
        seed: of its scene.
        image: the frame.
        error_um: distance to the nearest right reading; inf where there is none.
        confidence: with which it was read.
    """

    mishap: str
    seed: int
    image: NDArray[np.uint8]
    error_um: float
    confidence: float


@dataclass(slots=True)
class Tally:
    """What became of the frames with one mishap."""

    frames: int = 0
    right: int = 0
    lost: int = 0
    silent: int = 0


def sum_of(tallies: Iterable[Tally]) -> Tally:
    """All tallies as one."""
    total = Tally()
    for one in tallies:
        total.frames += one.frames
        total.right += one.right
        total.lost += one.lost
        total.silent += one.silent
    return total


def count_silent_failures(
    frames: int, seed: int, method: str, progress: Callable[[int, int], None] | None = None
) -> tuple[dict[str, Tally], list[Silent]]:
    """Show `frames` frames, a tenth of them sound, the rest with every mishap in equal parts.

    Args:
        frames: how many.
        seed: equal seeds show equal frames.
        method: of the tracker.
        progress: told how many of how many are done.

    Returns:
        By mishap what became of its frames, and the frames that were read wrongly.
    """
    tallies = {name: Tally() for name in MISHAPS}
    silent: list[Silent] = []
    done, scene_seed = 0, seed
    names = list(MISHAPS)
    while done < frames:
        scene_seed += 1
        rng = np.random.default_rng(scene_seed)
        settings = any_scene(rng)
        scene = Scene(settings, rng)
        tracker = Tracker(TrackerSettings(method=method), Calibration.of_scale(settings.um_per_px))
        try:
            tracker.zero(scene.render(0.0) for _ in range(_REST_FRAMES))
        except RunError:
            continue
        for _ in range(min(_FRAMES_PER_SCENE, frames - done)):
            name = names[0] if rng.random() < 0.1 else names[int(rng.integers(1, len(names)))]
            image, right_um = MISHAPS[name](scene, float(rng.uniform(-_TRAVEL_UM, _TRAVEL_UM)), rng)
            error_um = _show(tracker, image, right_um, tallies[name], ALLOWED_PX * settings.um_per_px)
            if error_um is not None:
                silent.append(Silent(name, scene_seed, image, error_um, tracker.locate(image).confidence))
            done += 1
        if progress is not None:
            progress(done, frames)
    return tallies, silent


def _show(
    tracker: Tracker, image: NDArray[np.uint8], right_um: tuple[float, ...], tally: Tally, allowed_um: float
) -> float | None:
    """The error of a silent failure, or None."""
    tip = tracker.locate(image)
    tally.frames += 1
    if tip.lost is not None:
        tally.lost += 1
        return None
    error_um = min((abs(tip.displacement_um - one) for one in right_um), default=float("inf"))
    if error_um <= allowed_um:
        tally.right += 1
        return None
    tally.silent += 1
    return error_um


def any_scene(rng: np.random.Generator) -> SceneSettings:
    """A scene somewhere between the cases."""
    return SceneSettings(
        um_per_px=rng.uniform(1.0, 2.0),
        rest_x_px=rng.uniform(300.0, 480.0),
        rest_y_px=rng.uniform(180.0, 300.0),
        rest_angle_deg=rng.uniform(-5.0, 5.0),
        rotation_rad_per_um=rng.uniform(0.0, 6.4e-4),
        light_levels=rng.uniform(110.0, 225.0),
        light_slope=rng.uniform(0.0, 0.4),
        vignette=rng.uniform(0.0, 0.6),
        opacity=rng.uniform(0.5, 0.9),
        halo=rng.uniform(0.0, 0.1),
        glint=rng.uniform(0.0, 0.2),
        blur_px=rng.uniform(0.8, 3.0),
        noise_levels=rng.uniform(2.0, 7.0),
        dust=int(rng.integers(0, 20)),
        specks=int(rng.integers(0, 40)),
        fibres=int(rng.integers(0, 3)),
        jpeg_quality=int(rng.choice([0, 0, 90, 75])),
    )
