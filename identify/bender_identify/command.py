"""`bender identify RECORD...`: the equation, the table of rivals, a model file, a report page and a picture."""

import argparse
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from bender_loop.records.arguments import add_record_arguments

if TYPE_CHECKING:
    from bender_identify.identification_result import Identification
    from bender_identify.records.experiment import Experiment
    from bender_identify.settings import Settings
    from bender_loop.records.record import Record
    from bender_plant.model import Model

HELP = "learn a hysteresis model from records"
EXAMPLE = "bender identify record.csv --out model.toml"
LEAST_UM_PER_V = 1e-3
"""A nanometre for a volt, as of the stiffest stacks; the fits take ever longer on less."""
MOST_SUB_STEPS = 7.5e6
"""Of one simulation of a record; they lie in memory, and a fit simulates some hundred times."""
LIBRARY_NAMES = ("auto", "paper", "bouc_wen", "combined", "polynomial")
KEPT_NAMES = ("auto", "sindy", "prandtl_ishlinskii", "bouc_wen", "first_order_lag")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the records, how they are read, what is learned, and where the results go."""
    parser.add_argument(
        "records", nargs="+", type=Path, metavar="RECORD", help="CSV: time_s, voltage_V, displacement_um"
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="MODEL",
        help="model file (default: results/identify-RECORD/model.toml, numbered where it exists)",
    )
    parser.add_argument(
        "--model", default="paper", help="model of supply, structure and sensor (default: paper, one particular device)"
    )
    parser.add_argument("--quasi-static", action="store_true", help="leave out the structure of the model")
    parser.add_argument(
        "--held-out", nargs="+", type=Path, default=[], metavar="RECORD", help="records for testing only"
    )
    add_record_arguments(parser)
    parser.add_argument(
        "--input-hold",
        choices=("hold", "linear", "smooth"),
        default="hold",
        help="voltage between two rows: held (a supply; default), linear, or smooth (band-limited, a generator's sine)",
    )
    parser.add_argument(
        "--untimed", action="store_true", help="times only give the order; each row is a voltage and a reading at rest"
    )
    _add_learning(parser)
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="seed of the resampling (default: 1)")


def _add_learning(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--library", choices=LIBRARY_NAMES, default="auto", help="candidate terms (default: auto)")
    parser.add_argument("--terms", metavar="LIST", help="your own candidate terms, such as \"w, u, u', w |u'|\"")
    parser.add_argument("--ensemble", type=int, default=50, metavar="N", help="number of resamples (default: 50)")
    parser.add_argument(
        "--held-out-share",
        type=float,
        default=0.4,
        metavar="X",
        help="share at the end of a single record that is held out (default: 0.4)",
    )
    parser.add_argument("--set-aside", type=float, metavar="S", help="seconds at the start to leave out")
    parser.add_argument("--delay", default="0", metavar="S", help="transport delay in s, or auto (default: 0)")
    parser.add_argument(
        "--keep", choices=KEPT_NAMES, default="auto", help="which candidate becomes the model file (default: auto)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Identify, print, and write the model file with its report, picture and figures beside it.

    Raises:
        InputError: a record or an option cannot be used.
        RunError: no model that a model file can hold follows the records.
    """
    import numpy as np

    from bender_identify.identification import identify
    from bender_loop.shell.files import unused
    from bender_loop.shell.progress import Progress

    settings, base = _settings(arguments), _base(arguments)
    if arguments.out is None:
        arguments.out = unused(Path("results") / f"identify-{arguments.records[0].stem}") / "model.toml"
    _check_distinct([*arguments.records, *arguments.held_out])
    _check_place(_places(arguments)["model"])
    experiments = [_experiment(arguments, path, settings, base) for path in arguments.records]
    held_out = [_experiment(arguments, path, settings, base) for path in arguments.held_out]
    steps = 0
    with Progress("identify") as bar:

        def progress(text: str) -> None:
            nonlocal steps
            steps += 1
            bar.update(steps, None, text)

        outcome = identify(experiments, base, settings, np.random.default_rng(arguments.seed), held_out, progress)
    written = _write(arguments, outcome)
    _print(outcome, written)
    return 0


def _settings(arguments: argparse.Namespace) -> "Settings":
    from bender_identify.settings import Settings
    from bender_loop.errors import InputError

    if arguments.seed < 0:
        raise InputError(f"--seed: found {arguments.seed}, expected 0 or more")
    terms = tuple(t.strip() for t in arguments.terms.split(",")) if arguments.terms is not None else ()
    try:
        return Settings(
            library=arguments.library,
            terms=terms,
            ensemble=arguments.ensemble,
            held_out_share=arguments.held_out_share,
            set_aside_s=arguments.set_aside,
            delay_s=None if arguments.delay == "auto" else _seconds(arguments.delay),
            keep=arguments.keep,
        )
    except ValueError as error:
        raise InputError(_in_options(str(error))) from None


def _in_options(sentence: str) -> str:
    """Return what the settings say with the field's name as it stands on the command line."""
    field, colon, rest = sentence.partition(":")
    option = field.removeprefix("sparse_equation.").removesuffix("_s").replace("_", "-")
    return f"--{option}{colon}{rest}"


def _seconds(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"delay: found {text!r}, expected seconds or auto") from None


def _base(arguments: argparse.Namespace) -> "Model":
    from bender_identify.fitting.resimulation import quasi_static
    from bender_loop.errors import InputError
    from bender_plant.model import ModelError, load_model

    try:
        model = load_model(arguments.model)
    except ModelError as error:
        raise InputError(f"--model: {error}") from None
    return quasi_static(model) if arguments.quasi_static else model


def _check_distinct(paths: list[Path]) -> None:
    """Refuse a record named twice: its rows would be fitted and held out at once."""
    from bender_loop.errors import InputError

    seen: set[Path] = set()
    for path in paths:
        place = Path(os.path.realpath(path))
        if place in seen:
            raise InputError(f"{path}: named twice, expected each record once: held-out rows must not be fitted")
        seen.add(place)


def _check_place(model: Path) -> None:
    """Refuse another ending than that of a model file: it may be a record, or a directory that is not there yet."""
    from bender_loop.errors import InputError

    if model.suffix != ".toml" or model.is_dir():
        raise InputError(f"--out: found {model}, expected the name of a file that ends with .toml, or a directory")


def _experiment(arguments: argparse.Namespace, path: Path, settings: "Settings", base: "Model") -> "Experiment":
    from bender_loop.records.arguments import record_of
    from bender_loop.records.sizes import check_readings, check_work
    from bender_plant.plant import sub_step_bounds_s

    record = record_of(arguments, path)
    check_readings(path.name, record)
    if not arguments.untimed:
        duration_s = float(record.time_s[-1] - record.time_s[0])
        check_work(path.name, duration_s, sub_step_bounds_s(base)[1], MOST_SUB_STEPS)
    experiment = _made(record, path, arguments, settings)
    _refuse_implausible_gain(path, record)
    return experiment


def _refuse_implausible_gain(path: Path, record: "Record") -> None:
    """Refuse readings smaller than any piezo actuator gives: most likely they are in other units."""
    import numpy as np

    from bender_loop.errors import InputError

    span_V = float(np.ptp(record.voltage_V))
    span_um = float(np.nanmax(record.displacement_um) - np.nanmin(record.displacement_um))
    if span_um / span_V < LEAST_UM_PER_V:
        raise InputError(
            f"{path.name}: displacement_um moves over {span_um:.3g} µm for {span_V:.3g} V, "
            f"{span_um / span_V:.2g} µm/V; expected at least {LEAST_UM_PER_V:g}; "
            "say what units the columns have, as in --units s,V,mm"
        )


def _made(record: "Record", path: Path, arguments: argparse.Namespace, settings: "Settings") -> "Experiment":
    from bender_identify.records.experiment import experiment_of

    return experiment_of(record, path.name, settings, arguments.input_hold, arguments.untimed)


def _places(arguments: argparse.Namespace) -> dict[str, Path]:
    """Return where everything goes; the model file first, its companions beside it and named after it."""
    from bender_identify.settings import COMPANIONS

    out: Path = arguments.out
    model = out / "model.toml" if out.is_dir() else out
    return {
        "model": model,
        **{kind: model.with_name(f"{model.stem}{ending}") for kind, ending in COMPANIONS.items()},
    }


def _write(arguments: argparse.Namespace, outcome: "Identification") -> dict[str, Path]:
    from bender_identify.report.files import contents
    from bender_loop.shell.files import keep_earlier, prepare_directory, write_atomically

    places = _places(arguments)
    folder = prepare_directory(places["model"].parent)
    keep_earlier(folder, places["figures"].name, [x.name for kind, x in places.items() if kind != "figures"])
    for name, content in contents(outcome, places["model"].stem).items():
        write_atomically(places["model"].parent / name, content)
    return places


def _print(outcome: "Identification", written: dict[str, Path]) -> None:
    from bender_identify.report.figures import COLUMNS, table
    from bender_loop.shell.progress import print_table
    from bender_report.wording import unit_text

    for row in (outcome.rows[0], outcome.written)[: 1 if outcome.written is outcome.rows[0] else 2]:
        sys.stdout.write(f"{row.candidate.title}\n  {row.candidate.equation}\n")
        for c in row.candidate.coefficients if row is outcome.rows[0] else ():
            width = "" if c.half_width is None else f" ± {c.half_width:.2g}"
            sys.stdout.write(f"    {c.name:>10}  {c.value:.5g}{width} {unit_text(c.unit)}\n")
    if any(c.half_width is not None for c in outcome.rows[0].candidate.coefficients):
        sys.stdout.write("  ± is an interval of 95 % for all of them together\n")
    print_table("re-simulated displacement (* is written)", COLUMNS, table(outcome))
    sys.stdout.write(
        f"held out: {outcome.held_out_by}; floor {outcome.floor_percent:.3g} %\n"
        + "".join(f"note: {line}\n" for line in outcome.findings)
        + f"written: {', '.join(str(path) for path in written.values())}\n"
    )
