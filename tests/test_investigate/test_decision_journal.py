import json
from pathlib import Path

import pytest

from bender_investigate.journal import JOURNAL, DecisionJournal, check_decisions, read_decisions
from bender_loop.errors import InputError


def test_decisions_are_read_back_in_their_order(tmp_path):
    journal = DecisionJournal(tmp_path / JOURNAL)
    journal.write("play", "because", folder="01-rest", duration_s=3.0)
    journal.write("played", "as planned", rows=90)
    journal.close()
    found = read_decisions(tmp_path / JOURNAL)
    assert [x["kind"] for x in found] == ["play", "played"]
    assert found[0]["folder"] == "01-rest"
    assert [x["n"] for x in found] == [0, 1]


@pytest.mark.parametrize("cut", [1, 7, 30])
def test_a_line_that_a_crash_cut_short_is_taken_away(tmp_path, cut):
    path = tmp_path / JOURNAL
    journal = DecisionJournal(path)
    journal.write("play", "µm because", folder="01-rest")
    kept = path.read_bytes()
    journal.write("played", "as planned")
    journal.close()
    path.write_bytes(path.read_bytes()[: len(kept) + cut])
    again = DecisionJournal(path)
    assert [x["kind"] for x in again.decisions] == ["play"]
    assert path.read_bytes() == kept
    again.write("resumed", "goes on")
    again.close()
    assert [x["kind"] for x in read_decisions(path)] == ["play", "resumed"]


def test_a_damaged_line_in_the_middle_is_bad_input(tmp_path):
    path = tmp_path / JOURNAL
    lines = [json.dumps({"n": 0, "kind": "play", "why": ""}), "{]", json.dumps({"n": 2, "kind": "play", "why": ""})]
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match=r"line 2: found .* expected decision 1"):
        DecisionJournal(path)


def test_a_directory_without_a_journal_is_no_investigation(tmp_path):
    with pytest.raises(InputError, match="expected the directory of an investigation"):
        read_decisions(tmp_path / JOURNAL)


@pytest.mark.parametrize("content", [b"", b"\0" * 400, b"\n" * 3, b"\0" * 30 + b"\n"])
def test_nobody_goes_on_over_a_journal_that_was_lost(tmp_path: Path, content: bytes):
    (tmp_path / JOURNAL).write_bytes(content)
    (tmp_path / "play-01").mkdir()
    with pytest.raises(InputError, match=r"journal\.jsonl"):
        check_decisions(tmp_path / JOURNAL)


def test_an_investigation_that_was_ended_before_its_first_decision_is_gone_on_with(tmp_path: Path):
    for content in (b"", b'{"n": 0, "kin'):
        (tmp_path / JOURNAL).write_bytes(content)
        check_decisions(tmp_path / JOURNAL)
