"""Errors of the tip against the truth, case by case, for both methods."""

import time
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_emulator.microscope import Scene
from bender_studies.vision.cases import Case
from bender_vision import Tracker, TrackerSettings
from bender_vision.scale import Calibration

Values = NDArray[np.float64]

_TRAVEL_UM = 165.0
_FRAMES_PER_SCENE = 50
_REST_FRAMES = 10
_FAR_OFF_PX = 10.0


@dataclass(frozen=True, slots=True)
class Errors:
    """Errors of one method in one case, in pixels across the wire, the constant part included.

    Attributes:
        bias_px, rms_px, max_px: of the frames in which the tip was found and not far off.
        found, lost, far_off: numbers of frames; far off is an error of more than 10 px.
        median_ms, p99_ms: time for one frame, by the clock on the wall.
        p99_cpu_ms: of the processor, which other programs on the machine do not lengthen.
        reasons: why the tip was lost, and how often.
    """

    bias_px: float
    rms_px: float
    max_px: float
    found: int
    lost: int
    far_off: int
    median_ms: float
    p99_ms: float
    p99_cpu_ms: float
    reasons: Mapping[str, int]


def measure_case(case: Case, method: str, frames: int, seed: int) -> Errors:
    """Look for the tip in `frames` pictures of scenes of one case; equal seeds give equal pictures."""
    across: list[float] = []
    spent_s: list[tuple[float, float]] = []
    reasons: Counter[str] = Counter()
    settings = case.scene()
    exposure_s = 0.005
    velocity_um_per_s = case.smear_px * settings.um_per_px / exposure_s
    for tip_um, scene, tracker in _sights(case, method, frames, seed):
        image = scene.render(tip_um, velocity_um_per_s, exposure_s)
        start_s, start_cpu_s = time.perf_counter(), time.thread_time()
        tip = tracker.locate(image)
        spent_s.append((time.perf_counter() - start_s, time.thread_time() - start_cpu_s))
        if tip.lost is not None:
            reasons[tip.lost] += 1
            continue
        _, y = scene.tip_px(tip_um)
        across.append(tip.across_px - y)
    return _errors(np.array(across), np.array(spent_s), reasons)


def _sights(case: Case, method: str, frames: int, seed: int) -> Iterator[tuple[float, Scene, Tracker]]:
    """Where the tip is, in which scene, and who looks for it, `frames` times."""
    for start in range(0, frames, _FRAMES_PER_SCENE):
        scene, tips, tracker = _fresh(case, method, seed + start)
        for tip_um in tips[: frames - start]:
            yield float(tip_um), scene, tracker


def _fresh(case: Case, method: str, seed: int) -> tuple[Scene, Values, Tracker]:
    scene_rng, tip_rng = np.random.default_rng(seed).spawn(2)
    settings = case.scene()
    scene = Scene(settings, scene_rng)
    tracker = Tracker(TrackerSettings(method=method), Calibration.of_scale(settings.um_per_px))
    tracker.zero(scene.render(0.0) for _ in range(_REST_FRAMES))
    return scene, tip_rng.uniform(-_TRAVEL_UM, _TRAVEL_UM, _FRAMES_PER_SCENE), tracker


def _errors(across: Values, spent_s: Values, reasons: Counter[str]) -> Errors:
    near = np.abs(across) <= _FAR_OFF_PX
    bias, rms, worst = _three(across[near])
    return Errors(
        bias_px=bias,
        rms_px=rms,
        max_px=worst,
        found=len(across),
        lost=reasons.total(),
        far_off=int(np.count_nonzero(~near)),
        median_ms=float(1e3 * np.median(spent_s[:, 0])),
        p99_ms=float(1e3 * np.percentile(spent_s[:, 0], 99)),
        p99_cpu_ms=float(1e3 * np.percentile(spent_s[:, 1], 99)),
        reasons=dict(reasons),
    )


def _three(values: Values) -> tuple[float, float, float]:
    """Mean, root of the mean square, largest size; nan without values."""
    if not values.size:
        return float("nan"), float("nan"), float("nan")
    return float(values.mean()), float(np.sqrt(np.mean(values**2))), float(np.abs(values).max())
