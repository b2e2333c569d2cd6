"""The steps of the demonstration: each takes what it needs and returns what came of it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bender_export.build import checkout_folder, ensure_controller_fmu, ensure_plant_fmu
from bender_loop.errors import RunError
from bender_loop.records.compare import Comparison, compare
from bender_loop.records.record import Record, read_record, write_record
from bender_loop.records.replay import replay
from bender_loop.shell.files import write_atomically
from bender_report.chart import Chart
from bender_report.picture_style import in_both_widths
from bender_report.record_overlay import Overlay, draw_overlay, overlay_figure
from bender_studies.demonstration.pictures import draw_search_race, race_chart
from bender_tuner.task.problem import pose_problem
from bender_tuner.task.session import Session, hold_session, open_guarded
from bender_tuner.task.settings import TuneSettings, make_settings
from bender_tuner.task.tuning import Ended, SearchResult, run_search

PAPER_STEPS = {"BAS-PID": (0.88, 1.74, 0.0), "ZN-PID": (0.96, 3.82, 5.7)}
"""Rise time (s), settling time (s), overshoot (%) that the paper prints for its simulated loop, step of 10 um."""

RACERS = ("bas_printed", "bas", "reliable_bas")
MEASURED_RECORD = Path("shared") / "data" / "paper_fig8.csv"

_RECORD_RATE_HZ = 30.0
_TREAD_S = 0.4
_ACTUATOR_GAIN, _ACTUATOR_OFFSET_UM, _ACTUATOR_NOISE_UM = 0.93, 0.4, 0.15

Report = Callable[[int, int, str], None]
"""Called with (done, total, remark)."""


@dataclass(frozen=True, slots=True)
class Fmus:
    """The FMUs of the demonstration."""

    bench: Path
    paper: Path
    controller: Path


@dataclass(frozen=True, slots=True)
class Race:
    """Searches on the paper's own task: MSE of a step at 100 Hz, the same seeds for each method."""

    settings: TuneSettings
    runs: dict[str, tuple[SearchResult, ...]]
    picture: Chart

    def median_best(self, method: str) -> float:
        """Median over the seeds of the best value found."""
        return float(np.median([run.value for run in self.runs[method]]))


@dataclass(frozen=True, slots=True)
class Overlaid:
    """A model laid over a record.

    Attributes:
        record: its file.
        model: a built-in name.
        is_measured: the record comes from an actuator, not from here.
        quantum_um: smallest difference between two readings.
        comparison: the figures.
        picture: the overlay.
    """

    record: Path
    model: str
    is_measured: bool
    quantum_um: float
    comparison: Comparison
    picture: Chart


def build_fmus() -> Fmus:
    """Build what is missing or stale.

    All at once and first: an FMU that is open in this process brings its own copy of PythonFMU along.
    """
    return Fmus(ensure_plant_fmu("bench"), ensure_plant_fmu("paper"), ensure_controller_fmu())


def tune(fmus: Fmus, out: Path, *, evaluations: int, plants: int) -> Session:
    """`bender tune --model bench --monte-carlo` into `out`."""
    settings = make_settings(evaluations=evaluations, monte_carlo=plants)
    session = hold_session(fmus.bench, None, None, settings, out)
    if session.ended is Ended.INTERRUPTED:
        raise KeyboardInterrupt
    if session.ended is not Ended.COMPLETE:
        raise RunError(session.reason)
    return session


def race(fmus: Fmus, out: Path, *, seeds: Sequence[int], evaluations: int, report: Report) -> Race:
    """The beetle as printed, with its sign corrected, and ours, on the paper's model, objective and rate."""
    settings = make_settings(objective="mse", evaluations=evaluations)
    runs: dict[str, list[SearchResult]] = {method: [] for method in RACERS}
    total = len(RACERS) * len(seeds)
    with open_guarded(fmus.paper) as (plant, _):
        problem = pose_problem(plant, settings)
        for seed in seeds:
            for method in RACERS:
                runs[method].append(_completed(run_search(problem, method, seed=seed)))
                report(sum(map(len, runs.values())), total, method)
    finished = {method: tuple(found) for method, found in runs.items()}
    write_atomically(out / "race.png", draw_search_race(finished))
    return Race(settings, finished, race_chart(finished))


def overlay(fmus: Fmus, out: Path, *, seed: int) -> Overlaid:
    """The model over a record: the paper's own measurement where it lies beside the checkout, else one made here."""
    measured = measured_record()
    if measured is not None:
        return _overlaid(fmus.paper, measured, "paper", out, is_measured=True)
    path = out / "record.csv"
    write_record(path, emulated_record(fmus.bench, np.random.default_rng(seed)))
    return _overlaid(fmus.bench, path, "bench", out, is_measured=False)


def measured_record() -> Path | None:
    """The measurement of the paper's Fig. 8 in the folder beside the checkout; None where it is not there."""
    folder = checkout_folder()
    path = folder.parents[1] / MEASURED_RECORD if folder is not None else None
    return path if path is not None and path.is_file() else None


def emulated_record(fmu: Path, rng: np.random.Generator) -> Record:
    """A staircase 0 -> 50 -> 0 V through an FMU whose reading is off: gain x 0.93, offset 0.4 um, noise 0.15 um."""
    levels = [*np.arange(0.0, 50.0, 5.0), *np.arange(50.0, -1.0, -5.0)]
    voltage = np.repeat(levels, round(_TREAD_S * _RECORD_RATE_HZ))
    time = np.arange(voltage.size) / _RECORD_RATE_HZ
    still = Record(time, voltage, np.zeros_like(time))
    with open_guarded(fmu) as (plant, _):
        reading = replay(plant, still).simulated_um
    noisy = _ACTUATOR_GAIN * reading + _ACTUATOR_OFFSET_UM + rng.normal(0.0, _ACTUATOR_NOISE_UM, time.size)
    return Record(time, voltage, noisy)


def _overlaid(fmu: Path, path: Path, model: str, out: Path, *, is_measured: bool) -> Overlaid:
    record = read_record(path)
    with open_guarded(fmu) as (plant, _):
        replayed = replay(plant, record, untimed=is_measured)
    comparison = compare(record.displacement_um, replayed.simulated_um)
    drawing = Overlay(
        title=f"{path.name} over the model {model}",
        axis=np.arange(len(record), dtype=np.float64) if is_measured else record.time_s,
        axis_label="row" if is_measured else "time (s)",
        acting_V=replayed.acting_V,
        measured_um=record.displacement_um,
        simulated_um=replayed.simulated_um,
    )
    write_atomically(out / "overlay.png", draw_overlay(drawing, comparison))
    picture = in_both_widths(
        "overlay",
        "Measured and simulated displacement, and the residual",
        lambda narrow: overlay_figure(drawing, comparison, narrow),
    )
    levels = np.unique(np.round(record.displacement_um[np.isfinite(record.displacement_um)], 6))
    return Overlaid(path, model, is_measured, float(np.diff(levels).min()), comparison, picture)


def _completed(run: SearchResult) -> SearchResult:
    if run.ended is Ended.INTERRUPTED:
        raise KeyboardInterrupt
    if run.ended is Ended.FAILED:
        raise RunError(run.reason)
    return run
