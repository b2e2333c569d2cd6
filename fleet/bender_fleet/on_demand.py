"""Report pages of single units, drawn when somebody asks for them."""

import secrets
from collections.abc import Callable, Sequence
from pathlib import Path

from bender_fleet.asked import task_of
from bender_fleet.page.page import write_page
from bender_fleet.results.folder import read_fleet
from bender_fleet.results.parts import find_part, part_path, write_part
from bender_fleet.sources.keys import folder_name, key_of
from bender_fleet.sources.units import find_units
from bender_fleet.work.diagnose import DiagnoseWork
from bender_fleet.work.job import Job, run_job
from bender_loop.errors import InputError, RunError


def write_reports(out: Path, names: Sequence[str], say: Callable[[str], None]) -> int:
    """Diagnose units again as the fleet did, with their report pages, and make the fleet's page anew.

    Raises:
        InputError: the directory is not of a fleet that was diagnosed, it has no such unit, or a record has changed.
        RunError: a unit cannot be diagnosed.
    """
    told = read_fleet(out)
    if told is None or told["action"] != "diagnose":
        raise InputError(f"{out}: expected the output directory of bender fleet diagnose")
    task = task_of(told["asked"])
    units = {x.name: x for x in find_units(told["asked"]["source"])}
    for name in names:
        if name not in units:
            raise InputError(f"unit {name}: not in the fleet of {out}, expected one of its {len(units)} units")
        folder, (work, known, _) = folder_name(name), task(units[name])
        key = key_of(units[name].records, known)
        part = find_part(out, folder, key)
        if part is None:
            raise InputError(f"unit {name}: the record is new or has changed; run bender fleet diagnose first")
        if part.status != "done":
            raise RunError(f"unit {name}: there is nothing to report, it is {part.status}: {part.reason}")
        assert isinstance(work, DiagnoseWork)
        full = DiagnoseWork(work.model, work.reading, work.settings, report=True)
        say(f"unit {name}: diagnosing again, for the pictures")
        again = run_job(Job(name, folder, key, secrets.token_hex(6), units[name].records, full, None, again=True))
        if again.part is None or again.part.status != "done":
            raise RunError(f"unit {name}: {again.part.reason if again.part else 'no answer'}")
        write_part(out, folder, part, again.files)
        say(f"report: {part_path(out, folder, key).parent / 'report.html'}")
    write_page(out, "diagnose")
    return 0
