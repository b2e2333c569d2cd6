"""A diagnosis of several outputs that is interrupted goes on with what it names: `--resume`."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from foreign_fmus import arm_fmu, needs_compiler

from bender_cli.main import main
from bender_discrepancy.fitting.journal import UNFINISHED, current_journal
from bender_discrepancy.foreign import outputs, outputs_report
from bender_discrepancy.search.result import Interrupted

pytestmark = needs_compiler
TWO = ["--input", "command", "--output", "tip", "--output", "force"]


class _Diagnosed:
    """The diagnosis of one output."""

    def __init__(self, text: str) -> None:
        self._text = text

    def write(self, folder: Path) -> None:
        (folder / "diagnosis.json").write_text(self._text, encoding="utf-8")


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return arm_fmu(tmp_path_factory.mktemp("foreign") / "arm.fmu")


@pytest.fixture
def words(arm: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    record = tmp_path / "record.csv"
    rows = np.column_stack([0.02 * np.arange(100), *np.random.default_rng(1).standard_normal((3, 100))])
    head = "time [s],command [V],tip [mm],force [N]"
    np.savetxt(record, rows, fmt="%.9g", delimiter=",", header=head, comments="")
    monkeypatch.setattr(outputs_report, "write", lambda _found, _folders, out: (out / "outputs.json").write_text("{}"))
    monkeypatch.setattr(outputs_report, "summary", lambda _found: ["named"])
    return ["diagnose", str(record), "--fmu", str(arm), *TWO]


def _told(monkeypatch: pytest.MonkeyPatch, function: Callable[[Callable[..., None]], object]) -> None:
    """Let a function of `keep` stand for the diagnosis."""
    monkeypatch.setattr(outputs, "diagnose_outputs", lambda *given: function(given[-2]))


@pytest.mark.parametrize("complete", [[], ["tip"]])
def test_what_an_interrupt_advises_works(
    words: list[str],
    complete: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / "out"

    def interrupted(keep: Callable[..., None]) -> None:
        journal = current_journal()
        assert journal is not None
        journal.entries["fit"] = [1.0]
        for name in complete:
            keep(name, _Diagnosed("first"))
        raise Interrupted(SimpleNamespace())  # type: ignore[arg-type]

    _told(monkeypatch, interrupted)
    assert main([*words, "--out", str(out)]) == 130
    assert f"go on with --resume {out}" in capsys.readouterr().err
    assert {x.name for x in out.iterdir()} == {*complete, UNFINISHED}

    def ended(keep: Callable[..., None]) -> object:
        journal = current_journal()
        assert journal is not None
        assert journal.recall("fit") == [1.0]
        for name in ("tip", "force"):
            keep(name, _Diagnosed("again"))
        return SimpleNamespace()

    _told(monkeypatch, ended)
    assert main([*words, "--resume", str(out)]) == 0
    assert {x.name for x in out.iterdir()} == {"tip", "force", "outputs.json"}
    assert (out / "tip" / "diagnosis.json").read_text(encoding="utf-8") == "again"


def test_without_resume_an_earlier_diagnosis_stays(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "out" / "tip").mkdir(parents=True)
    assert main([*words, "--out", str(tmp_path / "out")]) == 2
    assert "is there already; choose another --out" in capsys.readouterr().err
