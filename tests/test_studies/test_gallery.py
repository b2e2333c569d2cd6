"""The gallery: what counts as right, what a rig's record and model look like, and the command end to end."""

import argparse
import json
from pathlib import Path

import numpy as np
import pytest
from few import few

from bender_loop.records.record import read_record
from bender_proving.gallery import RIGS, PublishedRig
from bender_studies.gallery import command, rig_diagnosis
from bender_studies.gallery.nominal import nominal
from bender_studies.gallery.rig_diagnosis import RigDiagnosis, heads, is_right, record_text

FRICTION = frozenset({"coulomb_friction"})


@pytest.mark.parametrize(
    ("names", "verdict", "added", "listed", "complete", "right"),
    [
        (FRICTION, "named", ("coulomb_friction",), ("coulomb_friction",), False, True),
        (FRICTION, "named", ("coulomb_friction", "creep"), ("coulomb_friction", "creep"), True, False),
        (FRICTION, "named", ("backlash",), ("backlash",), True, False),
        (FRICTION, "ambiguous", (), ("backlash", "coulomb_friction"), True, True),
        (FRICTION, "ambiguous", (), ("backlash", "dead_zone"), True, False),
        (FRICTION, "unexplained", (), (), False, False),
        (FRICTION, "no_gap", (), (), True, False),
        (frozenset(), "unexplained", (), (), False, True),
        (frozenset(), "named", ("saturation",), ("saturation",), False, True),
        (frozenset(), "named", ("saturation",), ("saturation",), True, False),
        (frozenset(), "no_gap", (), (), True, False),
    ],
)
def test_a_verdict_is_right_where_it_says_what_the_rig_has(names, verdict, added, listed, complete, right) -> None:
    assert is_right(names, verdict, added, listed, complete) == right


@pytest.mark.parametrize("name", few(RIGS, 0, 1))
def test_a_record_keeps_the_rigs_own_names_and_units(name: str, tmp_path: Path) -> None:
    rig = RIGS[name]
    played = rig.play(np.random.default_rng(1))
    path = tmp_path / "record.csv"
    path.write_text(record_text(rig, played), encoding="utf-8")
    record = read_record(path, ",".join(heads(rig)))
    model = nominal(rig, record.quantities[:2])
    scale = {"mm": 1e3, "cm": 1e4}.get(rig.reading[1], 1.0)
    np.testing.assert_allclose(record.displacement_um, scale * played.reading)
    gains = [x.parameters for x in model.blocks if x.id == "linear_transduction"]
    assert getattr(gains[0], "sensitivity_um_per_V") == pytest.approx(scale * rig.gain)  # noqa: B009


def _told(out: Path, *rigs: str) -> argparse.Namespace:
    return argparse.Namespace(rigs=list(rigs), seed=3, out=out)


@pytest.mark.slow
def test_a_gap_behind_a_slider_is_named_beside_its_hysteresis(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command.run(_told(tmp_path / "out", "damper")) == 0
    assert "named: rate_independent_hysteresis + output_dead_zone" in capsys.readouterr().out
    told = json.loads((tmp_path / "out" / "damper" / "diagnosis.json").read_text(encoding="utf-8"))
    assert {x["id"] for x in told["effects"]} == {"rate_independent_hysteresis", "output_dead_zone"}


@pytest.mark.slow
def test_a_lagging_thermocouple_is_named_in_its_own_units(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command.run(_told(tmp_path / "out", "thermocouple")) == 0
    assert "named: sensor_lag" in capsys.readouterr().out
    found = json.loads((tmp_path / "out" / command.FIGURES).read_text(encoding="utf-8"))["simulated"][0]
    assert found["is_right"]
    assert found["unit"] == "K"
    assert found["after"] < 1.3 * found["noise"]
    page = (tmp_path / "out" / command.PAGE).read_text(encoding="utf-8")
    assert "thermocouple/report.html" in page
    assert {x.name for x in (tmp_path / "out" / "thermocouple").iterdir()} >= {
        "record.csv",
        "nominal.toml",
        "report.html",
    }


def test_ctrl_c_keeps_the_rigs_that_are_complete(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def until_the_tanks(rig: PublishedRig, seed: int, out: Path) -> RigDiagnosis:
        if rig.name == "tanks":
            raise KeyboardInterrupt
        return RigDiagnosis(rig.name, "", "no_gap", "", (), (), True, 1.0, 1.0, 1.0, rig.reading[1], True)

    monkeypatch.setattr(rig_diagnosis, "diagnose_rig", until_the_tanks)
    out = tmp_path / "out"
    assert command.run(_told(out, "servo", "tanks", "valve")) == 130
    kept = json.loads((out / command.FIGURES).read_text(encoding="utf-8"))["simulated"]
    assert [x["rig"] for x in kept] == ["servo"]
    assert "servo/report.html" in (out / command.PAGE).read_text(encoding="utf-8")
    assert command.run(_told(tmp_path / "none", "tanks")) == 130
    assert not (tmp_path / "none" / command.PAGE).exists()
