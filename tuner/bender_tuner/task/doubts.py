"""Devices without an effect that only a model has: following that model must do no harm on them.

A name that no diagnosis vouches for may be wrong. The feedforward compensates what is named, and on a device without it
that is an error of its own, which the block leads back after it has happened. So the loop is run on the same model
without the effect: up, down and up again, and along a sine that is known beforehand. It is compared with the PID block
alone. Between the frames, where a device may ring that the model does not let ring, it is compared with what is
followed on the model itself.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from bender_loop.control.pid import Gains
from bender_tuner.model.ensemble import Rival
from bender_tuner.task.experiment import Moves, StepExperiment, between_frames
from bender_tuner.task.following import Following

WORSE = 1.05
"""Times a figure of the PID block alone: what is more is harm."""


@dataclass(frozen=True, slots=True)
class Doubt:
    """A device without an effect.

    Attributes:
        name: of what it is without.
        experiment: a step on it.
        nominal: the step on the model itself.
        frequency_Hz: of the sine.
        alone: what becomes of moves there with the PID block alone.
        alone_sine_um: its rms from the sine.
    """

    name: str
    experiment: StepExperiment
    nominal: StepExperiment
    frequency_Hz: float
    alone: Moves
    alone_sine_um: float


def doubts_of(
    experiment: StepExperiment, devices: Sequence[Rival], gains: Gains, frequency_Hz: float
) -> tuple[Doubt, ...]:
    """Return the devices with what the PID block makes of them.

    Args:
        experiment: the nominal step.
        devices: named after what they are without.
        gains: of the block.
        frequency_Hz: of a sine that the loop follows.
    """
    latency = experiment.sampling.latency_frames
    runs = [(x.name, experiment.with_plant(x.plant, latency)) for x in devices]
    return tuple(
        Doubt(name, run, experiment, frequency_Hz, run.up_and_down(gains), run.known_sine_um(frequency_Hz, gains))
        for name, run in runs
    )


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
    found = doubt.experiment.up_and_down(gains, following)
    alone, block = doubt.alone, "of the PID block alone"
    compared = [
        ("an overshoot of", found.overshoot_percent, alone.overshoot_percent, overshoot_percent, "%", 1, block),
        ("a settling time of", found.settling_time_s, alone.settling_time_s, 0.0, "s", 2, block),
        ("an rms of", found.rms_um, alone.rms_um, 0.0, "µm", 3, block),
    ]
    if all(value <= max(allowed, WORSE * least) for _, value, least, allowed, *_ in compared):
        sine_um = doubt.experiment.known_sine_um(doubt.frequency_Hz, gains, following)
        swing, own = (between_frames(x).up_and_down(gains, following) for x in (doubt.experiment, doubt.nominal))
        compared = [
            ("from a known sine an rms of", sine_um, doubt.alone_sine_um, 0.0, "µm", 3, block),
            ("between the frames an overshoot of", swing.overshoot_percent, own.overshoot_percent, overshoot_percent,
             "%", 1, "on the model itself"),
        ]  # fmt: skip
    for what, value, least, allowed, unit, digits, whose in compared:
        if value > max(allowed, WORSE * least):
            return (
                f"on a device without {doubt.name}, for which no diagnosis vouches, it has {what} {value:.{digits}f} "
                f"{unit} against {least:.{digits}f} {unit} {whose}"
            )
    return ""
