"""`bender calibrate --sensor`: what a sensor's unit is worth, from two points or a table."""

import argparse
import math
import sys
from dataclasses import asdict
from pathlib import Path

from bender_hil.calibration.command import refuse_bad_out
from bender_hil.calibration.sensor_scale import LARGEST_DEGREE, SensorCalibration, fit_sensor
from bender_loop.errors import InputError
from bender_loop.shell.files import prepare_directory, write_atomically
from bender_loop.shell.progress import print_table
from bender_loop.shell.run import answer
from bender_loop.tables.table import read_table
from bender_report.drawing import can_draw, no_pictures

_SHOWN = 5
_BOW = 0.002
"""A residual above this share of the span is worth a curve."""


def calibrate_sensor(arguments: argparse.Namespace) -> int:
    """Fit, print, write; returns the exit status.

    Raises:
        InputError: points that make no calibration, or a value out of its bounds.
    """
    refuse_bad_out(arguments)
    if arguments.picture or arguments.camera is not None or arguments.emulated:
        raise InputError("--sensor: stands beside pictures, --camera or --emulated; calibrate one thing at a time")
    if not 1 <= arguments.degree <= LARGEST_DEGREE:
        raise InputError(f"--degree: found {arguments.degree}, expected 1 to {LARGEST_DEGREE}")
    if not (math.isfinite(arguments.reference_um) and arguments.reference_um >= 0.0):
        raise InputError(f"--reference-um: found {arguments.reference_um}, expected at least 0")
    if not arguments.unit or not arguments.unit.isprintable():
        raise InputError(f"--unit: found {arguments.unit!a}, expected the name of a unit")
    readings, displacements_um = _points(arguments.sensor)
    try:
        fit = fit_sensor(
            readings,
            displacements_um,
            arguments.unit,
            degree=arguments.degree,
            reference_um=arguments.reference_um,
            source=" ".join(arguments.sensor)[:200],
        )
    except ValueError as error:
        raise InputError(f"--sensor: {error}") from None
    prepare_directory(arguments.out.parent)
    written = [arguments.out]
    if can_draw():
        from bender_hil.calibration.sensor_picture import sensor_picture

        written.append(arguments.out.with_suffix(".png"))
        write_atomically(written[-1], sensor_picture(fit, readings, displacements_um))
    fit.save(arguments.out)
    names = [str(path) for path in written]
    answer(asdict(fit) | {"span_um": fit.span_um, "span_percent": fit.span_percent, "written": names})
    _print(fit)
    sys.stdout.write(f"written: {', '.join(names)}\n" + ("" if can_draw() else f"{no_pictures()}\n"))
    return 0


def _points(words: list[str]) -> tuple[list[float], list[float]]:
    """Readings and displacements, from a file or from the words themselves."""
    if len(words) == 1 and ":" not in words[0]:
        table = read_table(Path(words[0]))
        return table.numbers("reading").tolist(), table.numbers("displacement_um").tolist()
    pairs = []
    for word in words:
        first, _, second = word.partition(":")
        try:
            pairs.append((float(first), float(second)))
        except ValueError:
            raise InputError(
                f"--sensor: found {word!r:.60}, expected READING:UM such as 0.512:0, or one CSV file"
            ) from None
    return [reading for reading, _ in pairs], [place_um for _, place_um in pairs]


def _print(fit: SensorCalibration) -> None:
    span_um = fit.span_um
    rows: list[list[str | float | int | None]] = [
        ["scale over the span", f"{span_um / (fit.high - fit.low):.6g}", f"µm/{fit.unit}"],
        ["its standard uncertainty", f"{fit.span_percent:.4f}", "%"],
        ["residual", f"{fit.residual_um:.4f}", "µm rms"],
        ["points", fit.points, ""],
    ]
    for k in range(_SHOWN):
        reading = fit.low + (fit.high - fit.low) * k / (_SHOWN - 1)
        place = f"{fit.to_um(reading):.4f} ± {fit.uncertainty_um(reading):.4f}"
        rows.append([f"at {reading:.4g} {fit.unit}", place, "µm"])
    print_table("Calibration of the sensor", ("what", "value", "unit"), rows)
    if fit.reference_um == 0.0:
        sys.stdout.write("note: the uncertainty leaves out the reference itself; add its own with --reference-um\n")
    if len(fit.coefficients_um) == 2 and fit.residual_um > _BOW * abs(span_um):
        sys.stdout.write(
            f"note: the points lie {100.0 * fit.residual_um / abs(span_um):.2f} % of the span beside the line; try "
            "--degree 2\n"
        )
