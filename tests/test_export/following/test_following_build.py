"""Which gains files become the FMU of a controller, and what is said of the others."""

import math
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import fmpy
import pytest
from fmu_hosts import assert_follows_its_schemas
from following_controllers import Made, followed, late, tuned_on

from bender_cli.main import main
from bender_export.archive import packed, unpacked
from bender_export.following import FOLLOWING_FMU, FOLLOWING_LOOP, Host, build_following, followed_equations
from bender_loop.control.pid import Limits
from bender_loop.errors import InputError
from bender_plant.model import load_model
from bender_tuner.results.gains_file import write_gains


@pytest.fixture
def gains_file(following_paper: Made, tmp_path: Path) -> Path:
    """As `bender tune --follow-model` leaves it, the model beside it."""
    tuned = following_paper.tuned
    (tmp_path / "tuned").mkdir()
    (tmp_path / "tuned" / tuned.model.fmu).write_bytes(following_paper.model.read_bytes())
    path = tmp_path / "tuned" / "gains.toml"
    write_gains(path, tuned.gains, tuned.limits, tuned.period_s, tuned.model)
    return path


def test_the_same_gains_give_the_same_bytes_and_others_another_guid(following_paper: Made, tmp_path: Path) -> None:
    tuned, model = following_paper.tuned, following_paper.model
    for path, first in zip(
        build_following(tuned, model, tmp_path / "again"),
        (following_paper.controller, following_paper.loop),
        strict=True,
    ):
        assert path.read_bytes() == first.read_bytes()
    other = replace(tuned, gains=replace(tuned.gains, integral_V_per_um_s=5.0 + 2.0**-50))
    changed, _ = build_following(other, model, tmp_path / "other")
    names = [set(unpacked(path)) for path in (changed, following_paper.controller)]
    shared = {name for name in names[0] & names[1] if name.startswith("resources/") and "/pythonfmu/" not in name}
    assert shared == {"resources/model.toml", "resources/slavemodule.txt"}


def test_the_model_is_that_of_the_fmu_and_goes_along(following_late: Made) -> None:
    assert followed_equations(following_late.tuned.model, following_late.model) == late()
    carried = unpacked(following_late.controller)["resources/model.toml"]
    assert carried == unpacked(following_late.model)["resources/model.toml"]


def test_the_archive_of_the_loop_follows_its_schemas(following_late: Made) -> None:
    assert_follows_its_schemas(following_late.loop)
    entries = unpacked(following_late.loop)
    structure = entries["SystemStructure.ssd"].decode()
    assert f'source="resources/{FOLLOWING_FMU}"' in structure
    assert 'startElement="plant" startConnector="tip_displacement"' in structure
    assert f"resources/{FOLLOWING_FMU}" in entries


def test_the_command_line_writes_both_and_they_pass_the_check(
    gains_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "new"
    words = ["fmu", "controller", str(gains_file), "--out", str(out), "--latency", "1", "--command-delay", "0.004"]
    assert main(words) == 0
    written = capsys.readouterr().out.splitlines()
    assert [Path(line) for line in written] == [out / FOLLOWING_FMU, out / FOLLOWING_LOOP]
    assert main(["fmu", "check", written[0]]) == 0
    starts = {x.name: x.start for x in fmpy.read_model_description(written[0]).modelVariables}
    assert (starts["sampling.latency"], starts["sampling.command_delay"]) == ("1.0", "0.004")
    assert (starts["gains.integral"], starts["sampling.period"], starts["shaper.rate"]) == ("5.0", "0.02", "200.0")


def test_gains_of_the_pid_block_alone_are_refused(
    following_paper: Made, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tuned, path = following_paper.tuned, tmp_path / "gains.toml"
    write_gains(path, tuned.gains, tuned.limits, tuned.period_s)
    assert main(["fmu", "controller", str(path), "--out", str(tmp_path / "new")]) == 2
    error = capsys.readouterr().err
    assert f"{path}: found no [model_following], expected a model to follow" in error
    assert "--follow-model" in error
    assert not (tmp_path / "new").exists()


def foreign(entries: dict[str, bytes]) -> dict[str, bytes]:
    """As another maker's: without the model."""
    return {name: data for name, data in entries.items() if name != "resources/model.toml"}


def damaged(entries: dict[str, bytes]) -> dict[str, bytes]:
    return entries | {"resources/model.toml": b"format = 7\n"}


@pytest.mark.parametrize(
    ("change", "ports", "message"),
    [
        (foreign, {}, r"model\.fmu: found an FMU of PythonFMU .* with no equations \(resources/model\.toml\)"),
        (foreign, {}, r"bender tune --model model\.toml"),
        (damaged, {}, r"resources/model\.toml: format: found 7, expected 1"),
        (dict, {"input": "taken", "output": "shown"}, "run from taken → shown, expected one made by this project"),
        (dict, {"units": ("mV", "um", "", "")}, "in mV and um, expected one made by this project"),
    ],
)
def test_what_has_no_equations_of_ours_is_refused(
    following_paper: Made, tmp_path: Path, change: Any, ports: dict[str, Any], message: str
) -> None:
    fmu = tmp_path / "model.fmu"
    fmu.write_bytes(packed(change(unpacked(following_paper.model))))
    with pytest.raises(InputError, match=message):
        build_following(tuned_on(fmu, **ports), fmu, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_another_fmu_than_that_of_the_tuning_or_none_is_refused(following_paper: Made, tmp_path: Path) -> None:
    fmu = tmp_path / "model.fmu"
    with pytest.raises(InputError, match="expected the FMU that"):
        build_following(following_paper.tuned, fmu, tmp_path / "out")
    entries = unpacked(following_paper.model)
    fmu.write_bytes(packed({**entries, "resources/more.txt": b""}))
    with pytest.raises(InputError, match="is not the FMU that the gains were tuned with"):
        build_following(following_paper.tuned, fmu, tmp_path / "out")


@pytest.mark.parametrize(
    ("host", "limits", "message"),
    [
        (Host(), Limits(-math.inf, 50.0), "limits.lower: found -inf, expected a finite number"),
        (Host(2000), Limits(), "sampling.latency: found 2000.0, expected a finite number from 0 to 1000"),
        (Host(0, 0.02), Limits(), "sampling.command_delay: found 0.02 s, expected less than the period of 0.02 s"),
    ],
)
def test_values_that_do_not_fit_are_refused(
    following_paper: Made, tmp_path: Path, host: Host, limits: Limits, message: str
) -> None:
    tuned = replace(following_paper.tuned, limits=limits)
    with pytest.raises(InputError, match=message):
        build_following(tuned, following_paper.model, tmp_path / "out", host)


def test_a_negative_latency_is_refused() -> None:
    with pytest.raises(InputError, match="latency of -1 samples"):
        Host(-1)


def test_a_native_fmu_of_the_model_does_too(tmp_path: Path) -> None:
    build = pytest.importorskip("bender_native.build")
    fmu = tmp_path / "model.fmu"
    fmu.write_bytes(build.native_plant_fmu(load_model("beam"), build.Way(2)))
    assert followed_equations(followed(fmu), fmu) == load_model("beam")


@pytest.mark.slow
def test_the_emulated_bench_runs_it_and_its_replay_gives_the_same_bits(
    following_paper: Made, gains_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("pyvisa_py")
    pytest.importorskip("cv2")
    tuned = following_paper.tuned
    write_gains(gains_file, tuned.gains, tuned.limits, 1.0 / 30.0, tuned.model)
    words = ["fmu", "controller", str(gains_file), "--out", str(tmp_path), "--command-delay", "0.004"]
    assert main(words) == 0
    words = ["--setpoint", "8", "--duration", "2", "--controller", str(tmp_path / FOLLOWING_FMU)]
    assert main(["hil", *words, "--out", str(tmp_path / "run")]) == 0
    assert main(["hil", "replay", str(tmp_path / "run")]) == 0
    assert "all the same to the last bit" in capsys.readouterr().out
    with zipfile.ZipFile(tmp_path / "run" / "controller.fmu") as kept:
        assert "resources/model.toml" in kept.namelist()
