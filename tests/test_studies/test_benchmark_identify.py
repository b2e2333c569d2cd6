"""`bender benchmark identify`: its claims that cost little, its table and its data."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from bender_cli.main import main
from bender_studies.benchmarks import identify_claims
from bender_studies.benchmarks.identify_claims import Claim, _refused


def test_what_cannot_teach_is_refused_with_the_reason() -> None:
    found = list(_refused())
    assert [claim.met for claim in found] == [True] * 3
    assert "excites nothing" in str(found[0].found)
    assert "stays at 3 µm" in str(found[1].found)


def test_the_table_and_the_data_say_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def few(*_: object) -> Iterator[Claim]:
        yield Claim("a", "<= 1", 2.0, False)
        yield Claim("b", "<= 1", "not here", None)

    monkeypatch.setattr(identify_claims, "claims", few)
    assert main(["benchmark", "identify", "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    data = json.loads((tmp_path / "out" / "identify.json").read_text(encoding="utf-8"))["claims"]
    assert [claim["met"] for claim in data] == [False, None]
    assert "NO" in said
    assert "not tried" in said
