"""`bender benchmark control` goes on from what an earlier run has left, and holds its figures to the bounds."""

import json
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from bender_cli.main import main
from bender_loop.shell.files import finite
from bender_studies.benchmarks import control
from bender_studies.control import figures
from bender_studies.control.trial import Tried

FOUND = Tried(
    id="case-1",
    truth=("creep",),
    verdict="named",
    effects=("creep",),
    recommended=True,
    worst_ms=1.6,
    tracking=(("sine", 0.4, 0.04),),
    settling_s=(math.nan, 0.2),
    overshoot_percent=(0.0, 1.5),
    stairs_um=(2.0, 1.0),
    dead_time_um=0.9,
    open_loop_percent=0.5,
    possible_um=0.95,
)


def test_a_bench_comes_back_from_a_file_as_it_was():
    again = Tried.from_dict(json.loads(json.dumps(finite(FOUND.to_dict()))))
    assert again.to_dict() | {"settling_s": 0} == FOUND.to_dict() | {"settling_s": 0}
    assert (math.isnan(again.settling_s[0]), again.settling_s[1]) == (True, 0.2)


@pytest.mark.parametrize(("seed", "verdict", "tried"), [(5, "named", 0), (6, "named", 1), (5, "error", 1)])
def test_only_what_was_asked_the_same_and_did_not_fail_is_kept(
    seed: int, verdict: str, tried: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    (case,) = (x for x, _ in zip(control.hidden_benches(control.EFFECTS, 5), range(1), strict=False))
    asked = {"effects": None, "first_seed": seed, "evaluations": 91, "wrong_name": False, "spread": 0}
    from bender_loop.shell.run import version

    content = {
        "asked": {"version": version()} | asked,
        "benches": [replace(FOUND, id=case.id, verdict=verdict, error="not recommended").to_dict()],
    }
    (tmp_path / "control.json").write_text(json.dumps(finite(content)))
    begun: list[str] = []

    def interrupted(_: object, tasks: list[tuple[object, ...]], *__: object, **___: object) -> Iterator[object]:
        for task in tasks:
            begun.append(str(task[0]))
            raise KeyboardInterrupt
        yield from ()

    monkeypatch.setattr("bender_studies.runner.in_processes", interrupted)
    words = ["benchmark", "control", "--benches", "1", "--first-seed", "5", "--jobs", "1", "--out", str(tmp_path)]
    assert main([*words, "--quiet"]) == (130 if tried else 0)
    assert len(begun) == tried


def test_the_claims_count_what_does_not_settle():
    told = {row[0]: row[2] for row in figures.claims([FOUND, replace(FOUND, settling_s=(1.0, 0.4))])}
    assert told["benches on which stairs do not settle: PID block alone, with the model"] == "1, 0"
    assert told["settling of stairs, ratio, 1 benches: median"] == "0.400"
    assert told["rms of stairs above what the dead time alone costs: median, worst"] == "11 %, 11 %"


@pytest.mark.parametrize(
    ("changed", "worse"),
    [
        ({}, False),
        ({"overshoot_percent": (0.0, 2.1)}, True),
        ({"overshoot_percent": (30.0, 31.0)}, False),
        ({"settling_s": (0.5, 0.6)}, True),
        ({"settling_s": (math.nan, math.nan)}, False),
        ({"settling_s": (0.5, math.nan)}, True),
        ({"stairs_um": (2.0, 2.2)}, True),
    ],
)
def test_a_model_is_worse_in_any_figure_of_the_stairs(changed: dict[str, tuple[float, float]], worse: bool):
    tried = replace(FOUND, **changed)  # pyright: ignore[reportArgumentType]
    assert figures.is_worse(tried) == worse
    told = {row[0]: row[2] for row in figures.claims([tried])}
    what = "benches on which the model makes rms, settling or overshoot of stairs worse by more than 5 %"
    assert told[what] == f"{int(worse)} of 1"
