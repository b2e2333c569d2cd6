"""Files that are written whole or not at all, and text files that are read within bounds."""

import contextlib
import json
import math
import os
import secrets
from argparse import Namespace
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from bender_loop.errors import InputError
from bender_loop.shell.bounded import in_one_line, read_bounded
from bender_loop.shell.run import answer, current, note_written, remark, with_provenance


def write_atomically(path: Path, data: str | bytes) -> None:
    """Write `data` to `path` by way of a temporary name in the same directory.

    Text is encoded as UTF-8, a question mark for what is no character (as in a file name that is none), and its line
    ends are kept as they are. A file that was there before is replaced in
    one move; when anything fails it stays as it was and nothing else is left behind.

    Raises:
        InputError: the directory is missing or cannot be written, or `path` is a directory.
    """
    path = Path(path)
    payload = data.encode("utf-8", "replace") if isinstance(data, str) else data
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")
    try:
        temporary.write_bytes(payload)
        os.replace(temporary, path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error}); choose another place") from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()
    note_written(path)


def finite(value: Any) -> Any:
    """Return the same with None for every number that is NaN or infinite, which JSON does not know."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return value


def result_text(facts: Mapping[str, Any], *, default: Callable[[object], object] | None = None, indent: int = 2) -> str:
    """Return the content of a JSON file: facts with their provenance; `--json` prints the same.

    Args:
        facts: what JSON can hold.
        default: makes something that JSON can hold of what it cannot.
        indent: of a level.

    Raises:
        ValueError: a number is not finite.
    """
    text = json.dumps(with_provenance(facts), indent=indent, ensure_ascii=False, allow_nan=False, default=default)
    answer(json.loads(text))
    return text + "\n"


def write_result(path: Path, facts: Mapping[str, Any]) -> None:
    """Write facts with their provenance as a JSON file, and answer with them.

    Raises:
        InputError: the file cannot be written.
        ValueError: a number is not finite.
    """
    write_atomically(path, result_text(facts))


def prepare_directory(path: Path) -> Path:
    """Create the directory `path` with its parents where it is missing and try that files can be made in it.

    Call it after the input has been checked: the directory is the first thing that a command writes.

    Raises:
        InputError: the directory cannot be created or written, or the name belongs to a file.
    """
    path = Path(path)
    probe = path / f".{secrets.token_hex(4)}.tmp"
    try:
        path.mkdir(parents=True, exist_ok=True)
        probe.touch(exist_ok=False)
        probe.unlink()
    except OSError as error:
        raise InputError(
            f"{path}: cannot be used as output directory ({error.strerror or error}); choose another one"
        ) from error
    return path


def check_directory(path: Path) -> None:
    """Refuse, before any work, a directory that could not be made; nothing is made yet.

    Raises:
        InputError: the name, or that of a parent, belongs to something else than a directory, or cannot be written.
    """
    there = next((x for x in (path, *path.absolute().parents) if os.path.lexists(x)), None)
    if there is not None and not (os.path.isdir(there) and os.access(there, os.W_OK)):
        reason = "is not writable" if os.path.isdir(there) else "is no directory"
        raise InputError(f"{path}: cannot be used as output directory ({there} {reason}); choose another one")


def unused(path: Path) -> Path:
    """Return a path where nothing is yet: this one, or the first free one with a number behind it, from 2 on.

    For results whose place the user did not name: those of an earlier run stay, and do not mix with new ones.
    """
    number, found = 1, path
    while found.exists():
        number += 1
        found = path.with_name(f"{path.name}-{number}")
    return found


def results_folder(arguments: Namespace) -> Path:
    """Return the folder of the results of a command with `add_results_arguments`, and keep it in `arguments.out`.

    Raises:
        InputError: `--out` names a folder that holds something, without `--force`.
    """
    if arguments.out is None:
        arguments.out = unused(arguments.usual_out)
    elif not arguments.force and arguments.out.is_dir() and any(arguments.out.iterdir()):
        raise InputError(
            f"{arguments.out}: holds the results of an earlier run, expected an empty folder or a new one; choose "
            "another with --out, or overwrite it with --force"
        )
    return arguments.out


def keep_earlier(out: Path, result: str, others: Iterable[str] = ()) -> None:
    """Move the results of another question in a folder into `earlier` below it, numbered where that exists, and say so.

    Results of the same command line on the same files stay where they are: the new ones replace them.

    Args:
        out: the folder that is about to be written to.
        result: name of the JSON file with the provenance.
        others: names of the files that belong to it.

    Raises:
        InputError: they cannot be moved.
    """
    if not (out / result).is_file() or _asks_the_same(out / result):
        return
    place = unused(out / "earlier")
    try:
        place.mkdir()
        for name in (result, *others):
            if (out / name).exists():
                os.replace(out / name, place / name)
    except OSError as error:
        raise InputError(
            f"{out}: earlier results cannot be moved ({error.strerror or error}); choose another"
        ) from error
    remark(f"{out}: earlier results of another command line or other files were moved to {place}")


def _asks_the_same(path: Path) -> bool:
    run = current()
    try:
        found = json.loads(path.read_text(encoding="utf-8"))["provenance"]
        return run is not None and (found["command"], found["inputs"]) == (run.command, run.inputs)
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return False


def read_text_file(path: Path, most_bytes: int, what: str) -> str:
    """Return the text of a regular file, without a byte order mark; line ends are kept as they are.

    Nothing is waited for and no more than `most_bytes` + 1 bytes are ever read: a pipe, a device, a folder and a file
    that is too large are refused. Text is UTF-8 without NUL characters.

    Args:
        path: of the file.
        most_bytes: size of the largest file that is read.
        what: what the file should be, for the message, such as "a bench file (TOML)".

    Raises:
        InputError: the file cannot be opened, is not a regular file, is too large, or is not such text.
    """
    name = in_one_line(path)
    data = read_bounded(path, most_bytes, what)
    if (place := data.find(0)) >= 0:
        raise InputError(f"{name}: byte {place} is NUL, expected {what} in UTF-8")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{name}: byte {error.start} is not UTF-8 text, expected {what}") from error
