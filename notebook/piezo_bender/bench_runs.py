"""A run on a bench: the PID block or a voltage profile, emulated unless a bench file is named."""

from argparse import Namespace
from collections.abc import Callable
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bender_hil.bench_file import emulated_bench, read_bench
from bender_hil.command import make_program
from bender_hil.log.ending import EndOfRun, conduct, count_swings, last_line
from bender_hil.log.figures import step_figures
from bender_hil.runner.run import RunResult
from bender_hil.runner.run import run as run_on_bench
from bender_hil.runner.run_lock import sole_run_with_note
from bender_loop.errors import InputError, RunError
from bender_loop.shell.files import finite
from bender_native.ready import ready_plant_fmu
from bender_tuner.results.gains_file import read_bench_gains
from piezo_bender.records import LoadedRecord, load_record
from piezo_bender.shared import Progress, html_table, kind_of, name_arguments_in_errors, silent

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame

    from bender_hil.runner.run import StopWish
    from bender_hil.runner.tip_camera import Sight

FRAMES_TOLD = 15


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class BenchRun:
    """A run that ended as planned or was ended, with the output off.

    Attributes:
        result: how it ended, its directory and its figures.
        record: what was commanded and read.
    """

    result: RunResult
    record: LoadedRecord

    @property
    def directory(self) -> Path:
        """Where the journals and the record are."""
        return self.result.directory

    def save(self, folder: Path | str) -> Path:
        """Copy the run, its journals and its record, into a directory; return the directory.

        Raises:
            InputError: the directory holds something already, or cannot be written.
        """
        import shutil

        out = Path(folder)
        if out.exists() and (not out.is_dir() or any(out.iterdir())):
            raise InputError(f"{out}: holds something already, expected a new directory for a run")
        try:
            shutil.copytree(self.directory, out, dirs_exist_ok=True)
        except OSError as error:
            raise InputError(f"{out}: cannot be written ({error.strerror or error}); choose another place") from error
        return out

    def plot(self, axes: "Axes | None" = None) -> "Axes":
        """Draw the readings, and the setpoint of a closed loop, over time; return the axes drawn into."""
        drawn = self.record.plot(axes)
        if self.record.record.setpoint_um is not None:
            drawn.step(self.record.time_s, self.record.record.setpoint_um, where="post", lw=1.0, label="setpoint")
            drawn.legend(frameon=False)
        return drawn

    def to_dict(self) -> dict[str, Any]:
        """Return the figures of the run, numbers that do not exist as None; `ended` is its last line."""
        ended = self.result.ended
        step = step_figures(self.record.record)
        said = conduct(self.result.summary, count_swings(self.result.log), step)
        line = last_line(said, EndOfRun(ended.code, ended.sentence, ended.alarm, self.result.signal))
        return finite({"ended": line, **asdict(self.result.summary)})

    def to_frame(self) -> "DataFrame":
        """Return the record (needs pandas)."""
        return self.record.to_frame()

    def __repr__(self) -> str:
        return f"<BenchRun {self.to_dict()['ended']}: {len(self.record)} rows in {self.directory}>"

    def _repr_html_(self) -> str:
        return html_table(f"run in {self.directory}", ("what", "found"), self.to_dict().items())


@name_arguments_in_errors
def run_bench(
    bench: Path | str | None = None,
    *,
    setpoint_um: float | None = None,
    profile: Path | str | None = None,
    duration_s: float | None = None,
    gains: Path | str | None = None,
    out: Path | str | None = None,
    progress: Progress = silent,
    stop: "StopWish | None" = None,
) -> BenchRun:
    """Run the PID block, or a voltage profile, on a bench.

    Args:
        bench: bench file; None for the emulated bench.
        setpoint_um: of the closed loop; None for the command line's default.
        profile: CSV with time_s and voltage_V or setpoint_um, or "staircase", "sine".
        duration_s: of the run; None for the profile's, or the command line's default.
        gains: gains.toml of a tuning; None for those of the bench.
        out: directory of the run; results/hil-DATE-TIME where None.
        progress: is told what the camera sees, twice a second.
        stop: who may say STOP to the guard; None for nobody.

    Raises:
        InputError: bad settings or files, no camera, another instrument at the address.
        RunError: no supply, no tip, or the run was ended before there was a record; the output is off.
        KeyboardInterrupt: by the user; the output is off.
    """
    if setpoint_um is not None and profile is not None:
        raise InputError("profile and setpoint_um name two programmes; give one of them")
    for name, given in {"profile": profile, "gains": gains}.items():
        if not isinstance(given, str | Path | None):
            raise InputError(f"{name}: found {kind_of(given)}, expected a file: save it and pass its path")
    wanted = emulated_bench() if bench is None else read_bench(Path(bench))
    words = Namespace(
        duration=duration_s,
        profile=None if profile is None else str(profile),
        setpoint=setpoint_um,
        gains=None if gains is None else Path(gains),
    )
    program = make_program(words, wanted, read_bench_gains)
    place = Path(out) if out is not None else Path("results") / f"hil-{datetime.now().astimezone():%Y%m%d-%H%M%S}"
    with sole_run_with_note(wanted.address, place, progress):
        result = run_on_bench(
            wanted,
            program,
            place,
            fmu=lambda model: ready_plant_fmu(model),
            witness=_progress_of_frames(progress),
            stop=stop,
        )
    if result.interrupted:
        raise KeyboardInterrupt
    if result.record is None:
        raise RunError(f"the run was ended before there was a record: {result.ended.sentence}")
    return BenchRun(result, load_record(result.record))


def _progress_of_frames(progress: Progress) -> "Callable[[Sight], None]":
    seen = 0

    def tell(sight: "Sight") -> None:
        nonlocal seen
        seen += 1
        if seen % FRAMES_TOLD == 0:
            progress("no tip" if sight.tip_um is None else f"frame {seen}, {sight.tip_um:.2f} µm")

    return tell
