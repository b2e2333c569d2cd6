"""`bender bench check`: what is connected, what it answers, what is missing, and two dry runs, on one page."""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

EXAMPLE = """\
bender bench check                                # the emulated bench
bender bench check --bench bench.toml --out results/check"""

STYLE = """
.ended { border-left: 4px solid var(--good); padding: .5rem .75rem; margin: 1rem 0; font-weight: 600; }
.ended.remarked { border-color: var(--caution); } .ended.tripped { border-color: var(--without); }
.findings { table-layout: fixed; width: 100%; margin-bottom: 18px; }
.findings td, .findings th { text-align: left; vertical-align: top; white-space: normal; overflow-wrap: anywhere; }
.findings th:nth-child(1) { width: 22%; } .findings th:nth-child(2) { width: 5.5em; }
.remark td:nth-child(2) { color: var(--caution); } .failed td:nth-child(2) { color: var(--without); font-weight: 600; }
@media (max-width: 40rem) {
  .findings tr:first-child { display: none; }
  .findings tr, .findings td { display: block; }
  .findings td { border: 0; padding: 0; } .findings td:empty { display: none; }
  .findings td:first-child { font-weight: 600; }
  .findings tr { border-bottom: 1px solid var(--rule); padding: .5rem 0; }
}
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare everything."""
    parser.add_argument("--bench", type=Path, metavar="FILE", help="bench file (default: the emulated bench)")
    parser.add_argument("--out", type=Path, metavar="DIR", help="default: results/check-DATE-TIME")
    parser.add_argument("--no-voltage", action="store_true", help="stay at 0 V: leave the second dry run out")


def run(arguments: argparse.Namespace, *, fmu: Callable[[str], Path]) -> int:
    """Check a bench; returns 0 where nothing failed, 1 where something did.

    Raises:
        InputError: the bench file is not fit, or the results cannot be written or lie where others are.
    """
    from datetime import datetime

    from bender_hil.bench_file import emulated_bench, read_bench
    from bender_hil.check.dry_runs import check_answer, check_at_rest, facts_of, noise_of
    from bender_hil.check.findings import FAILED, FINE, REMARK, Finding
    from bender_hil.runner.run_lock import sole_run_with_note
    from bender_loop.errors import InputError
    from bender_loop.shell.files import prepare_directory, write_atomically, write_result
    from bender_loop.shell.progress import print_table
    from bender_loop.shell.run import answer
    from bender_report.page import Link, render_template

    bench = emulated_bench() if arguments.bench is None else read_bench(arguments.bench)
    if bench.sensor is None:
        bench.load_calibration()
    else:
        bench.load_sensor_calibration()
    out: Path = arguments.out or Path("results") / f"check-{datetime.now().astimezone():%Y%m%d-%H%M%S}"
    if (out / "check.json").exists() or (out / "rest").exists():
        raise InputError(f"{out}: already holds a check; choose another directory with --out")
    prepare_directory(out)
    name = "the emulated bench" if arguments.bench is None else str(arguments.bench)
    findings = [Finding("bench file", FINE, f"{name} can be read")]
    with sole_run_with_note(bench.address, out, _say):
        found, log = check_at_rest(bench, out / "rest", fmu)
        findings += found
        if log is not None and not arguments.no_voltage and all(finding.state != FAILED for finding in found):
            findings += check_answer(bench, out, fmu, noise_of(log))
    failed = sum(finding.state == FAILED for finding in findings)
    remarks = sum(finding.state == REMARK and bool(finding.advice) for finding in findings)
    line = f"{failed} failed, {remarks} to look at" if failed or remarks else "everything answers"
    rows = [[finding.what, finding.state, finding.found, finding.advice] for finding in findings]
    write_result(out / "check.json", {"bench": name, "summary": line, "findings": facts_of(findings)})
    pages = sorted(out.glob("*/summary.html"))
    text = render_template(
        "check.html.j2",
        Path(__file__).parent,
        STYLE,
        title=f"Check of {name}",
        line=line,
        state="tripped" if failed else "remarked" if remarks else "",
        findings=findings,
        runs=[Link(f"run {path.parent.name}", path.relative_to(out).as_posix()) for path in pages],
    )
    write_atomically(out / "check.html", text)
    answer({"summary": line, "findings": facts_of(findings)})
    print_table(f"check of {name}", ["what", "state", "found", "what to do"], rows, of_sentences=True)
    sys.stdout.write(f"written: {out} (check.json, check.html, the runs)\n{line}\n")
    return int(failed > 0)


def _say(sentence: str) -> None:
    sys.stderr.write(f"bender: {sentence}\n")
