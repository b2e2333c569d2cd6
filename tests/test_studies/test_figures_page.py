from pathlib import Path

from bender_loop.shell.progress import print_table
from bender_loop.shell.run import Run, running
from bender_studies.figures_page import write_figures


def printed(command: str, found: float) -> Run:
    with running(Run(command, quiet=True)) as run:
        print_table("What it costs", ("measured", "found"), [["a|b", found]])
        print_table("Every case", ("case", "found"), [["case-1", found]], of_cases=True)
    return run


def test_a_command_line_has_one_section_and_the_others_stay(tmp_path: Path):
    for command, found in (("bender benchmark x --seeds 1", 1.5), ("bender benchmark x --write-docs", 2.5)):
        write_figures(printed(command, found), "x", tmp_path)
    page = write_figures(
        printed(f"bender benchmark x --out {tmp_path} --seeds 1 --data {tmp_path} --write-docs d", 3.5), "x", tmp_path
    )
    write_figures(printed("bender benchmark x --quiet-rows 5 --quiet", 4.5), "x", tmp_path)
    text = page.read_text(encoding="utf-8")
    assert "## `bender benchmark x --quiet-rows 5`" in text
    assert text.count("## `bender benchmark x --seeds 1`") == text.count("## `bender benchmark x`") == 1
    assert ("1.5" in text, "2.5" in text, "3.5" in text) == (False, True, True)
    assert r"| a\|b | 3.5 |" in text
    assert "case-1" not in text
