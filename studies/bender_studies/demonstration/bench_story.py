"""The runs on the emulated bench, told: what went wrong, what was missing, what it came to."""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from bender_loop.records.record import Record
from bender_loop.shell.progress import Cell
from bender_report.number import Number
from bender_report.page import Link, Picture, Section, Table
from bender_report.picture_style import (
    COLOURS,
    INK,
    NARROW_IN,
    TUNED,
    dress,
    in_both_widths,
    new_figure,
    write_beside,
    write_title,
)
from bender_report.wording import quantity, with_interval
from bender_studies.demonstration.bench import (
    AFTER,
    BEFORE,
    DIAGNOSIS,
    DURATION_S,
    RETUNED,
    BenchStory,
    dead_time_rms_um,
    dead_time_s,
    setpoint_at,
    step_figures,
    whole_rms_um,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS = ("on the emulated bench", "run 1", "run 2", "run 2 is")
SAME = "the same"
RUNS = "Tip and voltage of both runs over time, with the set-point"
AGAIN = f"""\
bender hil --bench bench.toml --profile setpoints.csv --duration {DURATION_S:g} --gains tune/gains.toml --out {BEFORE}
bender diagnose {BEFORE}/record.csv --model bench --out {DIAGNOSIS}
bender tune --model {DIAGNOSIS}/model.toml --follow-model --out {RETUNED}
bender hil --bench bench.toml --profile setpoints.csv --no-preview --duration {DURATION_S:g} \\
    --gains {RETUNED}/gains.toml --out {AFTER}"""


@dataclass(frozen=True, slots=True)
class Compared:
    """One figure of both runs.

    Attributes:
        where: the step, or the whole run.
        what: the figure, with its unit.
        before: in run 1; NaN for not reached.
        after: in run 2.
        digits: that are shown behind the point.
        otherwise: what is shown for NaN.
    """

    where: str
    what: str
    before: float
    after: float
    digits: int
    otherwise: str = "never"

    @property
    def verdict(self) -> str:
        """How run 2 compares, smaller being better: by the digits that are shown, NaN being the worst."""
        before, after = (math.inf if math.isnan(x) else round(x, self.digits) for x in (self.before, self.after))
        return SAME if before == after else "better" if after < before else "worse"

    @property
    def cells(self) -> list[Cell]:
        """The row of the table."""
        shown = [self.otherwise if math.isnan(x) else f"{x:.{self.digits}f}" for x in (self.before, self.after)]
        return [f"{self.where}: {self.what}", *shown, self.verdict]


def compared(before: Record, after: Record) -> list[Compared]:
    """Return every figure of every step of both runs, and the rms over the whole of them."""
    found = []
    for k, (one, two) in enumerate(zip(step_figures(before), step_figures(after), strict=True), start=1):
        where = f"step {k}, {one.from_um:g} to {one.to_um:g} µm"
        never = f"not within {one.seen_s:g} s"
        found += [
            Compared(where, "overshoot (%)", one.overshoot_percent, two.overshoot_percent, 1),
            Compared(where, "settling, 2 % (s)", one.settling_time_s, two.settling_time_s, 2, never),
            Compared(where, "rms from the set-point (µm)", one.rms_um, two.rms_um, 2),
        ]
    return [*found, Compared("whole run", "rms from the set-point (µm)", whole_rms_um(before), whole_rms_um(after), 2)]


def rows(story: BenchStory) -> list[list[Cell]]:
    """One row for each figure of each step."""
    return [x.cells for x in compared(story.before, story.after)]


def balance(figures: Sequence[Compared]) -> str:
    """Return which figures are better with the corrected model's gains, and which are not, in one or two sentences."""
    better, same, worse = (_counted(figures, x) for x in ("better", SAME, "worse"))
    if not worse and not same:
        return f"Run 2 is better than run 1 in all {len(figures)} figures."
    said = f"Run 2 is better than run 1 in {sum(better.values())} of {len(figures)} figures"
    said += f" ({_listed(better, figures)})." if better else "."
    if worse:
        said += f" It is worse in {sum(worse.values())}: {_listed(worse, figures)}."
    return said + (f" The same to the digits shown: {_listed(same, figures)}." if same else "")


def _counted(figures: Sequence[Compared], verdict: str) -> Counter[str]:
    return Counter(_short(x.what) for x in figures if x.verdict == verdict)


def _listed(counts: Counter[str], figures: Sequence[Compared]) -> str:
    of = Counter(_short(x.what) for x in figures)
    return ", ".join(f"{name} {count} of {of[name]}" for name, count in counts.items())


def _short(what: str) -> str:
    return what.partition(",")[0].partition(" (")[0].partition(" from")[0]


def headline(figures: Sequence[Compared]) -> str:
    """Return the heading: the largest overshoot of both runs, and whether anything became worse."""
    one, two = _largest_overshoots(figures)
    worse = sum(x.verdict == "worse" for x in figures)
    price = f"; {worse} of {len(figures)} figures became worse" if worse else ""
    return f"On the emulated bench: largest overshoot {one:.0f} % before the diagnosis, {two:.1f} % after it{price}"


def _largest_overshoots(figures: Sequence[Compared]) -> tuple[float, float]:
    overshoots = [x for x in figures if x.what.startswith("overshoot")]
    return max(x.before for x in overshoots), max(x.after for x in overshoots)


def beside_dead_time(story: BenchStory) -> str:
    """Return what the rms of both runs is beside what the dead time alone costs."""
    delay_s = dead_time_s(story.diagnosis)
    least_um = dead_time_rms_um(story.after, delay_s)
    one, two = whole_rms_um(story.before), whole_rms_um(story.after)
    return (
        "No controller that is told a set-point when it jumps can do better than the dead time: a tip that does "
        f"exactly what is asked {1e3 * delay_s:.0f} ms after each command has an rms of {least_um:.2f} µm from these "
        "set-points. Run 1 has "
        f"{one:.2f} µm, run 2 {two:.2f} µm, {100.0 * (two / least_um - 1.0):+.0f} %."
    )


def what_it_uses(story: BenchStory) -> str:
    """Return what the second run does with the name, or that model following was not recommended."""
    note = story.session.following_note
    if story.session.following is None:
        return f"Run 2 has the PID block alone: {note}."
    return (
        "Run 2 uses the corrected model: its inverse gives the command, the whole model with its dead time predicts "
        "what the camera will see, and the same PID block acts on measured minus predicted. The gains need not "
        f"be slowed down for what the model explains. {note[:1].upper()}{note[1:]}."
    )


def bench_section(story: BenchStory) -> Section:
    """The runs, the verdict between them, and the table."""
    figures = compared(story.before, story.after)
    marked = frozenset((k, len(COLUMNS) - 1) for k, x in enumerate(figures) if x.verdict == "worse")
    return Section(
        headline(figures),
        [
            "No real device stands behind this section: the bench is emulated. The same PID block drives a supply that "
            "speaks SCPI and pictures from a camera in which the tip is found, with a guard in between. Behind them is "
            "a plant that differs from the model in a way that stands in the bench file and nowhere else. The gains "
            "tuned on the model overshoot.",
            verdict(story),
            what_it_uses(story),
            f"{balance(figures)} {beside_dead_time(story)}",
        ],
        Table(COLUMNS, [x.cells for x in figures], marked=marked),
        in_two_widths("runs", RUNS, lambda narrow: runs_figure(story, narrow)),
        ["Every figure is from what the camera saw; a settling time that would lie beyond the next step is left out."],
        code=AGAIN,
        links=[Link("The report of the diagnosis", f"{DIAGNOSIS}/report.html")],
    )


def missing_section(reason: str) -> Section:
    """Why the bench was left out."""
    return Section("On the emulated bench: left out", [f"The runs on the emulated bench were left out: {reason}."])


def _told(name: str, number: dict[str, Any]) -> str:
    within = number["interval_95"]
    told = Number(name, number["value"], number["unit"], number["std"] or 0.0, interval=within and tuple(within))
    return f"{name} = {with_interval(told)}"


def verdict(story: BenchStory) -> str:
    """What the diagnosis says, with its numbers and the gap before and after."""
    told, gap = story.diagnosis, story.diagnosis["gap"]
    numbers = [
        f"{effect['id']}: {_told(name, number)}"
        for effect in told["effects"]
        for name, number in effect["parameters"].items()
    ]
    listed = f" Fitted: {'; '.join(numbers)}." if numbers else ""
    return (
        f"The diagnosis of that run's record: {told['sentence']}{listed} On held-out frames the gap falls from "
        f"{quantity(gap['recalibrated']['rms_um'], 'um')}, recalibrated, to {quantity(gap['after']['rms_um'], 'um')} "
        f"with the corrected FMU; the noise floor is {quantity(gap['noise_floor_um'], 'um')}."
    )


def in_two_widths(name: str, alt: str, figure_of: Callable[[bool], "Figure"]) -> Picture:
    """Return a picture for desk and phone; `figure_of` is told whether it draws the narrow one."""
    return Picture(in_both_widths(name, alt, figure_of), alt)


def runs_figure(story: BenchStory, narrow: bool = False) -> "Figure":
    """Return tip and voltage of both runs over time."""
    figure = new_figure(NARROW_IN, 6.0) if narrow else new_figure(10.5, 5.6)
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
    overshoot = _largest_overshoots(compared(story.before, story.after))
    write_title(
        figure,
        f"Largest overshoot {overshoot[0]:.0f} % with the model as given, {overshoot[1]:.1f} % with the corrected one",
        "emulated bench, three steps, camera at 30 frames/s; set-point dashed",
    )
    return figure
