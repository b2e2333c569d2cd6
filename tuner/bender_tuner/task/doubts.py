"""Devices without an effect that only a model has: following that model must do no harm on them.

A name that no diagnosis vouches for may be wrong. The feedforward compensates what is named, and on a device without it
that is an error of its own, which the block leads back after it has happened. So the loop is run on the same model
without the effect, up, down and up again, and compared with the PID block alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from bender_loop.control.pid import Gains
from bender_tuner.model.ensemble import Rival
from bender_tuner.task.experiment import Moves, StepExperiment
from bender_tuner.task.following import Following

WORSE = 1.05
"""Times a figure of the PID block alone: what is more is harm."""


@dataclass(frozen=True, slots=True)
class Doubt:
    """A device without an effect.

    Attributes:
        name: of what it is without.
        experiment: a step on it.
        alone: what becomes of moves there with the PID block alone.
    """

    name: str
    experiment: StepExperiment
    alone: Moves


def doubts_of(experiment: StepExperiment, devices: Sequence[Rival], gains: Gains) -> tuple[Doubt, ...]:
    """Return the devices with what the PID block makes of them.

    Args:
        experiment: the nominal step.
        devices: named after what they are without.
        gains: of the block.
    """
    latency = experiment.sampling.latency_frames
    runs = [(x.name, experiment.with_plant(x.plant, latency)) for x in devices]
    return tuple(Doubt(name, run, run.up_and_down(gains)) for name, run in runs)


def harm(doubts: Sequence[Doubt], gains: Gains, following: Following, overshoot_percent: float) -> str:
    """Return what following does to the first device that it harms, in words; empty where it harms none.

    Args:
        doubts: the devices.
        gains: of the block.
        following: what is followed.
        overshoot_percent: so much is allowed on any device.
    """
    return next((x for doubt in doubts if (x := _harm(doubt, gains, following, overshoot_percent))), "")


def _harm(doubt: Doubt, gains: Gains, following: Following, overshoot_percent: float) -> str:
    alone, found = doubt.alone, doubt.experiment.up_and_down(gains, following)
    for what, value, least, unit, digits in (
        ("an overshoot of", found.overshoot_percent, max(overshoot_percent, WORSE * alone.overshoot_percent), "%", 1),
        ("a settling time of", found.settling_time_s, WORSE * alone.settling_time_s, "s", 2),
        ("an rms of", found.rms_um, WORSE * alone.rms_um, "µm", 3),
    ):
        if value > least:
            compared = {"%": alone.overshoot_percent, "s": alone.settling_time_s, "µm": alone.rms_um}[unit]
            return (
                f"on a device without {doubt.name}, for which no diagnosis vouches, it has {what} {value:.{digits}f} "
                f"{unit} against {compared:.{digits}f} {unit} of the PID block alone"
            )
    return ""
