"""What a diagnosis says of the model beside it, in the units of the rig."""

import hashlib
import json
import math
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bender_loop.fmu.diagnosed import LEAST_GAIN_ERROR_PERCENT, NOTHING, Diagnosed, Known, diagnosed

TOLD = {"model": "model.toml", "fmu": "model.fmu", "unit": "K", "input_unit": "W", "gap": {"after": {"rms": 0.3}}}


@pytest.mark.parametrize("name", ["model.toml", "model.fmu"])
def test_the_model_of_a_diagnosis_has_its_units_and_what_it_misses(tmp_path: Path, name: str):
    (tmp_path / "diagnosis.json").write_text(json.dumps(TOLD))
    assert diagnosed(tmp_path / name) == Diagnosed(0.3, ("W", "K"))


@pytest.mark.parametrize("text", [json.dumps(TOLD), json.dumps(TOLD | {"gap": None}), "[]", "{", ""])
def test_another_model_and_what_is_no_diagnosis_say_nothing(tmp_path: Path, text: str):
    (tmp_path / "diagnosis.json").write_text(text)
    assert diagnosed(tmp_path / ("other.toml" if "0.3" in text else "model.toml")) == NOTHING
    assert diagnosed("paper") == diagnosed(None) == NOTHING


def _delay(half_s: float) -> dict[str, object]:
    interval = [0.05 - half_s, 0.05 + half_s]
    return {"effects": [{"id": "transport_delay", "parameters": {"delay_s": {"interval_95": interval}}}]}


def _visible(value: float | None) -> dict[str, object]:
    return {"smallest_visible": {"transport_delay": {"parameter": "delay_s", "value": value}}}


def _known(folder: Path, left_percent: float | None, **further: object) -> Known | None:
    model = folder / "model.toml"
    model.write_text("as it was written")
    digest = hashlib.sha256(model.read_bytes()).hexdigest()
    gap = {"after": {"rms": 0.3, "nrmse_percent": left_percent}}
    (folder / "diagnosis.json").write_text(json.dumps(TOLD | {"gap": gap, "sha256": {model.name: digest}} | further))
    return diagnosed(model).known


REFITTED = {"refitted": {"transport_delay.delay_s": {"before": 0.058, "after": 0.059, "unit": "s", "std": 3e-4}}}


@pytest.mark.parametrize(
    ("left", "told", "delay_s"),
    [
        (2.0, _delay(0.002), 0.002),
        (2.0, _visible(0.004), 0.004),
        # by its own deviation, where the model has a dead time
        (2.0, REFITTED, 6e-4),
        (1.0, {}, None),
        (1.0, _visible(None), None),
        (None, _visible(0.004), None),
    ],
)
def test_a_device_is_known_by_what_its_model_leaves_and_by_the_dead_time_that_would_show(
    tmp_path: Path, left: float | None, told: dict[str, object], delay_s: float | None
):
    known = _known(tmp_path, left, **told)
    if left is None or delay_s is None:
        assert known is None
    else:
        assert known == pytest.approx((left * math.sqrt(12.0) * 2.0, delay_s))


def test_a_diagnosis_vouches_for_the_file_that_it_left_and_for_no_other(tmp_path: Path):
    assert _known(tmp_path, 2.0) is None
    assert diagnosed(tmp_path / "model.toml").vouched_for, "although it bounds nothing"
    assert _known(tmp_path, 1.0, **_visible(0.004)) is not None
    (tmp_path / "model.toml").write_text("changed by hand")
    found = diagnosed(tmp_path / "model.toml")
    assert (found.known, found.rms_um, found.vouched_for) == (None, 0.3, False)
    assert not NOTHING.vouched_for


@pytest.mark.parametrize(
    ("left", "told", "said"),
    [
        (1.25, _visible(0.004), "gap.after.nrmse_percent is 1.25, and the dead time is known to 0.004 s"),
        (1.25, _visible(0.004) | {"recalibrated": {"gain": {"after": 0.5, "std": 0.1}}}, "recalibrated.gain 0.5 ± 0.1"),
        (1.25, {}, "diagnosis.json does not bound the dead time"),
        (None, _visible(0.004), "diagnosis.json does not bound the gain"),
    ],
)
def test_by_which_file_and_numbers_a_device_is_known_is_said(
    tmp_path: Path, left: float | None, told: dict[str, object], said: str
):
    _known(tmp_path, left, **told)
    source = diagnosed(tmp_path / "model.toml").source
    assert source.startswith(str(tmp_path))
    assert said in source
    (tmp_path / "model.toml").write_text("with a name put in")
    assert diagnosed(tmp_path / "model.toml").source.endswith("is of another file than this one")
    assert "no diagnosis.json" in diagnosed("paper").source


@settings(max_examples=50, deadline=None)
@given(left=st.floats(0.0, 20.0), worse=st.floats(0.0, 20.0), std=st.floats(0.0, 0.2))
def test_what_leaves_more_is_known_less_and_a_gain_no_better_than_its_interval(
    tmp_path_factory: pytest.TempPathFactory, left: float, worse: float, std: float
):
    folder = tmp_path_factory.mktemp("known")
    gain = {"recalibrated": {"gain": {"after": 0.5, "std": std}}}
    one = _known(folder, left, **_visible(0.004))
    more = _known(folder, left + worse, **_visible(0.004), **gain)
    assert one is not None
    assert more is not None
    assert LEAST_GAIN_ERROR_PERCENT <= one.gain_error_percent <= more.gain_error_percent
    assert more.gain_error_percent >= 400.0 * std
