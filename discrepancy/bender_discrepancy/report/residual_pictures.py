"""What is left, before and after: over time, over the voltage and its direction, as a map of both, over frequency."""

from typing import TYPE_CHECKING

import numpy as np

from bender_discrepancy.report.pictured_record import Array, Mask, PicturedRecord
from bender_report.chart import WIDE_PX, Chart, bulk_limits, chart, dots, plain_logarithmic, spread, thinned
from bender_report.palette import light
from bender_report.wording import axis_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LINE_POINTS = {False: 1800, True: 700}
DOT_POINTS = {False: 1600, True: 800}
MAP_COLUMNS = {False: 64, True: 28}
MAP_ROWS = 12
# full colour from this part of the cells on: one stray reading shall not bleach the rest
STRONG = 0.97
BANDS = 90
COLOURS = 24
FEWEST_ROWS = 64


def over_time(pictured: PicturedRecord) -> Chart:
    """Return the residual over the whole record; shaded where it is held out."""

    def draw(figure: "Figure", narrow: bool) -> None:
        axes = figure.subplots()
        for begin, end in _pieces(pictured.held_out):
            axes.axvspan(pictured.axis[begin], pictured.axis[end - 1], color=light("held"), lw=0)
        _noise(axes, pictured)
        for values, colour in _residuals(pictured):
            seen = np.flatnonzero(np.isfinite(values))
            rows = seen[thinned(values[seen], LINE_POINTS[narrow])]
            axes.plot(pictured.axis[rows], values[rows], color=light(colour), lw=0.9)
        axes.set_ylim(*bulk_limits(pictured.without_um, 2.0 * pictured.noise_um))
        axes.set_xlabel(pictured.axis_label)
        axes.set_ylabel(axis_text("residual (µm)"))
        axes.margins(x=0.005)

    return chart("residual", "the residual over time", draw, WIDE_PX, 270, 230)


def over_voltage(pictured: PicturedRecord) -> Chart:
    """Return the residual over the voltage, rising and falling apart, before and after on one scale."""

    def draw(figure: "Figure", narrow: bool) -> None:
        panels = list(zip(_residuals(pictured), ("recalibrated", "corrected"), strict=False))
        shape = (len(panels), 1) if narrow else (1, len(panels))
        grid = np.atleast_1d(figure.subplots(*shape, sharex=True, sharey=True)).ravel()
        for axes, ((values, _), title) in zip(grid, panels, strict=True):
            _noise(axes, pictured)
            for mask, colour in ((pictured.rising, "rising"), (~pictured.rising, "falling")):
                rows = np.flatnonzero(mask & np.isfinite(values))
                rows = rows[spread(rows.size, DOT_POINTS[narrow])] if rows.size else rows
                dots(axes, pictured.acting_V[rows], values[rows], colour, 2.4, 0.7)
            axes.set_title(title)
        grid[0].set_ylim(*bulk_limits(pictured.without_um, 2.0 * pictured.noise_um))
        for axes in grid if narrow else grid[:1]:
            axes.set_ylabel(axis_text("residual (µm)"))
        for axes in grid[-1:] if narrow else grid:
            axes.set_xlabel(axis_text("voltage (V)"))

    return chart("branches", "the residual over the voltage", draw, WIDE_PX, 310, 460)


def as_map(pictured: PicturedRecord) -> Chart:
    """Return the rms of the residual over time and voltage, before and after on one scale."""

    def draw(figure: "Figure", narrow: bool) -> None:
        maps = [energy_map(pictured, values, MAP_COLUMNS[narrow]) for values, _ in _residuals(pictured)]
        strongest = float(np.nanquantile(maps[0], STRONG)) or 1.0
        shape = (len(maps), 1) if narrow else (1, len(maps))
        grid = np.atleast_1d(figure.subplots(*shape, sharex=True, sharey=True)).ravel()
        titles = ("recalibrated", "corrected")
        for axes, values, title in zip(grid, maps, titles, strict=False):
            axes.imshow(
                _shaded(values / strongest, light("without")),
                extent=(pictured.axis[0], pictured.axis[-1], pictured.acting_V.min(), pictured.acting_V.max()),
                origin="lower",
                aspect="auto",
                interpolation="none",
            )
            axes.set_title(title)
        _colour_bar(figure, list(grid), strongest)
        for axes in grid if narrow else grid[:1]:
            axes.set_ylabel(axis_text("voltage (V)"))
        for axes in grid[-1:] if narrow else grid:
            axes.set_xlabel(pictured.axis_label)

    return chart("map", "rms of the residual over time and voltage", draw, WIDE_PX, 250, 400)


def over_frequency(pictured: PicturedRecord) -> Chart | None:
    """Return the spectral density of the residual; None where rows are too few, without times, or met exactly."""
    if pictured.axis.size < FEWEST_ROWS or pictured.axis_label == "row":
        return None
    spectra = [(*banded_density(pictured.axis, values), colour) for values, colour in _residuals(pictured)]
    # nothing at all is left of what was met exactly, and nothing has no logarithm
    spectra = [x for x in spectra if np.any(x[1] > 0.0)]
    if not spectra:
        return None

    def draw(figure: "Figure", narrow: bool) -> None:
        del narrow
        axes = figure.subplots()
        for frequency, density, colour in spectra:
            axes.loglog(frequency, density, color=light(colour), lw=1.5)
        axes.set_ylim(bottom=0.5 * min(float(np.quantile(x[x > 0.0], 0.1)) for _, x, _ in spectra))
        step = float(np.median(np.diff(pictured.axis)))
        if pictured.noise_um:
            axes.axhline(pictured.noise_um * np.sqrt(2.0 * step), color=light("muted"), lw=1.0, ls=(0, (4, 3)))
        plain_logarithmic(axes)
        axes.set_xlabel("frequency (Hz)")
        axes.set_ylabel(axis_text("density (µm/√Hz)"))
        axes.margins(x=0.01)

    return chart("spectrum", "spectral density of the residual", draw, WIDE_PX, 270, 240)


def energy_map(pictured: PicturedRecord, values: Array, columns: int) -> Array:
    """Return the rms of values in cells of voltage (rows) and time (columns), NaN where there is no reading."""
    seen = np.isfinite(values)
    edges = [
        np.linspace(pictured.acting_V.min(), pictured.acting_V.max() + 1e-9, MAP_ROWS + 1),
        np.linspace(pictured.axis[0], pictured.axis[-1] + 1e-9, columns + 1),
    ]
    where = (pictured.acting_V[seen], pictured.axis[seen])
    count, *_ = np.histogram2d(*where, bins=edges)
    square, *_ = np.histogram2d(*where, bins=edges, weights=values[seen] ** 2)
    return np.sqrt(np.divide(square, count, out=np.full_like(square, np.nan), where=count > 0))


def banded_density(time_s: Array, values: Array) -> tuple[Array, Array]:
    """Return frequencies and one-sided spectral density (per root Hz) of the residual, in bands of equal ratio."""
    seen = np.isfinite(values)
    step = float(np.median(np.diff(time_s)))
    grid = np.arange(time_s[0], time_s[-1] + 0.5 * step, step)
    even = np.interp(grid, time_s[seen], values[seen])
    window = np.hanning(even.size)
    power = np.abs(np.fft.rfft((even - even.mean()) * window)) ** 2 * 2.0 * step / float(np.sum(window**2))
    frequency = np.fft.rfftfreq(even.size, step)
    first = 2
    edges = np.geomspace(frequency[first], frequency[-1] * (1.0 + 1e-9), BANDS + 1)
    band = np.digitize(frequency[first:], edges) - 1
    count = np.bincount(band, minlength=BANDS)[:BANDS]
    known = count > 0
    sums = [np.bincount(band, x[first:], BANDS)[:BANDS][known] / count[known] for x in (frequency, power)]
    return sums[0], np.sqrt(sums[1])


def _residuals(pictured: PicturedRecord) -> list[tuple[Array, str]]:
    found = [(pictured.without_um, "without")]
    return [*found, (pictured.with_um, "with")] if pictured.corrected else found


def _noise(axes: "Axes", pictured: PicturedRecord) -> None:
    axes.axhspan(-pictured.noise_um, pictured.noise_um, color=light("noise"), lw=0)


def _colour_bar(figure: "Figure", grid: "list[Axes]", strongest: float) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    colours = ListedColormap(_shaded(np.linspace(0.0, 1.0, COLOURS)[None, :], light("without"))[0])
    shades = ScalarMappable(Normalize(0.0, strongest), colours)
    figure.colorbar(shades, ax=grid, label=axis_text("rms of the residual (µm)"), extend="max", pad=0.02, aspect=16)


def _shaded(strength: Array, colour: str) -> Array:
    """Return an image of one colour whose opacity is the strength: it lies on any ground."""
    image = np.zeros((*strength.shape, 4))
    image[..., :3] = [int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5)]
    image[..., 3] = np.clip(np.nan_to_num(strength), 0.0, 1.0)
    return image


def _pieces(mask: Mask) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
