"""Pages of figures: the tables that a benchmark has printed, with version, date, machine and command line."""

import os
import platform
import re
from pathlib import Path

from bender_loop.shell.files import prepare_directory, write_atomically
from bender_loop.shell.run import Run, Table, version

_UNQUOTED = re.compile(r"\s--(?:write-docs|out|log|data)(?:[= ](?!-)\S+)?|\s--(?:quiet|verbose|json)(?![-\w])")


def write_figures(run: Run, name: str, folder: Path) -> Path:
    """Put the tables of a run on the page of its benchmark, in place of those of the same command line.

    Tables of single cases stay in the terminal and in the JSON.

    Args:
        run: the run that has printed them.
        name: of the benchmark.
        folder: of the pages.
    """
    path = prepare_directory(folder) / f"{name}.md"
    sections = _sections(path.read_text(encoding="utf-8")) if path.is_file() else {}
    command = _UNQUOTED.sub("", run.command)
    sections[command] = "\n\n".join([_measured(run), *(_markdown(x) for x in run.tables if not x.of_cases)])
    text = "\n\n".join(f"## `{heading}`\n\n{body}" for heading, body in sections.items())
    write_atomically(path, f"# `bender benchmark {name}`\n\n{text}\n")
    return path


def _sections(text: str) -> dict[str, str]:
    parts = re.split(r"^## `(.+)`$", text, flags=re.MULTILINE)
    return {heading: body.strip() for heading, body in zip(parts[1::2], parts[2::2], strict=True)}


def _measured(run: Run) -> str:
    machine = f"{_processor()}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}"
    return f"Version {version()}, {run.began:%Y-%m-%d}; {machine}."


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    models = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(models, platform.machine())


def _markdown(table: Table) -> str:
    rows = [table.columns, ["---" if not right else "---:" for right in table.right], *table.rows]
    lines = ["| " + " | ".join(cell.replace("|", r"\|") for cell in row) + " |" for row in rows]
    return f"**{table.title}**\n\n" + "\n".join(lines)
