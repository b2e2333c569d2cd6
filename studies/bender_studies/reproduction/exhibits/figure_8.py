"""Figure 8: the staircase 0, 1, ... 50, ... 1, 0 V, its sensitivity and its straightness, both ways."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_identify.fitting.candidate import Candidate
from bender_identify.fitting.resimulation import Bank
from bender_identify.identification import identify
from bender_identify.records.experiment import experiment_of
from bender_identify.settings import Settings
from bender_plant.composite_beam import static_gain_um_per_V
from bender_report.page import Picture
from bender_report.palette import light
from bender_report.picture_style import COLOURS, MUTED, TUNED, dress, new_figure, to_png, write_title
from bender_studies.reproduction.exhibit import Exhibit, Row
from bender_studies.reproduction.printed import R_SQUARED, SENSITIVITY_UM_PER_V
from bender_studies.reproduction.shared_work import SharedWork

Array = NDArray[np.float64]

TOP_V = 50
HELD_OUT_SHARE = 0.2
RISING, FALLING = light("rising"), light("falling")


@dataclass(frozen=True, slots=True, eq=False)
class Stairs:
    """Settled pairs of a staircase up and down, voltages and displacements of shape (n,)."""

    voltage_V: Array
    displacement_um: Array

    @property
    def top(self) -> int:
        """The row of the highest voltage, which belongs to the way up."""
        return int(np.argmax(self.voltage_V))

    def branch(self, way: str) -> tuple[Array, Array]:
        """Voltages and displacements on the way `up` or `down`, without lost frames."""
        rows = slice(0, self.top + 1) if way == "up" else slice(self.top + 1, None)
        voltage, displacement = self.voltage_V[rows], self.displacement_um[rows]
        seen = np.isfinite(displacement)
        return voltage[seen], displacement[seen]

    def line(self, way: str) -> tuple[float, float, float]:
        """Slope in um/V, offset in um and R² of the line of least squares on one way."""
        voltage, displacement = self.branch(way)
        slope, offset = np.polyfit(voltage, displacement, 1)
        left = displacement - slope * voltage - offset
        about = displacement - displacement.mean()
        return float(slope), float(offset), 1.0 - float(left @ left) / float(about @ about)

    @property
    def sensitivity_um_per_V(self) -> float:
        """Slope of the line through zero that meets both ways together best."""
        voltage, displacement = (
            np.concatenate(part) for part in zip(self.branch("up"), self.branch("down"), strict=True)
        )
        return float(voltage @ displacement) / float(voltage @ voltage)

    def r_squared_through_zero(self, way: str) -> float:
        """R² of a way's own line through zero, about the mean."""
        voltage, displacement = self.branch(way)
        left = displacement - voltage * float(voltage @ displacement) / float(voltage @ voltage)
        about = displacement - displacement.mean()
        return 1.0 - float(left @ left) / float(about @ about)


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """The paper's own points, and the model learned from them."""

    points: Stairs
    candidate: Candidate
    simulated: Stairs


def show(shared: SharedWork) -> Exhibit:
    """The staircase on the bench, the published points, and the operator learned from them."""
    recorded = record_stairs(shared)
    measured = learn_from_the_points(shared)
    beam = shared.paper_model.beam
    slope, _, r_squared = recorded.line("up")
    theory = float("nan") if beam is None else static_gain_um_per_V(beam)
    return Exhibit(
        name="Figure 8",
        finding=f"Equation (30) climbs with {slope:.3g} µm/V and bends: R² {r_squared:.3f} against the paper's 0.99",
        paper_mode_is=f"equation (30) behind a supply, {shared.scale.dwell_frames} frames a step; "
        f"{shared.bench.how}",
        ours_is="no model: the measured points are not beside this checkout" if measured is None else
        f"{measured.candidate.title}, learned from the paper's points",
        rows=[*_lines(recorded, measured), *_points(measured), *_misses(recorded, measured), _theory(theory)],
        picture=Picture(_draw(recorded, measured, theory), "Displacement over voltage, both ways"),
        remarks=["The paper does not say how long a step lasted; equation (30) relaxes within seconds, so its loop "
                 "depends on that."],
    )  # fmt: skip


def record_stairs(shared: SharedWork) -> Stairs:
    """Run the staircase on the bench; the last frame of every step counts."""
    levels = np.array([*range(TOP_V + 1), *range(TOP_V - 1, -1, -1)], dtype=np.float64)
    dwell = shared.scale.dwell_frames
    record = shared.kept("staircase.csv", shared.bench.record_staircase(levels, dwell))
    return Stairs(*shared.bench.settled(record, levels, dwell))


def learn_from_the_points(shared: SharedWork) -> Measured | None:
    """The model that meets the published points best when fitted to all of them; None without points."""
    record = shared.measured
    if record is None:
        return None
    settings = Settings(ensemble=0, held_out_share=HELD_OUT_SHARE)
    experiment = experiment_of(record, "the published points", settings, untimed=True)
    outcome = identify([experiment], shared.paper_model, settings, shared.rng(20))
    whole = experiment.fitting_all()
    candidates = [row.candidate.refit([whole]) for row in outcome.rows]
    candidate = min(candidates, key=lambda c: float(c.fit.residual_um @ c.fit.residual_um))
    readings = Bank([whole]).run(candidate.model)[0]
    points = Stairs(record.voltage_V, record.displacement_um)
    return Measured(points, candidate, Stairs(record.voltage_V, readings))


def _lines(recorded: Stairs, measured: Measured | None) -> list[Row]:
    ours = None if measured is None else measured.simulated
    rows = [
        Row("sensitivity, through zero, both ways", "µm/V", SENSITIVITY_UM_PER_V, recorded.sensitivity_um_per_V,
            None if ours is None else ours.sensitivity_um_per_V,
            "sensitivity: (30) was learned at ± 10 V, where its slope is almost twice this, and flattens above")
    ]  # fmt: skip
    for way in ("up", "down"):
        line, own = recorded.line(way), None if ours is None else ours.line(way)
        rows += [
            Row(f"slope {way}", "µm/V", None, line[0], None if own is None else own[0]),
            Row(f"R² {way}", "", R_SQUARED[way], line[2], None if own is None else own[2]),
        ]
    return rows


def _points(measured: Measured | None) -> list[Row]:
    if measured is None:
        return [
            Row("the published points", "µm/V", SENSITIVITY_UM_PER_V, None, None,
                "the published points: paper_fig8.csv, read off the paper's figure, is not in ../shared/data beside "
                "this checkout, so they could not be fitted again")
        ]  # fmt: skip
    points = measured.points
    rows = [
        Row("published points, through zero, both ways", "µm/V", SENSITIVITY_UM_PER_V, points.sensitivity_um_per_V,
            None, "published points: read off the paper's figure (paper_fig8.csv) and fitted again. A line through "
            "zero on all of them gives the printed sensitivity to the accuracy of the reading; lines with an offset "
            "are steeper. The paper does not say which it took")
    ]  # fmt: skip
    for way in ("up", "down"):
        slope, _, r_squared = points.line(way)
        rows += [
            Row(f"published points, slope {way}", "µm/V", None, slope, None),
            Row(f"published points, R² {way}", "", R_SQUARED[way], r_squared, None),
            Row(f"published points, R² {way}, through zero", "", R_SQUARED[way],
                points.r_squared_through_zero(way), None),
        ]  # fmt: skip
    return rows


def _misses(recorded: Stairs, measured: Measured | None) -> list[Row]:
    if measured is None or measured.points.voltage_V.size - recorded.voltage_V.size not in (0, 1):
        return []
    points = measured.points
    model_um = np.concatenate([np.interp(points.branch("up")[0], *recorded.branch("up")), _falling(points, recorded)])
    seen = np.concatenate([points.branch(way)[1] for way in ("up", "down")])
    ours = np.concatenate([measured.simulated.branch(way)[1] for way in ("up", "down")])
    return [
        Row("rms from the published points", "µm", None, _rms(seen - model_um), _rms(seen - ours),
            "rms from the points: the paper's camera read in steps of 0.7 µm, which accounts for 0.2 µm")
    ]  # fmt: skip


def _falling(points: Stairs, recorded: Stairs) -> Array:
    voltage, displacement = recorded.branch("down")
    top = float(recorded.displacement_um[recorded.top])
    heights = np.append(displacement[::-1], top), np.append(voltage[::-1], float(TOP_V))
    return np.interp(points.branch("down")[0], heights[1], heights[0])


def _theory(theory: float) -> Row:
    return Row(
        "slope of the theoretical line", "µm/V", None, None, theory,
        f"slope of the theoretical line: the black line of Figure 8 follows the data; Table 1 gives {theory:.3g} µm/V "
        "without electrodes and glue, which the paper leaves out and which stiffen the beam: the line cannot come "
        "from Table 1",
    )  # fmt: skip


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values * values)))


def _draw(recorded: Stairs, measured: Measured | None, theory: float) -> bytes:
    figure = new_figure(10.5, 4.6)
    axes = figure.subplots()
    axes.plot([0.0, TOP_V], [0.0, theory * TOP_V], color=MUTED, lw=1.0, ls="--", label="Table 1, linear")
    axes.plot(recorded.voltage_V, recorded.displacement_um, color=COLOURS["simc"], lw=1.4, label="equation (30)")
    if measured is not None:
        for way, mark, colour in (("up", "*", RISING), ("down", "o", FALLING)):
            voltage, displacement = measured.points.branch(way)
            axes.plot(voltage, displacement, mark, color=colour, ms=4.5, mfc="none", label=f"published points, {way}")
            slope, offset, _ = measured.points.line(way)
            axes.plot(voltage, slope * voltage + offset, color=colour, lw=0.8, ls="--")
        axes.plot(measured.simulated.voltage_V, measured.simulated.displacement_um, color=TUNED, lw=1.4,
                  label="learned from the points")  # fmt: skip
    dress(axes, x_label="voltage (V)", y_label="tip (µm)")
    axes.set_ylim(-2.0, 32.0)
    axes.legend(fontsize=8, frameon=False, loc="upper left")
    slope, _, r_squared = recorded.line("up")
    write_title(figure, f"Equation (30): {slope:.3g} µm/V, R² {r_squared:.3f} on the way up")
    return to_png(figure)
