"""A closed loop in simulation: any gains, any reference, on a model or any FMU."""

import math
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bender_loop.control.closed_loop import simulate
from bender_loop.control.metrics import SETTLING_BAND, has_settled, step_metrics
from bender_loop.control.pid import Gains, Limits
from bender_loop.control.references import Profile, Reference, Step, profile_from_columns, read_profile
from bender_loop.control.trace import Trace
from bender_loop.errors import InputError
from bender_loop.fmu.diagnosed import diagnosed
from bender_loop.fmu.followed_model import FollowedModel, Loop, run_following
from bender_loop.tables.quantities import MICROMETRE, USUAL, VOLT, of_input_and_output
from bender_report.palette import light
from bender_report.wording import axis_text, relabelled, shown_in
from bender_tuner.results.gains_file import read_controller, require_units
from bender_tuner.results.summary import camera_words
from bender_tuner.task.experiment import seen_between_frames
from bender_tuner.task.session import open_guarded
from bender_tuner.task.settings import TuneSettings, make_settings
from piezo_bender.models import AnyModel, file_or_model
from piezo_bender.shared import (
    axes_or_new,
    frame_of,
    html_table,
    is_table,
    kind_of,
    name_arguments_in_errors,
    require_text,
    shows_settings,
)
from piezo_bender.tunings import TuningResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame

_FRAMES_OF_A_STEP, _FRAMES_AFTER = 150, 60
"""How long a step is seen, and a profile behind its last set-point."""
_STEP_UM = 10.0


@dataclass(frozen=True, slots=True)
class StepSeen:
    """One step of a reference, as the tip took it.

    Attributes:
        time_s: of the step.
        from_um: set-point before it.
        to_um: set-point after it.
        seen_s: until the next step, or the end of the run.
        overshoot_percent: of the step, between the frames too.
        settling_time_s: to 2 % of the step, between the frames too; NaN where it does not settle while seen.
        rms_um: from the set-point at the frames, the way there included.
    """

    time_s: float
    from_um: float
    to_um: float
    seen_s: float
    overshoot_percent: float
    settling_time_s: float
    rms_um: float


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LoopSimulation:
    """A run of the loop.

    Attributes:
        subject: the plant, in words.
        controller: what ran, in words.
        trace: the run.
        steps: of the reference, where it has a few.
        units: of command and reading, "V" and "um" unless the FMU declares others.
        remark: why another controller runs than was asked for; empty where it is the same.
        camera: how the loop sees the plant, in words.
    """

    subject: str
    controller: str
    trace: Trace
    steps: tuple[StepSeen, ...]
    units: tuple[str, str] = (VOLT, MICROMETRE)
    remark: str = ""
    camera: str = ""

    @property
    def time_s(self) -> NDArray[np.float64]:
        """(n,) instants of the frames."""
        return self.trace.time_s

    @property
    def displacement_um(self) -> NDArray[np.float64]:
        """(n,) the true displacement there."""
        return self.trace.displacement_um

    @property
    def rms_um(self) -> float:
        """Of the true displacement from the set-point, at the frames."""
        return float(np.sqrt(np.mean((self.trace.setpoint_um - self.trace.displacement_um) ** 2)))

    def to_dict(self) -> dict[str, Any]:
        """Return the figures."""
        trace = self.trace
        return {
            "subject": self.subject,
            "controller": self.controller,
            "units": list(self.units),
            "diverged": trace.diverged,
            "rms_um": self.rms_um,
            "largest_error_um": float(np.abs(trace.setpoint_um - trace.displacement_um).max()),
            "largest_command_V": float(np.abs(trace.voltage_V).max()),
            "steps": [
                asdict(x) | {"settling_time_s": None if math.isnan(x.settling_time_s) else x.settling_time_s}
                for x in self.steps
            ],
        }

    def to_frame(self) -> "DataFrame":
        """Return one row for each frame (needs pandas)."""
        x = self.trace
        return frame_of(
            {
                "time_s": x.time_s,
                "setpoint_um": x.setpoint_um,
                "measured_um": x.measured_um,
                "displacement_um": x.displacement_um,
                "voltage_V": x.voltage_V,
            }
        )

    def picture(self) -> bytes:
        """Return set-point, tip and command over time as PNG."""
        from bender_report.picture_style import INK, TUNED, dress, new_figure, to_png, write_title

        figure = new_figure(10.5, 5.6)
        tip, volts = figure.subplots(2, 1, sharex=True, height_ratios=[2, 1])
        x = self.trace
        tip.step(x.time_s, x.setpoint_um, where="post", color=INK, lw=0.9, ls=(0, (4, 3)))
        fine = x.fine_time_s is not None and x.fine_displacement_um is not None
        tip.plot(*((x.fine_time_s, x.fine_displacement_um) if fine else (x.time_s, x.displacement_um)), color=TUNED)
        volts.step(x.time_s, x.voltage_V, where="post", color=TUNED, lw=1.4)
        dress(tip, y_label=self._in_own_units("displacement (µm)", axis_text))
        dress(volts, x_label="time (s)", y_label=self._in_own_units("command (V)"))
        tip.margins(x=0)
        title = f"{self.controller}: {self._in_own_units(self._rms)} from the set-point"
        write_title(figure, title, f"{self.subject}, dashed: the set-point")
        return to_png(figure)

    def save(self, folder: Path | str) -> Path:
        """Write loop.json, loop.csv and loop.png into a directory; return the directory.

        Raises:
            InputError: they cannot be written.
        """
        from bender_loop.records.record import write_record
        from bender_loop.shell.files import prepare_directory, write_atomically, write_result

        picture = self.picture()
        out = prepare_directory(Path(folder))
        write_result(out / "loop.json", self.to_dict())
        write_record(out / "loop.csv", self.trace.to_record())
        write_atomically(out / "loop.png", picture)
        return out

    def plot(self, axes: "Axes | None" = None, label: str = "") -> "Axes":
        """Draw set-point and displacement over time; return the axes drawn into.

        Args:
            axes: to draw into; None for new ones. Those that have lines get no second set-point.
            label: of this loop; its controller unless given.
        """
        drawn, x = axes_or_new(axes), self.trace
        if not drawn.lines:
            drawn.step(x.time_s, x.setpoint_um, where="post", lw=1.0, ls="--", color=light("muted"), label="set-point")
        drawn.plot(x.time_s, x.displacement_um, lw=1.4, label=label or self.controller)
        drawn.set(xlabel="time (s)", ylabel=self._in_own_units("displacement (µm)", axis_text), title=self.subject)
        drawn.legend(frameon=False)
        return drawn

    def __repr__(self) -> str:
        told = f"{self.controller} on {self.subject}: {self._in_own_units(self._rms)}"
        return f"<LoopSimulation {told}{self.remark and '; '}{self.remark}>"

    @property
    def _rms(self) -> str:
        return f"{self.rms_um:.3g} µm rms"

    def _in_own_units(self, text: str, label: Callable[[str], str] = relabelled) -> str:
        with shown_in(*self.units):
            return label(text)

    def _repr_html_(self) -> str:
        columns, rows = figures_table(self)
        return html_table(f"{self.controller} on {self.subject}{self.remark and ': '}{self.remark}", columns, rows)


def figures_table(found: LoopSimulation) -> tuple[list[str], list[list[str | float]]]:
    """Return (columns, rows): one row for each step, then the whole run."""
    rows: list[list[str | float]] = []
    unit = "µm" if found.units[1] == MICROMETRE else found.units[1]
    for x in found.steps:
        settled = not math.isnan(x.settling_time_s) and has_settled(x.settling_time_s, x.seen_s)
        settling = round(x.settling_time_s, 3) if settled else f"not within {x.seen_s:.3g} s"
        where = f"step at {x.time_s:g} s, {x.from_um:.6g} to {x.to_um:.6g} {unit}"
        rows.append([where, settling, round(x.overshoot_percent, 2), round(x.rms_um, 4)])
    columns = ["reference", "settle_s", "over_%", "rms_um" if unit == "µm" else f"rms_{unit}"]
    return columns, [*rows, [f"whole run, {found.time_s[-1]:.4g} s", "", "", round(found.rms_um, 4)]]


def how_seen(found: LoopSimulation) -> str:
    """Return how the figures were made, beside which those of a tuning stand, in a sentence."""
    camera = found._in_own_units(found.camera)
    return (
        f"loop: {camera}; settling and overshoot between the frames too, rms at the frames of the whole time. "
        "`bender tune` has its own --noise, --latency and --duration: with the same its step is this one"
    )


LOOP_SETTINGS = "rate_Hz", "latency_frames", "exposure_s", "noise_um", "lower_V", "upper_V", "slew_V_per_s", "seed"
"""Of `TuneSettings`: what a loop is run with."""


@shows_settings(TuneSettings, LOOP_SETTINGS)
@name_arguments_in_errors
def simulate_loop(
    gains: Path | str | Gains | Mapping[str, float] | TuningResult,
    model: AnyModel | None = None,
    *,
    fmu: Path | str | None = None,
    profile: "Path | str | Reference | Mapping[str, ArrayLike] | DataFrame | None" = None,
    setpoint_um: float | None = None,
    duration_s: float | None = None,
    input_name: str | None = None,
    output_name: str | None = None,
    units: str | None = None,
    parameters: dict[str, float] | None = None,
    follow_model: bool = True,
    preview: bool = False,
    **settings: Any,
) -> LoopSimulation:
    """Run a closed loop in simulation.

    Args:
        gains: a gains file, `Gains`, a dict with kp, ki and kd (V/µm, V/(µm s), V s/µm), or the result of `tune`,
            which brings the settings that it was tuned with.
        model: a built-in name, a model file, or from `load_model`; paper where neither it nor an FMU is named.
        fmu: any co-simulation FMU (FMI 2.0 or 3.0) with one input and one output instead of a model.
        profile: a CSV file, DataFrame or mapping with time_s and setpoint_um, or a reference of
            `bender_loop.control.references`; None for a step.
        setpoint_um: of that step; 10 unless given.
        duration_s: of the run; None for 150 frames, or those of a profile and 60 more.
        input_name: the FMU's input; None for the only one.
        output_name: its output; None for the only one.
        units: of both, where the FMU declares none, as in `tune`.
        parameters: of the FMU, by name, in its own units.
        follow_model: run the model-following controller where the gains file names a model.
        preview: let that controller know the reference beforehand.
        **settings: rate_Hz, latency_frames, exposure_s, noise_um, lower_V, upper_V, slew_V_per_s, seed, as in `tune`.

    Raises:
        InputError: both an FMU and a model are named, or a file or a setting will not do.
        RunError: the plant failed.
    """
    if fmu is not None and model is not None:
        raise InputError("--fmu and --model both name a plant; give only one")
    for name in settings:
        if name not in LOOP_SETTINGS:
            raise InputError(f"{name}: no such setting of a loop, expected one of {', '.join(LOOP_SETTINGS)}")
    controller = _controller(gains)
    reference = _reference(profile, setpoint_um)
    wanted = make_settings(setpoint_um=setpoint_um, duration_s=duration_s, **(controller.settings | settings))
    length_s = wanted.duration_s if duration_s is not None else _length_s(reference, wanted.rate_Hz)
    asked = {name: value for name, value in settings.items() if name in ("lower_V", "upper_V") and value is not None}
    bounds = wanted.limits if controller.limits is None else replace(controller.limits, **asked)
    from bender_native.ready import ready_plant_fmu

    given = file_or_model("paper" if model is None else model)
    path = ready_plant_fmu(given) if fmu is None else Path(fmu)
    subject = Path(fmu).name if fmu is not None else str(getattr(given, "name", given))
    sampling = seen_between_frames(wanted.sampling)
    rng = np.random.default_rng(wanted.seed)
    require_text("units", units, "W,K")
    kept = USUAL if units is None else of_input_and_output(units)
    with ExitStack() as ends:
        plant, facts = ends.enter_context(
            open_guarded(
                path,
                input_name,
                output_name,
                foreign=fmu is not None,
                parameters=parameters,
                quantities=kept,
                found=diagnosed(fmu if model is None else model if isinstance(model, str | Path) else None),
            )
        )
        if isinstance(gains, Path | str):
            require_units(Path(gains), facts.units, f"{subject}; where an FMU declares none, say them")
        if controller.followed is not None and controller.model is not None and follow_model:
            loop = Loop(
                sampling.period_s,
                bounds,
                wanted.slew_V_per_s,
                sampling.latency_frames,
                tuple(wanted.sampling.exposure_weights().tolist()),
                preview=preview,
            )
            trace = run_following(
                plant,
                controller.followed,
                controller.model,
                controller.gains,
                loop,
                reference,
                sampling,
                length_s,
                rng,
            )
            name = "model following"
        elif preview:
            raise InputError("preview: found with the PID block alone, expected with a controller that follows a model")
        else:
            slew = wanted.slew_V_per_s
            trace = simulate(plant, controller.gains, bounds, reference, sampling, length_s, rng, slew_V_per_s=slew)
            name = "PID block"
    note = controller.note if follow_model else ""
    return LoopSimulation(subject, name, trace, _steps(trace), facts.units, note, camera_words(wanted))


class _Controller(NamedTuple):
    gains: Gains
    settings: dict[str, Any]
    limits: Limits | None = None
    followed: FollowedModel | None = None
    model: Path | None = None
    note: str = ""


_GAINS = {"kp": "proportional_V_per_um", "ki": "integral_V_per_um_s", "kd": "derivative_V_s_per_um"}


def _gains(given: Mapping[str, float]) -> Gains:
    none = {"proportional_V_per_um": 0.0, "integral_V_per_um_s": 0.0}
    try:
        named: Any = {_GAINS.get(str(x).lower(), str(x)): y for x, y in given.items()}
        return Gains(**(none | named))
    except (TypeError, ValueError):
        raise InputError(f"gains: found {dict(given)!r}, expected kp, ki and kd, each a number of 0 or more") from None


def _note(found: TuningResult) -> str:
    """Return that the PID block runs where a model was to be followed, and the way out; empty elsewhere."""
    if found.session.recommendation is None or found.session.following is not None:
        return ""
    tuned = found.session.settings
    known = tuned.gain_error_percent is not None and tuned.late_frames is not None
    way = "" if known else "; where the device is known well: tune(..., gain_error_percent=5, late_frames=0)"
    return f"the PID block runs, the tuning does not recommend to follow the model{way}"


def _controller(gains: Path | str | Gains | Mapping[str, float] | TuningResult) -> _Controller:
    """Return what runs, with the settings that it was tuned for."""
    if isinstance(gains, Mapping):
        return _Controller(_gains(gains), {})
    if isinstance(gains, Gains):
        return _Controller(gains, {})
    if isinstance(gains, TuningResult):
        tuned, following = gains.session.settings, gains.session.following
        settings = {name: getattr(tuned, name) for name in LOOP_SETTINGS if name != "noise_um"}
        if following is None:
            return _Controller(gains.gains, settings, note=_note(gains))
        return _Controller(gains.gains, settings, None, following.model, following.fmu)
    if not isinstance(gains, str | Path):
        raise InputError(
            f"gains: found {kind_of(gains)}, expected a gains file, a dict with kp, ki and kd, Gains, or the "
            "result of tune"
        )
    found, limits, period_s, followed = read_controller(Path(gains))
    model = None if followed is None else Path(gains).parent / followed.fmu
    return _Controller(found, {"rate_Hz": 1.0 / period_s}, limits, followed, model)


def _reference(profile: Any, setpoint_um: float | None) -> Reference:
    if profile is None:
        return Step(_STEP_UM if setpoint_um is None else setpoint_um)
    if setpoint_um is not None:
        raise InputError("setpoint_um: found beside profile, expected one of them: a profile has its own set-points")
    if isinstance(profile, str | Path):
        return read_profile(Path(profile))
    if is_table(profile):
        return profile_from_columns(profile, "profile")
    if not all(callable(getattr(profile, name, None)) for name in ("sample", "value")):
        raise InputError(
            f"profile: found {kind_of(profile)}, expected a CSV file, a DataFrame or a mapping with time_s and "
            "setpoint_um, or a reference"
        )
    return profile


def _length_s(reference: Reference, rate_Hz: float) -> float:
    if isinstance(reference, Profile):
        return reference.times_s[-1] + _FRAMES_AFTER / rate_Hz
    return _FRAMES_OF_A_STEP / rate_Hz


_MOST_STEPS, _FEWEST_FRAMES = 12, 10
_SAME_S = 1e-9


def _steps(trace: Trace) -> tuple[StepSeen, ...]:
    """Return the figures of a reference that stands still between a few jumps; nothing for one that keeps moving."""
    setpoint, time = trace.setpoint_um, trace.time_s
    jumps = np.flatnonzero(np.diff(setpoint)) + 1
    if setpoint[0] != trace.displacement_um[0]:
        jumps = np.concatenate(([0], jumps))
    ends = np.append(jumps[1:], setpoint.size)
    if trace.diverged or not 0 < jumps.size <= _MOST_STEPS or (ends - jumps < _FEWEST_FRAMES).any():
        return ()
    found = []
    for begin, end in zip(jumps.tolist(), ends.tolist(), strict=True):
        rows = slice(begin, end)
        before = float(setpoint[begin - 1]) if begin else float(trace.displacement_um[0])
        tip, aim = trace.displacement_um[rows], float(setpoint[begin])
        if abs(aim - tip[0]) <= SETTLING_BAND * abs(aim - before):
            continue
        seen = Trace(time[rows] - time[begin], setpoint[rows], tip, tip, trace.voltage_V[rows])
        metrics = step_metrics(
            _with_fine(seen, trace, float(time[begin]), float(time[min(end, time.size - 1)])), intersample=True
        )
        found.append(
            StepSeen(
                time_s=float(time[begin]),
                from_um=before,
                to_um=aim,
                seen_s=float(time[end - 1] - time[begin]),
                overshoot_percent=metrics.overshoot_percent,
                settling_time_s=metrics.settling_time_s,
                rms_um=math.sqrt(step_metrics(seen).mse_um2),
            )
        )
    return tuple(found)


def _with_fine(seen: Trace, trace: Trace, begin_s: float, end_s: float) -> Trace:
    """Return a part of a trace with what it shows between the frames; the frames alone where it shows no more."""
    fine_s, fine_um = trace.fine_time_s, trace.fine_displacement_um
    if fine_s is None or fine_um is None:
        return replace(seen, fine_time_s=seen.time_s, fine_displacement_um=seen.displacement_um)
    rows = (fine_s > begin_s - _SAME_S) & (fine_s < end_s + _SAME_S)
    return replace(seen, fine_time_s=fine_s[rows] - begin_s, fine_displacement_um=fine_um[rows])
