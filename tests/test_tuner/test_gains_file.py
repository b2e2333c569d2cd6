import math
import tomllib
from pathlib import Path

import pytest

from bender_loop.control.pid import Gains, Limits
from bender_loop.errors import InputError
from bender_tuner.results.gains_file import read_gains, write_gains

GAINS = Gains(0.25, 7.25, 0.0155, 2.0 / 30.0)
LIMITS = Limits(0.0, 50.0, 0.02)


@pytest.fixture
def written(tmp_path: Path) -> Path:
    path = tmp_path / "gains.toml"
    write_gains(path, GAINS, LIMITS, 1.0 / 30.0)
    return path


@pytest.mark.parametrize("gains", [GAINS, Gains(0.0, 5.9), Gains(1.0, 0.0, 0.1, 0.0, True)])
def test_what_is_written_is_read(tmp_path: Path, gains: Gains) -> None:
    path = tmp_path / "gains.toml"
    write_gains(path, gains, LIMITS, 0.02)
    assert read_gains(path) == (gains, LIMITS, 0.02)


def test_unlimited_commands_survive(tmp_path: Path) -> None:
    path = tmp_path / "gains.toml"
    write_gains(path, GAINS, Limits(-math.inf, math.inf), 0.02)
    assert read_gains(path)[1] == Limits(-math.inf, math.inf)


def test_every_form_stands_in_the_file(written: Path) -> None:
    table = tomllib.loads(written.read_text(encoding="utf-8"))
    assert table["isa"]["integral_time_s"] == pytest.approx(0.25 / 7.25)
    assert table["isa"]["derivative_time_s"] == pytest.approx(0.0155 / 0.25)
    assert len(table["discrete"]["measurement_V_per_um"]) == 3


def test_pure_integral_action_is_written_without_isa(tmp_path: Path) -> None:
    path = tmp_path / "gains.toml"
    write_gains(path, Gains(0.0, 5.9), LIMITS, 0.02)
    assert "isa" not in tomllib.loads(path.read_text(encoding="utf-8"))


def test_parallel_gains_alone_are_enough(tmp_path: Path) -> None:
    path = tmp_path / "gains.toml"
    path.write_text("sampling_period_s = 0.01\n[parallel]\nproportional_V_per_um = 1\nintegral_V_per_um_s = 2\n")
    assert read_gains(path) == (Gains(1.0, 2.0), Limits(), 0.01)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("integral_V_per_um_s = 7.25", "integral_V_per_um_s = nan", "integral_V_per_um_s must be a finite number"),
        ("integral_V_per_um_s = 7.25", "integral_V_per_um_s = -1.0", "integral_V_per_um_s must be a finite number"),
        ("integral_V_per_um_s = 7.25", 'integral_V_per_um_s = "7"', "parallel.integral_V_per_um_s: found '7'"),
        ("integral_V_per_um_s = 7.25", "", "parallel.integral_V_per_um_s: is missing"),
        ("integral_V_per_um_s = 7.25", "integral_V_per_um_s = 7.5", "does not agree with [parallel]"),
        ("integral_V_per_um_s = 7.25", "integral_V_per_um_s = 7.25\nspeed = 1", "parallel.speed: unknown key"),
        ("upper_V = 50.0", "upper_V = -1.0", "lower_V must lie below upper_V"),
        ("sampling_period_s = 0.03", "sampling_period_s = -0.03", "period_s must be"),
        ("[parallel]", "[parallel", "is not valid TOML"),
    ],
)
def test_a_faulty_file_is_named_with_what_is_wrong(written: Path, old: str, new: str, sentence: str) -> None:
    text = written.read_text(encoding="utf-8")
    assert old in text
    written.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_gains(written)
    assert str(caught.value).startswith(f"{written}: ")
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        read_gains(tmp_path / "none.toml")


def test_nothing_is_written_for_a_period_that_is_none(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="period_s"):
        write_gains(tmp_path / "gains.toml", GAINS, LIMITS, math.nan)
    assert not list(tmp_path.iterdir())
