"""`bender bench check`: what it says of a bench file that the source cannot keep, and of a small first step."""

from pathlib import Path

import pytest

from bender_hil.bench_file import emulated_bench
from bender_hil.check import dry_runs
from bender_hil.sensors.sensor_eyes import NoSensorError
from bender_hil.supply.source import Bounds
from bender_loop.errors import InputError, RunError


@pytest.mark.parametrize(
    ("error", "what", "advice"),
    [
        (InputError("maximum_V must lie within -10 ... 10 V"), "dry run at 0 V", "correct the bench file"),
        (NoSensorError("refused"), "sensor", "look at its cable, and at [sensor]; a search"),
        (RunError("silent"), "dry run at 0 V", "look at cables and addresses; a search"),
    ],
)
def test_only_what_does_not_answer_is_searched_for(
    error: Exception, what: str, advice: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr(dry_runs, "_run", fail)
    monkeypatch.setattr(dry_runs, "connected", list)
    (finding,), _ = dry_runs.check_at_rest(emulated_bench(), tmp_path, Path)
    assert finding.what == what
    assert advice in finding.advice


def test_a_voltage_that_a_source_cannot_give_says_what_to_do():
    with pytest.raises(ValueError, match=r"within -10 \.\.\. 10 V with the SDG, found 50; .*\[amplifier\] gain"):
        Bounds(50.0, 55.0, 0.01).check(-10.0, 10.0, "the SDG")


def test_a_small_step_does_not_ask_for_a_wider_guard():
    bench = emulated_bench()
    found = dry_runs._response(bench, (1.48, 0.02), 1.0)
    travel = next(x for x in found if x.what == "guard.travel_um")
    assert "in proportion to this small step" in travel.found
    assert "widen" not in travel.advice
