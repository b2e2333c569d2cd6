"""The views of a residual that distinguish effects: over voltage, reading, time since a step, or frequency."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bender_discrepancy.report.signature.drives import Signature
from bender_loop.records.acting_voltage import direction
from bender_report.record_overlay import FALLING, MEASURED, RISING

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

Array = NDArray[np.float64]
WITHOUT, RESIDUAL, NOISE = "#6d9dcf", "#d1495b", "0.90"
BINS_PER_OCTAVE = 48
INSIDE = 1.3
"""Where a sweep begins and ends it is windowed away."""
FLAT = 2.0
"""A gain that varies by less than the square of this is drawn as the flat line that it is."""
RINGING_Hz = 104.4
"""First mode of the nominal plant."""
STEP_COLOURS = ("#00798c", "#edae49", "#7b4ea3", "#d1495b", "#3a7d44", "#8c564b")


def over_voltage(figure: "SubFigure", signature: Signature) -> None:
    """Draw the residual over the acting voltage, rising and falling apart."""
    _branches(figure, signature, signature.drive.acting_V, "voltage (V)", "the residual over the voltage")


def over_reading(figure: "SubFigure", signature: Signature) -> None:
    """Draw the residual over the simulated reading, rising and falling apart."""
    _branches(
        figure, signature, signature.without_um, "reading without the effect (µm)", "the residual over the reading"
    )


def over_voltage_in_time(figure: "SubFigure", signature: Signature) -> None:
    """Draw the residual over the acting voltage, coloured by the time."""
    drive = signature.drive
    axes = figure.subplots()
    points = axes.scatter(
        drive.acting_V, signature.residual_um, c=drive.time_s, s=3, cmap="viridis", rasterized=True, linewidths=0
    )
    axes.axhspan(-drive.noise_um, drive.noise_um, color=NOISE, zorder=0)
    figure.colorbar(points, ax=axes, label="time (s)", pad=0.02)
    _label(axes, "voltage (V)", "residual (µm)", "the residual over the voltage, by time")


def since_step(figure: "SubFigure", signature: Signature) -> None:
    """Draw the residual per volt of each step over the time since it."""
    _draw_since_step(figure, signature, "linear")


def since_step_log(figure: "SubFigure", signature: Signature) -> None:
    """Draw the residual per volt of each step over the logarithm of the time since it."""
    _draw_since_step(figure, signature, "log")


def over_frequency(figure: "SubFigure", signature: Signature) -> None:
    """Draw the gain of both plants, and the phase that the effect adds, from a sweep."""
    gain, phase = figure.subplots(2, 1, sharex=True, height_ratios=(1.4, 1.0))
    part = signature.drive.parts[0]
    frequency_Hz, with_effect = response(signature, signature.with_um, part)
    _, without = response(signature, signature.without_um, part)
    gain.loglog(frequency_Hz, np.abs(without), color=WITHOUT, lw=2.4, label="without")
    gain.loglog(frequency_Hz, np.abs(with_effect), color=MEASURED, lw=1.2, label="with")
    gain.legend(fontsize=8, frameon=False)
    low, high = gain.get_ylim()
    if high < FLAT**2 * low:
        gain.set_ylim(low / FLAT, high * FLAT)
    _label(gain, "", "gain (µm/V)", "reading over voltage")
    _decades(gain, "xy")
    added = np.degrees(np.unwrap(np.angle(with_effect / without)))
    phase.semilogx(frequency_Hz, added, color=RESIDUAL, lw=1.4)
    phase.axhline(0.0, color="0.6", lw=0.8)
    _label(phase, "frequency (Hz)", "phase (°)", "what the effect adds to the phase")
    phase.set_xlim(frequency_Hz[0], frequency_Hz[-1])
    _decades(phase, "x")


def resonance_at_levels(figure: "SubFigure", signature: Signature) -> None:
    """Draw the resonance as sweeps about several levels show it."""
    axes = figure.subplots()
    drive = signature.drive
    for part, colour in zip(drive.parts, STEP_COLOURS, strict=False):
        frequency_Hz, with_effect = response(signature, signature.with_um, part)
        _, without = response(signature, signature.without_um, part)
        level = float(np.mean(drive.voltage_V[part]))
        axes.semilogy(frequency_Hz, np.abs(without), color=WITHOUT, lw=2.4, alpha=0.5)
        axes.semilogy(frequency_Hz, np.abs(with_effect), color=colour, lw=1.3, label=f"with, about {level:.0f} V")
    axes.plot([], [], color=WITHOUT, lw=2.4, alpha=0.5, label="without, every level")
    axes.legend(fontsize=8, frameon=False)
    _label(axes, "frequency (Hz)", "gain (µm/V)", "the resonance at several levels")
    _decades(axes, "y")


def spectrum(figure: "SubFigure", signature: Signature) -> None:
    """Draw the amplitude spectrum of the residual with its highest line named."""
    axes = figure.subplots()
    frequency_Hz, amplitude_um = amplitude_spectrum(signature.residual_um, signature.drive.time_s)
    axes.loglog(frequency_Hz, np.maximum(amplitude_um, 1e-6), color=RESIDUAL, lw=1.0)
    top = int(np.argmax(amplitude_um))
    axes.annotate(
        f"{frequency_Hz[top]:.3g} Hz", (frequency_Hz[top], amplitude_um[top]), (8, -4), textcoords="offset points"
    )
    axes.axhline(signature.drive.noise_um * np.sqrt(4.0 / frequency_Hz.size), color="0.6", lw=0.8, ls="--")
    axes.set_ylim(1e-5, 2.0 * amplitude_um[top])
    _label(axes, "frequency (Hz)", "amplitude (µm)", "spectrum of the residual (dashed: noise of the sensor)")


def parity(figure: "SubFigure", signature: Signature) -> None:
    """Draw the reading with the effect over the one without, and the line on which they would be equal."""
    axes = figure.subplots()
    axes.axline((0.0, 0.0), slope=1.0, color=WITHOUT, lw=2.4, label="equal")
    axes.plot(signature.without_um, signature.with_um, color=MEASURED, lw=1.4, label="with over without")
    axes.legend(fontsize=8, frameon=False)
    _label(axes, "reading without the effect (µm)", "reading with it (µm)", "measured over simulated")


VIEWS: dict[str, Callable[["SubFigure", Signature], None]] = {
    "voltage": over_voltage,
    "voltage_in_time": over_voltage_in_time,
    "reading": over_reading,
    "since_step": since_step,
    "since_step_log": since_step_log,
    "frequency": over_frequency,
    "resonance_at_levels": resonance_at_levels,
    "spectrum": spectrum,
    "parity": parity,
}
"""By the names that the catalogue uses."""


def response(signature: Signature, reading_um: Array, part: slice) -> tuple[Array, NDArray[np.complex128]]:
    """Return (m,) frequencies in Hz and the complex gain in um/V of a reading in a sweep.

    The cross-spectrum with the voltage over the voltage's own spectrum, both summed over narrow bands of equal
    relative width, within what the sweep runs through.
    """
    time_s, voltage_V = signature.drive.time_s[part], signature.drive.voltage_V[part]
    window = np.minimum(1.0, 20.0 * np.minimum(np.linspace(0, 1, time_s.size), np.linspace(1, 0, time_s.size)))
    v = np.fft.rfft(window * (voltage_V - voltage_V.mean()))[1:]
    y = np.fft.rfft(window * (reading_um[part] - reading_um[part].mean()))[1:]
    frequency_Hz = np.arange(1, v.size + 1) / (time_s.size * (time_s[1] - time_s[0]))
    low, high = signature.drive.band_Hz
    inside = (frequency_Hz > INSIDE * low) & (frequency_Hz < high / INSIDE)
    bands, band = np.unique(np.round(BINS_PER_OCTAVE * np.log2(frequency_Hz[inside])), return_inverse=True)
    power = np.bincount(band, np.abs(v[inside]) ** 2)
    cross = np.zeros(bands.size, dtype=np.complex128)
    np.add.at(cross, band, (y * np.conj(v))[inside])
    return 2.0 ** (bands / BINS_PER_OCTAVE), cross / power


def amplitude_spectrum(signal: Array, time_s: Array) -> tuple[Array, Array]:
    """Return (m,) frequencies in Hz and the amplitude of the sine at each, of an evenly read signal (n,)."""
    window = np.hanning(signal.size)
    amplitude = 2.0 * np.abs(np.fft.rfft(window * (signal - signal.mean()))) / window.sum()
    return np.fft.rfftfreq(signal.size, time_s[1] - time_s[0])[1:], amplitude[1:]


def jumps(voltage_V: Array) -> NDArray[np.intp]:
    """Return the rows at which a held voltage jumps, the first one included where it does not begin at 0 V."""
    return np.flatnonzero(np.abs(np.diff(voltage_V, prepend=0.0)) > 1e-9)


def _branches(figure: "SubFigure", signature: Signature, axis: Array, label: str, title: str) -> None:
    axes = figure.subplots()
    sense = direction(signature.drive.acting_V)
    for sign, colour, name, width in ((1, RISING, "voltage rising", 2.2), (-1, FALLING, "falling", 1.0)):
        shown = np.where(sense == sign, signature.residual_um, np.nan)
        axes.plot(axis, shown, color=colour, lw=width, marker=".", ms=2, label=name)
    axes.axhspan(-signature.drive.noise_um, signature.drive.noise_um, color=NOISE, zorder=0)
    axes.legend(fontsize=8, frameon=False, ncols=2, loc="lower right", bbox_to_anchor=(1.02, 0.99))
    _label(axes, label, "residual (µm)", title)


def _draw_since_step(figure: "SubFigure", signature: Signature, scale: str) -> None:
    axes = figure.subplots()
    drive, residual_um = signature.drive, signature.residual_um
    starts = jumps(drive.voltage_V)
    ends = [*starts[1:], residual_um.size]
    steps_V = np.diff(drive.voltage_V, prepend=0.0)[starts]
    period = round(1.0 / (RINGING_Hz * (drive.time_s[1] - drive.time_s[0])))
    for k, (start, end, step_V) in enumerate(zip(starts, ends, steps_V, strict=True)):
        colour = STEP_COLOURS[k % len(STEP_COLOURS)]
        since_s = drive.time_s[start + 1 : end] - drive.time_s[start]
        curve = (residual_um[start + 1 : end] - residual_um[start]) / step_V
        if period > 1:
            axes.plot(since_s, curve, color=colour, lw=0.5, alpha=0.3)
            curve = np.convolve(curve, np.full(period, 1.0 / period), mode="valid")
            since_s = since_s[(period - 1) // 2 :][: curve.size]
        axes.plot(since_s, curve, color=colour, lw=1.6, label=f"{step_V:+.0f} V")
    axes.set_xscale(scale)
    axes.axhline(0.0, color="0.6", lw=0.8)
    axes.legend(fontsize=8, frameon=False, title="step", title_fontsize=8)
    title = "after each step (bold: mean of one ringing period)" if period > 1 else "after each step"
    _label(axes, "time since the step (s)", "residual per volt of the step (µm/V)", title)


def _decades(axes: "Axes", which: str) -> None:
    """Put plain numbers at 1, 2 and 5 of each decade of a logarithmic axis."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    for name in which:
        axis = axes.xaxis if name == "x" else axes.yaxis
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())


def _label(axes: "Axes", x: str, y: str, title: str) -> None:
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.set_title(title, loc="left", fontsize=10)
