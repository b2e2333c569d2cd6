"""`bender diagnose --fmu F --output A --output B`: several outputs, each by itself and all together."""

import argparse
import shutil
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bender_discrepancy.diagnosis import Diagnosis
    from bender_discrepancy.foreign.outputs import Together
    from bender_inference.settings import Settings
    from bender_loop.errors import RunError
    from bender_loop.records.record import Record

OUTPUTS, REPORT = "outputs.json", "report.html"
INTERRUPTED = 130


def diagnosed_outputs(
    arguments: argparse.Namespace, columns: Mapping[str, str], parameters: Mapping[str, float], settings: "Settings"
) -> int:
    """Diagnose several outputs of an FMU; write a folder for each, and what they say together.

    Args:
        arguments: of `bender diagnose`.
        columns: of the readings, by the name of the output.
        parameters: of the FMU, by name.
        settings: how records are read.

    Returns:
        0, or 130 after an interrupt, with the outputs that are complete and what `--resume` goes on from.

    Raises:
        InputError: the FMU, a record or the output directory will not do; nothing was written.
        RunError: the FMU failed; the outputs that are complete are written.
        KeyboardInterrupt: before an output was complete.
    """
    from bender_discrepancy.output_folder import all_or_no_files
    from bender_inference.fitting.journal import UNFINISHED
    from bender_loop.errors import RunError
    from bender_loop.shell.run import going_on

    folders = _folders(arguments, columns)
    records = _records(arguments, columns)
    with all_or_no_files(arguments.out) as stage:
        kept = _Kept(stage, folders)
        found, problem = _found(arguments, records, parameters, settings, kept)
        if found is not None:
            kept.together(found)
        elif problem is None:
            kept.unfinished()
        for name in kept.done:  # of the run that goes on
            shutil.rmtree(arguments.out / folders[name], ignore_errors=True)
    told = f"the diagnoses of {', '.join(kept.done)} are in {arguments.out}"
    if problem is not None:
        raise RunError(f"{problem}; {told}")
    if found is None:
        sys.stderr.write(f"bender: interrupted; {told}; go on with: {going_on('--resume', arguments.out)}\n")
        return INTERRUPTED
    (arguments.out / UNFINISHED).unlink(missing_ok=True)
    _say(found, arguments.out)
    return 0


class _Kept:
    """What is complete: a folder for each output, and in the end what all of them say."""

    def __init__(self, stage: Path, folders: Mapping[str, str]) -> None:
        self._stage, self._folders = stage, folders
        self.done: list[str] = []

    def __call__(self, name: str, diagnosis: "Diagnosis") -> None:
        folder = self._stage / self._folders[name]
        folder.mkdir()
        diagnosis.write(folder)
        self.done.append(name)

    def together(self, found: "Together") -> None:
        """Write what all outputs say together."""
        from bender_discrepancy.foreign.outputs_report import write

        write(found, self._folders, self._stage)

    def unfinished(self) -> None:
        """Write what was fitted so far, for `--resume`."""
        from bender_inference.fitting.journal import UNFINISHED, current_journal
        from bender_loop.shell.files import write_atomically

        journal = current_journal()
        if journal is not None:
            write_atomically(self._stage / UNFINISHED, journal.to_json())


def _folders(arguments: argparse.Namespace, columns: Mapping[str, str]) -> dict[str, str]:
    """Return the folder of each output, where nothing stands in the way."""
    from bender_discrepancy.foreign.outputs_report import folders_of
    from bender_loop.errors import InputError

    if arguments.fmu is None:
        raise InputError(f"--output: found {len(columns)} without --fmu, expected an FMU that has them")
    folders = folders_of(list(columns))
    if arguments.out == arguments.resume:
        return folders
    for folder in folders.values():
        if (arguments.out / folder).exists():
            raise InputError(f"{arguments.out / folder}: is there already; choose another --out")
    return folders


def _found(
    arguments: argparse.Namespace,
    records: "Mapping[str, Sequence[Record]]",
    parameters: Mapping[str, float],
    settings: "Settings",
    kept: _Kept,
) -> "tuple[Together | None, RunError | None]":
    """Return what all outputs say; None after an interrupt or a failure that left complete ones, with the failure."""
    from bender_discrepancy.foreign.outputs import diagnose_outputs
    from bender_loop.errors import RunError
    from bender_loop.shell.progress import Progress

    names = [str(path) for path in arguments.record]
    with Progress("diagnose, outputs") as bar:

        def tell(text: str) -> None:
            bar.update(len(kept.done), len(records), text)

        try:
            return diagnose_outputs(
                arguments.fmu, arguments.input, records, settings, tell, names, parameters, kept, arguments.suspect
            ), None  # fmt: skip
        except KeyboardInterrupt:
            if not kept.done:
                # what was ranked is of one output: it is no diagnosis of all of them
                raise KeyboardInterrupt from None
            return None, None
        except RunError as problem:
            if not kept.done:
                raise
            return None, problem


def _say(found: "Together", out: Path) -> None:
    from bender_discrepancy.foreign.outputs_report import summary

    sys.stdout.write("\n".join([*summary(found), f"written: {out / OUTPUTS}, {out / REPORT}"]) + "\n")


def _records(arguments: argparse.Namespace, columns: Mapping[str, str]) -> "dict[str, Sequence[Record]]":
    from bender_loop.records.arguments import record_of
    from bender_loop.records.common_units import in_units_of

    names = [str(path) for path in arguments.record]
    return {
        name: in_units_of([record_of(arguments, path, column, name) for path in arguments.record], None, names)
        for name, column in columns.items()
    }
