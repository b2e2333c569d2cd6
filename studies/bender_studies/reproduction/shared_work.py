"""What several exhibits need, computed when the first one asks."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from bender_export.build import ensure_plant_fmu
from bender_identify.identification import identify
from bender_identify.identification_result import Identification
from bender_identify.records.experiment import experiment_of
from bender_identify.settings import Settings
from bender_loop.control.pid import Gains
from bender_loop.records.record import Record, read_record, write_record
from bender_loop.shell.files import prepare_directory
from bender_plant.model import Model, load_model
from bender_studies.demonstration.steps import measured_record
from bender_studies.reproduction.bench import Bench, open_bench
from bender_studies.reproduction.searches import Beetles, run_beetles
from bender_studies.reproduction.steps import (
    PaperLoop,
    Tuned,
    run_paper_loop,
    tune_for_the_bench,
    tune_for_the_high_step,
)


@dataclass(frozen=True, slots=True)
class Scale:
    """How much is done.

    Attributes:
        seeds: runs of each search.
        evaluations: of each search; the paper's 50 iterations are 151.
        nearest: evaluations of the search for gains that come near the paper's figures.
        sine_s: length of the recording that equation (30) is learned from.
        dwell_frames: how many frames a step of the staircase lasts.
        exact_s: length of the training record of Figure 4.
        noisy_s: length of its noisy training records.
    """

    seeds: int = 15
    evaluations: int = 151
    nearest: int = 400
    sine_s: float = 60.0
    dwell_frames: int = 10
    exact_s: float = 30.0
    noisy_s: float = 100.0


def sine_V(time_s: np.ndarray) -> np.ndarray:
    """The paper's identification input, 10 sin(pi t + 0.5) V."""
    return 10.0 * np.sin(np.pi * time_s + 0.5)


@dataclass(eq=False)
class SharedWork:
    """Shared work of one run.

    Attributes:
        out: the directory of the results; records go into its folder `records`.
        scale: how much is done.
        seed: of everything that is random.
        progress: told (done, total, remark) within a step.
    """

    out: Path
    scale: Scale = field(default_factory=Scale)
    seed: int = 0
    progress: Callable[[int, int | None, str], None] = lambda *_: None

    def rng(self, stream: int) -> np.random.Generator:
        """A generator of its own for each purpose, so that no exhibit depends on another."""
        return np.random.default_rng([self.seed, stream])

    @cached_property
    def paper_model(self) -> Model:
        """Equation (30) in series with the beam's first mode."""
        return load_model("paper")

    @cached_property
    def fmus(self) -> dict[str, Path]:
        """The plant FMUs by the names of their models, all built before any is opened."""
        return {name: ensure_plant_fmu(name) for name in ("paper", "bench")}

    @cached_property
    def bench(self) -> Bench:
        """What the paper's experiments run on."""
        return open_bench(self.fmus, self.rng(1), self.out)

    @cached_property
    def recording(self) -> Record:
        """The tip under the paper's sine, as a camera saw it."""
        return self.kept("sine.csv", self.bench.record_sine(sine_V, self.scale.sine_s))

    @cached_property
    def identification(self) -> Identification:
        """Equation (30) learned back from the recording, with its rivals."""
        settings = Settings(library="paper", ensemble=10, delay_s=self.bench.delay_s)
        experiment = experiment_of(self.recording, "the recording", settings, "smooth")
        return identify([experiment], self.paper_model, settings, self.rng(2))

    @cached_property
    def measured_path(self) -> Path | None:
        """The paper's own measurement, Figure 8, where it lies beside the checkout."""
        return measured_record()

    @cached_property
    def measured(self) -> Record | None:
        """The same, read."""
        return None if self.measured_path is None else read_record(self.measured_path)

    @cached_property
    def beetles(self) -> Beetles:
        """The searches on the paper's own task."""
        return run_beetles(self.fmus["paper"], self.scale.seeds, self.scale.evaluations, self.seed, self.progress)

    @cached_property
    def paper_loop(self) -> PaperLoop:
        """Ziegler and Nichols' rule on the paper's task, and gains that come near the printed steps."""
        return run_paper_loop(self.fmus["paper"], self.scale.nearest, self.rng(3))

    @cached_property
    def tuned(self) -> Tuned:
        """Our gains for the bench, and those that Ziegler and Nichols' rule gives there."""
        return tune_for_the_bench(self.fmus["bench"], self.scale.evaluations, self.seed)

    def tuned_at(self, setpoint_um: float) -> Gains:
        """Our gains for a higher step on the bench."""
        return tune_for_the_high_step(self.fmus["bench"], setpoint_um, self.scale.evaluations, self.seed)

    def kept(self, name: str, record: Record) -> Record:
        """Write a record beside the page; returns it."""
        write_record(prepare_directory(self.out / "records") / name, record)
        return record
