"""`bender benchmark constants`: what is changed is what decides, and nothing is said to differ that does not."""

import json
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import pytest
from reported_diagnosis import record_of

from bender_inference.search.judgement.rules import RULES
from bender_loop.records.record import write_record
from bender_proving import cases
from bender_studies.hidden_effects import constants
from bender_studies.hidden_effects.constants import Changed, Said, changes, compared

CHECK = """
from bender_studies.hidden_effects.constants import Changed, _change
_change(Changed("closes", 0.88))
from bender_inference import input_hold
from bender_discrepancy.conclusion import coarse_readings, sentences
from bender_inference.search import result
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
