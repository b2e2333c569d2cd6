"""The run that an objective judges: a step of the setpoint in the closed loop."""

import math
from dataclasses import dataclass, replace

import numpy as np

from bender_loop.control.closed_loop import simulate
from bender_loop.control.metrics import StepMetrics, step_metrics
from bender_loop.control.pid import Gains, Limits
from bender_loop.control.plant import Plant
from bender_loop.control.references import Step
from bender_loop.control.sampling import Sampling
from bender_loop.control.trace import Trace
from bender_loop.fmu.followed_model import Loop, run_following
from bender_tuner.task.following import Following


@dataclass(frozen=True, slots=True)
class StepExperiment:
    """A step from rest to `setpoint_um`, run anew for every set of gains.

    Attributes:
        plant: reset before each run.
        limits: of the command.
        setpoint_um: level of the step.
        sampling: what the controller sees; with more than one substep the time between the frames is judged too.
        duration_s: length of a run.
        seed: of the noise, the same in every run, so that an objective stays a function of the gains.
        slew_V_per_s: bound of the command's rate, inf for none.
        believed_latency_frames: that a model-following controller reckons with; None for that of `sampling`.

    Raises:
        ValueError: the setpoint is zero or not finite, or the duration is shorter than a period.
    """

    plant: Plant
    limits: Limits
    setpoint_um: float
    sampling: Sampling
    duration_s: float
    seed: int = 0
    slew_V_per_s: float = math.inf
    believed_latency_frames: int | None = None

    def __post_init__(self) -> None:
        if not math.isfinite(self.setpoint_um) or self.setpoint_um == 0.0:
            raise ValueError(f"setpoint_um must be a finite number other than 0, found {self.setpoint_um!r}")
        self.sampling.ticks(self.duration_s)

    def run(self, gains: Gains, following: Following | None = None) -> Trace:
        """The step response with `gains`, of the PID block alone or in a model-following controller."""
        rng = np.random.default_rng(self.seed)
        reference = Step(self.setpoint_um)
        if following is not None:
            latency, sampling = self.believed_latency_frames, self.sampling
            loop = Loop(
                sampling.period_s,
                self.limits,
                self.slew_V_per_s,
                sampling.latency_frames if latency is None else latency,
                tuple(sampling.exposure_weights().tolist()),
            )
            return run_following(
                self.plant, following.model, following.fmu, gains, loop, reference, sampling, self.duration_s, rng
            )
        return simulate(
            self.plant,
            gains,
            self.limits,
            reference,
            self.sampling,
            self.duration_s,
            rng,
            slew_V_per_s=self.slew_V_per_s,
        )

    def metrics(self, trace: Trace) -> StepMetrics:
        """Figures of a trace of this experiment, between the frames too where the trace shows it."""
        return step_metrics(trace, self.setpoint_um, intersample=self.sampling.substeps > 1)

    def with_plant(self, plant: Plant, latency_frames: int) -> "StepExperiment":
        """The same step on another plant and with another latency, of which a controller knows nothing."""
        return replace(
            self,
            plant=plant,
            sampling=replace(self.sampling, latency_frames=latency_frames),
            believed_latency_frames=self.sampling.latency_frames,
        )
