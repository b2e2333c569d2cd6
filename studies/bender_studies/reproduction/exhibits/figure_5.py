"""Figure 5: the tip under 10 sin(pi t + 0.5) V, frame by frame."""

import math

import numpy as np
from numpy.typing import NDArray

from bender_identify.paper.simulated_bouc_wen import simulated
from bender_loop.records.record import Record
from bender_report.page import Picture
from bender_report.picture_style import INK, TUNED, dress, new_figure, to_png, write_title
from bender_studies.reproduction.exhibit import Exhibit, Row
from bender_studies.reproduction.printed import FRAMES_PER_S
from bender_studies.reproduction.shared_work import SharedWork, sine_V

Array = NDArray[np.float64]

FREQUENCY_HZ, AMPLITUDE_V, PHASE_RAD = 0.5, 10.0, 0.5
HARMONICS = 5
SETTLED_S = 4.0
"""What comes before is the way into the cycle."""
SHOWN_S = 12.0


def show(shared: SharedWork) -> Exhibit:
    """The recording beside what equation (30) gives at the same instants."""
    record = shared.recording
    exact_um = simulated(shared.paper_model, sine_V, record.time_s)
    exact, seen = Cycle.of(record.time_s, exact_um), Cycle.of(record.time_s, record.displacement_um)
    rate = 1.0 / float(np.median(np.diff(record.time_s)))
    return Exhibit(
        name="Figure 5",
        finding=f"Under the paper's sine the tip travels {seen.span_um:.3g} µm, with noise of {seen.noise_um:.2g} µm",
        paper_mode_is="equation (30) in series with the beam, read at the instants of the frames",
        ours_is=f"a recording: {shared.bench.how_sine}",
        rows=[
            Row("frames", "1/s", FRAMES_PER_S, None, rate, given=True),
            Row("peak to peak", "µm", None, exact.span_um, seen.span_um,
                "peak to peak: the paper draws the curve without printing a number to hold this against"),
            Row("mean", "µm", None, exact.mean_um, seen.mean_um),
            Row("fundamental over the voltage", "µm/V", None, exact.gain_um_per_V, seen.gain_um_per_V,
                "fundamental over the voltage: it is not the 0.473 µm/V of Figure 8: the same device would have to "
                "be twice as sensitive at ± 10 V as at 0 to 50 V"),
            Row("its phase", "°", None, exact.phase_deg, seen.phase_deg,
                f"the recording's phase is late by {1e3 * shared.bench.delay_s:.3g} ms, half the exposure of a frame"
                if shared.bench.delay_s > 0.0 else ""),
            Row("left beside five harmonics", "µm", None, exact.noise_um, seen.noise_um),
        ],
        picture=Picture(_draw(record, exact_um), "The recorded frames over equation (30), the first seconds"),
        remarks=["The paper gives Figures 4 and 5 the same caption; by its text Figure 5 is the measured tip."],
    )  # fmt: skip


class Cycle:
    """The settled part of a recording in five harmonics."""

    def __init__(self, coefficients: Array, noise_um: float) -> None:
        self._coefficients = coefficients
        self.noise_um = noise_um

    @classmethod
    def of(cls, time_s: Array, reading_um: Array) -> "Cycle":
        """Fit the harmonics to the rows that are settled and seen."""
        rows = (time_s >= SETTLED_S) & np.isfinite(reading_um)
        columns = _harmonics(time_s[rows])
        solution: Array = np.asarray(np.linalg.lstsq(columns, reading_um[rows], rcond=None)[0], dtype=np.float64)
        left = reading_um[rows] - columns @ solution
        return cls(solution, float(np.sqrt(np.mean(left * left))))

    @property
    def span_um(self) -> float:
        """Peak to peak."""
        return float(np.ptp(_harmonics(np.linspace(0.0, 1.0 / FREQUENCY_HZ, 2000)) @ self._coefficients))

    @property
    def mean_um(self) -> float:
        """The constant."""
        return float(self._coefficients[0])

    @property
    def gain_um_per_V(self) -> float:
        """Amplitude of the fundamental over that of the voltage."""
        return float(np.hypot(self._coefficients[1], self._coefficients[2])) / AMPLITUDE_V

    @property
    def phase_deg(self) -> float:
        """Of the fundamental before the voltage."""
        sine, cosine = float(self._coefficients[1]), float(self._coefficients[2])
        return math.degrees(math.atan2(cosine, sine) - PHASE_RAD)


def _harmonics(time_s: Array) -> Array:
    angle = 2.0 * np.pi * FREQUENCY_HZ * time_s
    waves = [wave(k * angle) for k in range(1, HARMONICS + 1) for wave in (np.sin, np.cos)]
    return np.column_stack([np.ones_like(time_s), *waves])


def _draw(record: Record, exact_um: Array) -> bytes:
    figure = new_figure(10.5, 3.4)
    axes = figure.subplots()
    shown = record.time_s <= SHOWN_S
    axes.plot(record.time_s[shown], exact_um[shown], color=TUNED, lw=1.4, label="equation (30)")
    axes.plot(record.time_s[shown], record.displacement_um[shown], ".", color=INK, ms=3.0, label="frames")
    dress(axes, x_label="time (s)", y_label="tip (µm)")
    axes.margins(y=0.15)
    axes.legend(fontsize=8, frameon=False, loc="upper right", ncols=2)
    write_title(figure, "The tip under 10 sin(πt + 0.5) V")
    return to_png(figure)
