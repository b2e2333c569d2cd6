"""The tutorial's notebook and the program on the how-to page run as they stand."""

import json
import re
import shutil
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

from bender_loop.fmu.check.check import check

TUTORIAL = Path(__file__).parents[2] / "docs" / "tutorial" / "from_record_to_fmu.ipynb"


@pytest.mark.slow
# a kernel is started, talked to and stopped by libraries that warn of each other
@pytest.mark.filterwarnings("ignore")
def test_the_tutorial_ends_with_a_better_controller(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    # a notebook draws into its page
    monkeypatch.delenv("MPLBACKEND", raising=False)
    notebook = nbformat.read(TUTORIAL, as_version=4)
    notebook.cells.append(nbformat.v4.new_code_cell("[x.to_dict()['rms_um'] for x in loops.values()]"))
    resources = {"metadata": {"path": str(tmp_path)}}
    NotebookClient(notebook, timeout=280, kernel_name="python3", resources=resources).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    texts = [str(output.get("data", {}).get("text/plain", "")) for output in outputs]
    assert sum("image/png" in output.get("data", {}) for output in outputs) >= 4
    first_um, corrected_um = json.loads(texts[-1])
    assert corrected_um < 0.8 * first_um
    saved = tmp_path / "results" / "stage"
    told = json.loads((saved / "diagnosis.json").read_text(encoding="utf-8"))
    assert (told["effects"][0]["id"], told["effects"][0]["grade"]) == ("slew_limit", "certain")
    assert not check(saved / "model.fmu").faults
    assert (saved / "controller" / "gains.toml").is_file()


ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_the_program_of_the_page_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture):
    text = (ROOT / "docs" / "how-to" / "use-it-from-python.md").read_text(encoding="utf-8")
    (program,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    shutil.copy(ROOT / "examples" / "record.csv", tmp_path / "record.csv")
    monkeypatch.chdir(tmp_path)
    exec(compile(program, "use-it-from-python.md", "exec"), {"__name__": "__main__"})
    assert "named ['" in capsys.readouterr().out
    written = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    assert {"results/diagnosis/model.fmu", "results/diagnosis/report.html", "results/tune/gains.toml"} <= written
