"""The gains that come with the bench are those that the command in their file gives."""

import shlex
from pathlib import Path

import pytest

from bender_cli.main import main
from bender_hil.command import OWN_GAINS
from bender_tuner.results.gains_file import read_gains


@pytest.mark.slow
def test_the_gains_of_the_package_can_be_tuned_again(tmp_path: Path):
    first = OWN_GAINS.read_text(encoding="utf-8").splitlines()[0]
    program, *words = shlex.split(first.removeprefix("#"))
    assert program == "bender"
    assert main([*words, "--out", str(tmp_path)]) == 0
    gains, limits, period_s = read_gains(OWN_GAINS)
    again, same_limits, same_period_s = read_gains(tmp_path / "gains.toml")
    assert (limits, period_s) == (same_limits, same_period_s)
    for name in gains.__dataclass_fields__:
        assert getattr(again, name) == pytest.approx(getattr(gains, name), rel=1e-3)
