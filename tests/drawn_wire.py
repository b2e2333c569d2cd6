"""A wire's tip drawn by an oracle that shares nothing with the emulated microscope, and a tracker for its pictures."""

import math

import numpy as np

from bender_vision import Tracker, TrackerSettings
from bender_vision.scale import Calibration

SCALE = 1.5
HEIGHT, WIDTH = 240, 320
FINER = 8


def draw(tip_x: float, tip_y: float, angle: float, *, width_px: float = 10.0, blur_px: float = 1.2) -> np.ndarray:
    """A dark half strip, drawn in squares of 1/8 px, summed into pixels and blurred by a sampled Gaussian."""
    y, x = (np.indices((HEIGHT * FINER, WIDTH * FINER), dtype=np.float32) + 0.5) / FINER - 0.5
    x -= np.float32(tip_x)
    y -= np.float32(tip_y)
    along, across = x * math.cos(angle) + y * math.sin(angle), y * math.cos(angle) - x * math.sin(angle)
    inside = np.clip(0.5 + FINER * (width_px / 2 - np.abs(across)), 0, 1) * np.clip(0.5 - FINER * along, 0, 1)
    share = inside.reshape(HEIGHT, FINER, WIDTH, FINER).mean(axis=(1, 3))
    reach = math.ceil(5 * blur_px)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / blur_px) ** 2)
    kernel /= kernel.sum()
    padded = np.pad(share, reach, mode="edge")
    rows = np.sum([weight * padded[index : index + HEIGHT] for index, weight in enumerate(kernel)], axis=0)
    blurred = np.sum([weight * rows[:, index : index + WIDTH] for index, weight in enumerate(kernel)], axis=0)
    return 190.0 - 130.0 * blurred


def picture(levels: np.ndarray, rng: np.random.Generator, noise: float = 2.0) -> np.ndarray:
    return np.clip(np.rint(levels + rng.normal(0.0, noise, levels.shape)), 0, 255).astype(np.uint8)


def tracker(**changes: object) -> Tracker:
    return Tracker(TrackerSettings(**changes), Calibration.of_scale(SCALE, WIDTH, HEIGHT))  # pyright: ignore[reportArgumentType]
