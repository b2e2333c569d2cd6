"""What rings from before a record: no command that might have been given before tells with what phase."""

import math
from dataclasses import replace

import numpy as np

from bender_inference.records.observations import Array, Observations
from bender_plant.blocks import bending_modes
from bender_plant.model import Model

RUNG_OUT = math.log(1e4)
"""Decay times until a ten-thousandth is left of what rang."""
MOST_LEFT_OUT = 0.2
"""Of a record, for what rings from before it."""


def first_resonance(model: Model) -> tuple[float, float] | None:
    """Return the frequency in Hz and the damping ratio of the first mode; None for a model that has no modes."""
    modes = _modes(model)
    return (modes[0][0] / (2.0 * math.pi), modes[0][1]) if modes else None


def _modes(model: Model) -> list[tuple[float, float]]:
    """Return the angular frequency in rad/s and the damping ratio of every mode."""
    for block in model.blocks:
        if block.id == bending_modes.ID:
            return [(x[0], x[1]) for x in bending_modes.constants(block.parameters, model.beam)]
    return []


def rung_out(seen: Observations, model: Model) -> Observations:
    """Return the observations of a record with no readings while the first mode of a model may ring from before."""
    modes = _modes(model)
    if not modes:
        return seen
    omega, damping_ratio = modes[0]
    since_s = seen.time_s - seen.time_s[0]
    rings_s = min(RUNG_OUT / (omega * damping_ratio), MOST_LEFT_OUT * float(since_s[-1]))
    heard = since_s >= rings_s
    return replace(seen, usable=seen.usable & heard, measured_um=np.where(heard, seen.measured_um, np.nan))


def free_ringing(model: Model, time_s: Array) -> Array:
    """Return what every mode of a model does freely from the first instant on, (n, 2 per mode): cosines and sines."""
    since_s = time_s - time_s[0]
    columns = []
    for omega, damping_ratio in _modes(model):
        decay = np.exp(-omega * damping_ratio * since_s)
        phase = omega * math.sqrt(1.0 - damping_ratio * damping_ratio) * since_s
        columns += [decay * np.cos(phase), decay * np.sin(phase)]
    return np.stack(columns, axis=1) if columns else np.empty((time_s.size, 0))
