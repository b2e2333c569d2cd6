"""The runs on the emulated bench, told: what went wrong, what was missing, what it came to."""

import math

from bender_loop.records.record import Record
from bender_loop.shell.progress import Cell
from bender_report.page import Picture, Section, Table
from bender_report.picture_style import COLOURS, INK, TUNED, dress, new_figure, to_png, write_beside, write_title
from bender_studies.demonstration.bench import (
    AFTER,
    BEFORE,
    DIAGNOSIS,
    DURATION_S,
    RETUNED,
    BenchStory,
    first_step,
    setpoint_at,
)

COLUMNS = ("run on the emulated bench", "overshoot (%)", "settling (s)", "rms from the setpoint (um)")
AGAIN = f"""\
bender hil --bench bench.toml --profile setpoints.csv --duration {DURATION_S:g} --gains tune/gains.toml --out {BEFORE}
bender diagnose {BEFORE}/record.csv --model bench --out {DIAGNOSIS}
bender tune --fmu {DIAGNOSIS}/model.fmu --out {RETUNED}
bender hil --bench bench.toml --profile setpoints.csv --duration {DURATION_S:g} \\
    --gains {RETUNED}/gains.toml --out {AFTER}"""


def rows(story: BenchStory) -> list[list[Cell]]:
    """One row for each run."""
    return [
        _row("gains from the model as given", story.before),
        _row("gains from the corrected model", story.after),
    ]


def bench_section(story: BenchStory) -> Section:
    """The runs, the verdict between them, and the table."""
    before, after = first_step(story.before), first_step(story.after)
    return Section(
        f"On the bench the overshoot was {before.overshoot_percent:.0f} %; with the effect that the model lacked it is "
        f"{after.overshoot_percent:.1f} %",
        [
            "The same PID block drives an emulated bench: a supply that speaks SCPI, pictures from a camera in which "
            "the tip is found, a guard in between. Behind them is a plant that differs from the model in a way that "
            "stands in the bench file and nowhere else. The gains tuned on the model overshoot.",
            verdict(story),
            "The controller was tuned again on the corrected FMU, and ran again on the same bench.",
        ],
        Table(COLUMNS, rows(story)),
        Picture(draw_runs(story), "Tip and voltage of both runs over time, with the setpoint"),
        [f"The report of the diagnosis is {DIAGNOSIS}/report.html, beside this page."],
        code=AGAIN,
    )


def missing_section(reason: str) -> Section:
    """Why the bench was left out."""
    return Section("On the bench", [f"The runs on the emulated bench were left out: {reason}."])


def verdict(story: BenchStory) -> str:
    """What the diagnosis says, with its numbers and the gap before and after."""
    told, gap = story.diagnosis, story.diagnosis["gap"]
    numbers = [
        f"{effect['id']}: {name} = {number['value']:.4g}" + (f" ± {number['std']:.2g}" if number["std"] else "")
        for effect in told["effects"]
        for name, number in effect["parameters"].items()
    ]
    listed = f" ({'; '.join(numbers)})" if numbers else ""
    return (
        f"The diagnosis of that run's record: {told['sentence']}{listed} On held-out frames the gap goes from "
        f"{gap['recalibrated']['rms_um']:.3g} µm, gain and offset put right, to {gap['after']['rms_um']:.2g} µm with "
        f"the corrected FMU; the noise is {gap['noise_floor_um']:.2g} µm."
    )


def _row(name: str, record: Record) -> list[Cell]:
    figures = first_step(record)
    settled = "never" if math.isnan(figures.settling_time_s) else round(figures.settling_time_s, 3)
    error = record.displacement_um - setpoint_at(record.time_s)
    rms = math.sqrt(float((error[error == error] ** 2).mean()))
    return [name, round(figures.overshoot_percent, 1), settled, round(rms, 3)]


def draw_runs(story: BenchStory) -> bytes:
    """Tip and voltage of both runs, PNG."""
    figure = new_figure(10.5, 5.6)
    tip, volts = figure.subplots(2, 1, sharex=True, height_ratios=[2, 1])
    runs = ((story.before, "as given", COLOURS["zn"]), (story.after, "corrected", TUNED))
    time_s = story.before.time_s
    tip.step(time_s, setpoint_at(time_s), where="post", color=INK, lw=0.9, ls=(0, (4, 3)))
    for record, _, colour in runs:
        tip.plot(record.time_s, record.displacement_um, color=colour, lw=1.8)
        volts.step(record.time_s, record.voltage_V, where="post", color=colour, lw=1.4)
    dress(tip, y_label="tip (µm)")
    dress(volts, x_label="time (s)", y_label="command (V)")
    tip.margins(x=0)
    peak = [(float(record.displacement_um[record.displacement_um == record.displacement_um][-1]), name, colour)
            for record, name, colour in runs]  # fmt: skip
    write_beside(tip, peak)
    overshoot = [first_step(record).overshoot_percent for record, _, _ in runs]
    write_title(
        figure,
        f"Overshoot {overshoot[0]:.0f} % with the model as given, {overshoot[1]:.1f} % with the corrected one",
        "emulated bench, camera at 30 frames/s; setpoint dashed",
    )
    return to_png(figure)
