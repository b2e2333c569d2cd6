"""Words that no study can use: one line that names them, exit status 2, and nothing written."""

from pathlib import Path

import pytest
from few import few_rows

from bender_cli.main import main

WORDS = [
    ("benchmark tuner --methods annealing", "annealing"),
    ("benchmark tuner --seeds 0", "seeds"),
    ("benchmark speed --repeats 0", "repeats"),
    ("benchmark vision --frames 0", "--frames: found"),
    ("benchmark diagnose --parts all", "--parts"),
    ("benchmark constants --part 1", "--part: found 1, expected more than 0 and less than 1"),
    ("benchmark discrepancy --kinds twins", "expected"),
    ("benchmark discrepancy --suspects 2 --effects creep", "expected --kinds or --intervals"),
    ("benchmark devices --only toaster", "found 'toaster', expected one of 'hairdryer'"),
    ("benchmark devices --drawn 1 --only valve", "--drawn"),
    ("benchmark nonlinear --data .", "silverbox_multisine.csv"),
    ("benchmark identify --seeds 0", "--seeds: found 0"),
    ("benchmark hil --parts weather", "--parts: found 'weather'"),
    ("gallery cyclotron", "expected one of damper"),
    ("gallery servo --seed -1", "--seed: found -1, expected 0 or more"),
    ("reproduce --seed -1", "-1"),
]


@pytest.mark.parametrize(("words", "said"), few_rows(WORDS, 0, 3, 6, 9, 11, 13, 15))
def test_words_that_cannot_be_used_are_one_line_and_nothing_is_written(
    words: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([*words.split(), "--out", "out"]) == 2
    line = capfd.readouterr().err
    assert said in line
    assert len(line.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []
