"""`bender benchmark constants`: what is changed is what decides, and nothing is said to differ that does not."""

import json
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import pytest
from told_diagnosis import record_of

from bender_cli.main import main
from bender_discrepancy.search.judgement.rules import RULES
from bender_loop.records.record import write_record
from bender_proving import cases
from bender_studies.hidden_effects import constants
from bender_studies.hidden_effects.constants import Changed, Compared, Said, changes, compared, totals

CHECK = """
from bender_studies.hidden_effects.constants import Changed, _change
_change(Changed("closes", 0.88))
from bender_discrepancy import input_hold
from bender_discrepancy.conclusion import coarse_readings, sentences
from bender_discrepancy.search import result
assert {x.RULES.closes for x in (input_hold, coarse_readings, sentences)} == {0.88}
assert result.Rules(confidence=0.9).closes == 0.88
"""


def test_every_constant_is_changed_by_its_part_or_by_what_it_lacks_to_one() -> None:
    found = changes(0.2, 0.99)
    assert [x.name for x in found] == [x.name for x in fields(RULES) for _ in range(2)]
    values = {(x.name, round(x.value, 6)) for x in found}
    assert {("confidence", 0.992), ("confidence", 0.988), ("closes", 0.92), ("closes", 0.88)} <= values
    assert {("inadequacy", 0.04), ("inadequacy", 0.06), ("fewer_numbers", 2.4), ("fewer_numbers", 3.6)} <= values


@pytest.mark.slow
def test_a_change_is_there_before_anything_reads_the_constant() -> None:
    subprocess.run([sys.executable, "-c", CHECK], check=True, timeout=120)


def test_rows_count_what_differs() -> None:
    one, other = Changed("closes", 0.88), Changed("closes", 0.92)
    creep, open_ = Said("named", ("creep",)), Said("unexplained")
    found = [Compared("a", ("creep",), one, creep, creep), Compared("b", ("creep",), one, creep, open_)]
    found.append(Compared("a", ("creep",), other, creep, Said("named", ("ageing",))))
    assert totals(found) == [["closes", "0.88", "2", "1", "50.0 %"], ["closes", "0.92", "1", "1", "100.0 %"]]
    assert [x.after.in_words for x in found] == ["creep", "unexplained", "ageing"]


@pytest.mark.slow
def test_an_answer_that_turns_on_a_constant_differs_and_one_that_does_not_is_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A gain that is off by a twentieth is worth a word, unless only what is ten thousand times the noise is."""
    case, record = next(iter(cases("nothing", [3]))), record_of(gain=1.05)
    monkeypatch.setattr(constants, "_written", lambda x, folder: _put(folder / x.id, record) or (x.id, ()))
    same, absurd = Changed("matters", RULES.matters), Changed("matters", 1e4)
    monkeypatch.setattr(constants, "changes", lambda *_: [same, absurd])
    found = list(compared([case], tmp_path, 1, 0.2))
    assert [(x.changed, x.before, x.after, x.differs) for x in found] == [
        (same, Said("recalibrated"), Said("recalibrated"), False),
        (absurd, Said("recalibrated"), Said("no_gap"), True),
    ]
    assert "entries" in json.loads((tmp_path / case.id / constants.JOURNAL).read_text(encoding="utf-8"))


def _put(folder: Path, record: object) -> None:
    folder.mkdir(parents=True)
    write_record(folder / constants.RECORD, record)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--kinds", "doubles"], "--kinds: found 'doubles'"),
        (["--each", "0"], "--each: found 0, expected at least 1"),
        (["--part", "1"], "--part: found 1, expected more than 0 and less than 1"),
        (["--first-seed", "-1"], "--first-seed: found -1"),
    ],
)
def test_bad_words_are_refused(words: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["benchmark", "constants", *words, "--out", str(out)]) == 2
    assert told in capsys.readouterr().err
    assert not out.exists()
