"""The base is installed without what draws pictures: figures come all the same, with one sentence on the pictures."""

import json
import sys
from pathlib import Path

import pytest

import piezo_bender as pb
from bender_cli.main import main
from bender_loop.errors import InputError
from bender_report.chart import chart

RECORD = Path(__file__).parents[2] / "examples" / "record.csv"
SENTENCE = "matplotlib, which draws pictures, is not installed: python -m pip install "


@pytest.fixture(autouse=True)
def no_matplotlib(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    for name in [x for x in sys.modules if x.partition(".")[0] == "matplotlib"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(
    ("words", "written"),
    [
        (["compare", str(RECORD), "--out", "out"], ["comparison.json"]),
        (["effects", "creep", "--out", "out"], []),
        (
            ["tune", "--setpoint", "10", "--method", "zn", "--monte-carlo", "0", "--out", "out"],
            ["gains.toml", "tuning.json"],
        ),
    ],
    ids=lambda x: x[0] if x else "",
)
def test_a_command_writes_its_figures_and_says_how_pictures_come(words, written, capsys):
    assert main(words) == 0
    assert capsys.readouterr().out.count(SENTENCE) == 1
    found = {x.name for x in Path("out").iterdir()} if Path("out").is_dir() else set()
    assert found == set(written)


@pytest.mark.slow
def test_a_diagnosis_says_that_its_report_has_no_pictures(capsys):
    assert main(["diagnose", str(RECORD), "--out", "out"]) == 0
    assert capsys.readouterr().out.count(SENTENCE) == 1
    assert SENTENCE in (Path("out") / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("words", [["demo"], ["reproduce"], ["identify", str(RECORD)]], ids=str)
def test_what_is_nothing_without_pictures_is_refused_before_it_begins(words, capsys):
    assert main(words) == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert "needs matplotlib, which is not installed: python -m pip install" in said
    assert not any(Path().rglob("*.*"))


def test_a_page_says_what_a_chart_would_show():
    drawn = chart("residual", "the residual over <time>", lambda figure, narrow: pytest.fail("drawn"), 920, 270, 230)
    assert drawn.wide == drawn.narrow
    assert "the residual over &lt;time&gt;" in drawn.wide
    assert SENTENCE in drawn.wide


def test_the_notebook_saves_figures_and_refuses_to_plot():
    found = pb.compare(pb.load_record(RECORD), "paper")
    folder = found.save("saved")
    assert json.loads((folder / "comparison.json").read_text(encoding="utf-8"))
    assert not (folder / "overlay.png").exists()
    for draw in (found.plot, found.picture):
        with pytest.raises(InputError, match="needs matplotlib"):
            draw()
