"""Tuning: gains of the PID block for the FMU of a model, or any FMU."""

import math
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bender_effects.rigs import learned_commands
from bender_loop.control.metrics import StepMetrics
from bender_loop.control.pid import Gains
from bender_loop.errors import InputError
from bender_loop.fmu.diagnosed import diagnosed
from bender_loop.tables.quantities import USUAL, of_input_and_output
from bender_report.wording import relabelled, shown_in
from bender_tuner.model.python_control import ControlSystems, to_control
from bender_tuner.results.summary import table_rows
from bender_tuner.results.tuning_file import FmuFacts, tuning_document
from bender_tuner.task.session import (
    Session,
    open_beside,
    open_guarded,
    open_rivals,
    pose_problem_in_units,
    run_session,
    write_results,
)
from bender_tuner.task.settings import TuneSettings, make_settings
from piezo_bender.diagnoses import as_saved
from piezo_bender.models import AnyModel, file_or_model, load_model
from piezo_bender.shared import (
    Progress,
    axes_or_new,
    frame_of,
    html_table,
    name_arguments_in_errors,
    options_as_arguments,
    require_text,
    shows_settings,
    silent,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame


_FIGURES = "objective", "rise_s", "settle_s", "over_%", "worst_Ms"


def _figure(cell: str | float | None) -> float:
    try:
        return math.nan if cell is None else float(cell)
    except ValueError:
        return math.inf if cell == "unstable" else math.nan


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TuningResult:
    """Gains, judged beside those of the rules.

    Attributes:
        session: the searches and the contenders, the asked method first.
        fmu: which FMU was tuned.
    """

    session: Session
    fmu: FmuFacts

    @property
    def gains(self) -> Gains:
        """The tuned gains."""
        found = self.session.contenders[0].gains
        if found is None:
            raise ValueError("a tuning without gains is no result")
        return found

    @property
    def metrics(self) -> StepMetrics | None:
        """Figures of the step response under the tuned gains; None where the plant failed under them."""
        judgement = self.session.contenders[0].judgement
        return None if judgement is None else judgement.metrics

    def save(self, folder: Path | str) -> Path:
        """Write gains.toml, tuning.json and the pictures into a directory; return the directory.

        Raises:
            InputError: they cannot be written.
        """
        from bender_loop.shell.files import prepare_directory

        out = prepare_directory(Path(folder))
        with shown_in(*self.fmu.units):
            write_results(self.session, self.fmu, out)
        return out

    def plot(self, axes: "Axes | None" = None) -> "Axes":
        """Draw the best value found over the evaluations of every search; return the axes drawn into."""
        drawn = axes_or_new(axes)
        for run in self.session.searches:
            drawn.plot(range(1, len(run.history) + 1), [x.best for x in run.history], label=run.method)
        drawn.set(
            xlabel="evaluations", ylabel=self.session.settings.objective, title=f"tuning of {self.fmu.model_name}"
        )
        if self.session.searches:
            drawn.legend(frameon=False)
        return drawn

    def to_control(self) -> ControlSystems:
        """Return plant (linear, at the set-point, with its latency), controller and `loop` for python-control.

        Raises:
            InputError: python-control is not installed.
        """
        return to_control(self.gains, self.session.problem.ensemble.nominal.delayed)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of tuning.json."""
        import json

        x = self.session
        text = tuning_document(
            x.problem,
            self.fmu,
            x.searches,
            x.contenders,
            x.rule,
            status=x.ended.value,
            reason=x.reason,
            model_following=x.recommendation,
        )
        return json.loads(text)

    def to_frame(self) -> "DataFrame":
        """Return one row for each set of gains (needs pandas); infinite where unstable, NaN where not reached.

        V and um in the names of the gains stand for the units of the plant.
        """
        columns, rows = table_rows(self.session.contenders)
        figures = {
            name: [_figure(row[k]) if name in _FIGURES else row[k] for row in rows] for k, name in enumerate(columns)
        }
        gains = {
            x.name: [math.nan if y.gains is None else getattr(y.gains, x.name) for y in self.session.contenders]
            for x in fields(Gains)
        }
        return frame_of(figures | gains)

    def __repr__(self) -> str:
        x, note = self.gains, options_as_arguments(self.session.following_note)
        with shown_in(*self.fmu.units):
            return relabelled(
                f"<TuningResult {self.session.settings.method}: Kp {x.proportional_V_per_um:.4g} V/µm, "
                f"Ki {x.integral_V_per_um_s:.4g} V/(µm s), Kd {x.derivative_V_s_per_um:.4g} V s/µm"
                f"{note and '; '}{note}>"
            )

    def _repr_html_(self) -> str:
        columns, rows = table_rows(self.session.contenders)
        with shown_in(*self.fmu.units):
            title = relabelled(f"step to {self.session.settings.setpoint_um:g} µm")
        return html_table(title, columns, rows)


@shows_settings(TuneSettings)
@name_arguments_in_errors
def tune(
    model: AnyModel | None = None,
    *,
    fmu: Path | str | None = None,
    input_name: str | None = None,
    output_name: str | None = None,
    units: str | None = None,
    follow_model: bool = False,
    progress: Progress = silent,
    **settings: Any,
) -> TuningResult:
    """Tune the PID block.

    Args:
        model: a built-in name, a model file, from `load_model`, or a result: a diagnosis also brings what its records
            leave open, as its saved model file does; paper where neither it nor an FMU is named.
        fmu: any co-simulation FMU (FMI 2.0 or 3.0) with one input and one output instead of a model.
        input_name: the FMU's input; None for the only one.
        output_name: its output; None for the only one.
        units: of both, where the FMU declares none, as "V,um" or "W,K"; every V and um then stands for these.
        follow_model: tune a model-following controller too.
        progress: is told what is being done.
        method: "reliable_bas", another search of `bender_tuner.optimisers.methods`, or a rule: "zn", "simc".
        objective: "practitioner" (bounds, then speed), "mse" (the paper's), "itae".
        setpoint_um: µm, 10; height of the step.
        rate_Hz: Hz, 30 (100 with "mse"); frames and commands per second.
        latency_frames: frames, 1 (0 with "mse"); age of a frame when the controller gets it.
        exposure_s: s, 0.015 at most (0 with "mse"); a frame shows the mean over this time.
        noise_um: µm, 0; standard deviation of the readings in the runs of the search.
        duration_s: s, 2, or 60 frames where that is longer; length of a run.
        lower_V: V, 0; smallest command. Of a model of another device than a piezo bender: that it was learned from.
        upper_V: V, 50; largest command. As above.
        slew_V_per_s: V/s, inf; fastest change of the command.
        evaluations: runs, 151; budget of each search.
        seed: 0; of searches, noise and plants drawn at random.
        monte_carlo: plants, 0; drawn at random for each set of gains.
        compare: none; further methods, each tuned with the same budget: "simc", or a list.
        max_ms: 1.7; bound of Ms over gain and latency; with "practitioner", as the next three.
        max_overshoot_percent: %, 2; bound of the overshoot.
        settle_within_s: s, None for any; bound of the settling time (2 %).
        max_noise_gain_V_per_um: V/µm, None for any; bound of the command's noise per noise of the reading.
        gain_error_percent: %, None for 30, or what the diagnosis of a followed model says; the device's gain may be off
            by so much either way.
        late_frames: frames, None for 1, or as above; a frame may come later than planned by so many.
        decades: 1.5; powers of ten below and above the first guess in which is searched.
        weights: none; of the objective "practitioner", as {"overshoot": 2.0}: bounds, effort, final_error, overshoot,
            worst_case.
        gain_bounds: none; as [("kp", 0.01, 1.0)]: a gain is searched between these.
        **settings: the keywords from `method` on, None for the default.

    Raises:
        InputError: both an FMU and a model are named, the FMU is not fit, or a setting is unknown or out of its range.
        RunError: the plant failed.
        KeyboardInterrupt: before there were gains.
    """
    if fmu is not None and model is not None:
        raise InputError("--fmu and --model both name a plant; give only one")
    given = {name: value for name, value in settings.items() if value is not None}
    wanted = make_settings(**(given if fmu is not None else _learned_limits(model) | given))
    with as_saved(model) as kept:
        return _tuned(kept, fmu, input_name, output_name, units, wanted, follow_model, progress)


def _learned_limits(model: AnyModel | None) -> dict[str, float]:
    """Return the range of commands that a model of another device was learned from; nothing for a piezo bender."""
    learned = None if model is None else learned_commands(load_model(model).model)
    return {} if learned is None else dict(zip(("lower_V", "upper_V"), learned, strict=True))


def _tuned(
    model: AnyModel | None,
    fmu: Path | str | None,
    input_name: str | None,
    output_name: str | None,
    units: str | None,
    wanted: TuneSettings,
    follow_model: bool,
    progress: Progress,
) -> TuningResult:
    path = _plant_fmu("paper" if model is None else model) if fmu is None else Path(fmu)

    def report(title: str, done: int, total: int, remark: str = "") -> None:
        progress(f"{title}, {done} of {total}{f', {remark}' if remark else ''}")

    require_text("units", units, "W,K")
    given = USUAL if units is None else of_input_and_output(units)
    told = diagnosed(fmu if model is None else model if isinstance(model, str | Path) else None)
    if fmu is None:
        told = told.with_fmus_of(_plant_fmu)
    foreign = fmu is not None
    opened = open_guarded(path, input_name, output_name, foreign=foreign, quantities=given, found=told)
    doubted = _lacking_fmus(model or fmu or "paper") if follow_model and not told.vouched_for else ()
    with (
        opened as (plant, facts),
        open_rivals(plant, facts, told.rivals, foreign=foreign) as rivals,
        open_beside(plant, facts, doubted, foreign=foreign) as lacking,
    ):
        problem = pose_problem_in_units(plant, wanted, facts, report, rivals)
        session = run_session(plant, facts, problem, report, follow_model=follow_model, doubted=lacking)
        return TuningResult(session, facts)


def _plant_fmu(model: AnyModel) -> Path:
    from bender_native.ready import ready_plant_fmu

    return ready_plant_fmu(file_or_model(model))


def _lacking_fmus(model: AnyModel) -> tuple[tuple[str, Path], ...]:
    from bender_native.lacking import lacking_fmus

    return lacking_fmus(file_or_model(model))
