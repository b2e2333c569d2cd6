"""What a command asks of every unit, as `fleet.json` keeps it, and the work that follows from it."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bender_loop.fmu.start_values import start_values

if TYPE_CHECKING:
    from bender_fleet.run import Task
    from bender_fleet.sources.units import Unit
    from bender_fleet.work.reading import Reading


def asked_of(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return what `fleet.json` keeps of a command, so that a unit can be done again as it was."""
    from bender_loop.errors import InputError

    given = dict(vars(arguments))
    fmu = given.get("fmu")
    if fmu is not None and given["model"] is not None:
        raise InputError("--fmu and --model both name a model; give only one")
    values = start_values(arguments) if "set" in given else {}
    if fmu is None and (given.get("input") or given.get("output") or values or given.get("suspect")):
        raise InputError("--input, --output, --set, --suspect: found without --fmu, expected with it")
    if fmu is not None and given["no_shared_disk"]:
        raise InputError("--fmu: found with --no-shared-disk, expected a disk on which the workers see the FMU")
    names = (
        "action", "model", "input", "output", "input_hold", "untimed", "columns", "units", "delimiter", "decimal",
        "encoding", "skip_rows", "no_header", "start", "confidence", "highest_voltage", "reports", "seed",
        "between_false_alarms", "learn", "no_diagnosis",
    )  # fmt: skip
    kept = {name: given[name] for name in names if name in given}
    sources = [x if "://" in x else str(Path(x).absolute()) for x in given["source"]]
    return kept | {
        "source": sources,
        "fmu": None if fmu is None else str(Path(fmu).absolute()),
        "set": values,
        "suspect": list(given.get("suspect") or ()),
    }


def task_of(asked: dict[str, Any]) -> Callable[["Unit"], "Task"]:
    """Return what is done with a unit, as a command asked for it.

    Raises:
        InputError: at once, a setting is wrong; when called, the model of a unit cannot be read.
    """
    from functools import cache

    from bender_fleet.run import Task
    from bender_fleet.work.compare import CompareWork
    from bender_fleet.work.diagnose import DiagnoseWork, ForeignModel
    from bender_fleet.work.identify import IdentifyWork
    from bender_fleet.work.watch import WatchWork

    action, reading = asked["action"], _reading(asked)
    foreign = None
    if asked["fmu"] is not None:
        foreign = ForeignModel(
            asked["fmu"], asked["input"], asked["output"], tuple(asked["set"].items()), tuple(asked["suspect"])
        )
    settings = _settings(asked) if action == "diagnose" else None
    watch = _watch_settings(asked) if action == "watch" else None

    @cache
    def of_model(name: str) -> "Task":
        model, known = _model(name, foreign)
        known |= {"action": action, "reading": reading.to_dict()}
        if action == "compare":
            return Task(CompareWork(model, reading), known, name)
        if action == "identify":
            assert not isinstance(model, ForeignModel)
            return Task(IdentifyWork(model, reading, asked["seed"]), known | {"seed": asked["seed"]}, name)
        if watch is not None:
            every = asked["between_false_alarms"]
            return Task(WatchWork(model, reading, watch, every), known | {"watch": repr(watch), "every": every}, name)
        assert settings is not None
        work = DiagnoseWork(model, reading, settings, asked["reports"])
        return Task(work, known | {"settings": repr(settings)}, name)

    def task(unit: "Unit") -> "Task":
        if foreign is not None:
            return of_model(Path(foreign.path).name)
        return of_model(unit.model or asked["model"] or "paper")

    return task


def _model(name: str, foreign: Any) -> tuple[Any, dict[str, Any]]:
    """Return the model and what a key is made of."""
    from bender_fleet.sources.keys import file_digest
    from bender_inference.records.checks import read_model
    from bender_loop.errors import InputError

    if foreign is None:
        model = read_model(name)
        return model, {"model": model.to_table()}
    try:
        digest = file_digest(Path(foreign.path))
    except OSError as error:
        raise InputError(f"{foreign.path}: cannot be read ({error.strerror}); expected an FMU") from None
    return foreign, {
        "fmu": digest,
        "input": foreign.input,
        "output": foreign.output,
        "set": foreign.parameters,
        "suspects": foreign.suspects,
    }


def _reading(asked: dict[str, Any]) -> "Reading":
    from bender_fleet.work.reading import Reading
    from bender_loop.records.arguments import layout_of

    layout = layout_of(argparse.Namespace(**asked))
    return Reading(asked["columns"], asked["units"], layout, asked["input_hold"], asked["untimed"])


def _settings(asked: dict[str, Any]) -> Any:
    from bender_inference.settings import Settings

    hold = asked["input_hold"]
    return Settings(
        hold != "hold",
        asked["untimed"],
        asked["highest_voltage"],
        asked["start"],
        asked["confidence"],
        hold == "smooth",
    )


def _watch_settings(asked: dict[str, Any]) -> Any:
    from bender_loop.errors import InputError
    from bender_watch.settings import Settings, rows_of

    try:
        rows_of(asked["between_false_alarms"], 1.0)
    except InputError as error:
        raise InputError(f"--between-false-alarms: {error}") from None
    linear = asked["input_hold"] == "linear"
    return Settings(learn_rows=asked["learn"], linear=linear, diagnose=not asked["no_diagnosis"])
