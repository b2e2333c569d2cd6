"""The how-to of own formats, supplies and effects, followed: its package is made, installed and used."""

import json
import re
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from page_packages import bender, installed, made_known, python, written

from bender_hil.supply.dialect import NEEDED, Dialect

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "how-to" / "add-your-own.md").read_text(encoding="utf-8")
MODEL = 'format = 1\nname = "mine"\n[[block]]\nid = "linear_transduction"\nsensitivity_um_per_V = 0.5\n'
CLIPPED = MODEL + '[[block]]\nid = "amplifier_clipping"\nclip_V = 30.0\n'


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package as installed."""
    return installed(PAGE, tmp_path_factory.mktemp("site"), "my_bench")


def clipped_record(noise_um: float = 0.0) -> np.ndarray:
    time_s = np.arange(600) / 30.0
    voltage = 50.0 * (1.0 - np.abs(1.0 - (time_s % 10.0) / 5.0))
    acting = np.append(0.0, voltage[:-1])
    noise = noise_um * np.random.default_rng(1).normal(size=time_s.size)
    return np.stack([time_s, voltage, 0.5 * np.minimum(acting, 30.0) + noise], axis=1)


def write_csv(path: Path, rows: np.ndarray) -> None:
    np.savetxt(path, rows, delimiter=",", header="time_s,voltage_V,displacement_um", comments="")


def test_an_own_format_and_an_own_block_go_through_compare(site: Path, tmp_path: Path):
    (tmp_path / "monday.vib").write_bytes(b"VIB1\n" + clipped_record().astype("<f4").tobytes())
    (tmp_path / "mine.toml").write_text(CLIPPED, encoding="utf-8")
    done = bender(site, tmp_path, "compare", "monday.vib", "--model", "mine.toml", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["before"]["rms_um"] < 1e-5
    (tmp_path / "bad.vib").write_bytes(b"XIB1\n")
    done = bender(site, tmp_path, "compare", "bad.vib")
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    assert "expected VIB1" in done.stderr
    assert bender(tmp_path, tmp_path, "compare", "monday.vib", "--model", "mine.toml").returncode == 2


@pytest.mark.slow
def test_the_fmu_of_an_own_block_runs_without_the_package(site: Path, tmp_path: Path):
    (tmp_path / "mine.toml").write_text(CLIPPED, encoding="utf-8")
    done = bender(site, tmp_path, "fmu", "build", "--model", "mine.toml", "--out", "fmus")
    assert done.returncode == 0, done.stderr
    write_csv(tmp_path / "a.csv", clipped_record())
    done = bender(tmp_path, tmp_path, "compare", "a.csv", "--fmu", "fmus/PiezoBender.fmu", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["before"]["rms_um"] < 1e-5


def test_an_own_supply_is_known_to_a_bench(site: Path, tmp_path: Path):
    script = (
        "from bender_hil.supply.select import SupplySettings, capability_of;"
        "SupplySettings('ASRL1::INSTR', 'PSU30').make(); print(capability_of('PSU30').dialect.set_current)"
    )
    done = python(site, tmp_path, "-c", script)
    assert done.stdout.strip() == "CURR:LEV {}", done.stderr
    assert "PSU30" in python(tmp_path, tmp_path, "-c", script).stderr.splitlines()[-1]


def test_a_fault_of_the_program_names_the_package_of_an_own_supply(site: Path, tmp_path: Path):
    script = (
        "from bender_hil.sources.kinds import where_to_mend; from bender_hil.supply.select import SupplySettings;"
        "print(*(where_to_mend(SupplySettings('ASRL1::INSTR', model)) for model in ('PSU30', '9115')), sep='\\n')"
    )
    done = python(site, tmp_path, "-c", script)
    own, ours = done.stdout.splitlines()
    assert "PSU30 of the package my_bench" in own, done.stderr
    assert "report" in ours


def test_the_optional_words_of_a_supply_are_those_that_the_page_calls_optional():
    rows = re.findall(r"^\| (`.*?) \|.*\| (.*) \|$", PAGE, re.MULTILINE)
    optional = {field for names, told in rows if "or `None`" in told for field in re.findall(r"`(\w+)`", names)}
    known = {field.name for field in fields(Dialect)} - {"name"}
    assert optional == known - set(NEEDED)


def test_an_own_effect_is_in_the_catalogue(site: Path, tmp_path: Path):
    done = bender(site, tmp_path, "effects", "amplifier_clipping", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["parameters"]["clip_V"]["unit"] == "V"
    assert bender(tmp_path, tmp_path, "effects", "amplifier_clipping").returncode == 2


def test_a_package_that_cannot_be_imported_is_named(tmp_path: Path):
    made_known(tmp_path, "broken", {"piezo_bender.record_formats": {"vib": "no_such_module:read"}})
    (tmp_path / "a.vib").write_bytes(b"x")
    done = bender(tmp_path, tmp_path, "compare", "a.vib")
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    assert "vib of the package broken cannot be loaded" in done.stderr


@pytest.mark.slow
def test_an_own_effect_is_named_by_a_diagnosis(site: Path, tmp_path: Path):
    # behind a lag: without one, a clipped command is a clipped reading
    rows = clipped_record(noise_um=0.02)
    keep, lagging = np.exp(-1.0 / 30.0 / 0.4), 0.0
    for k, volts in enumerate(np.append(0.0, rows[:-1, 1])):
        lagging = keep * lagging + (1.0 - keep) * 0.5 * min(volts, 30.0)
        rows[k, 2] += lagging - 0.5 * min(volts, 30.0)
    write_csv(tmp_path / "a.csv", rows)
    lag = '[[block]]\nid = "plant_lag"\ntime_constant_s = 0.4\n'
    (tmp_path / "mine.toml").write_text(MODEL + lag, encoding="utf-8")
    done = bender(site, tmp_path, "diagnose", "a.csv", "--model", "mine.toml", "--out", "found", "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert (told["verdict"], [x["id"] for x in told["effects"]]) == ("named", ["amplifier_clipping"])
    assert told["effects"][0]["parameters"]["clip_V"]["value"] == pytest.approx(30.0, rel=0.01)


@pytest.mark.slow
def test_the_package_installs_with_pip(tmp_path: Path):
    pytest.importorskip("hatchling")
    project = written(PAGE, tmp_path / "my-bench")
    words = ["install", "--no-deps", "--no-build-isolation", "--no-index", "-q", "--target", str(tmp_path / "site")]
    subprocess.run([sys.executable, "-m", "pip", *words, str(project)], check=True, capture_output=True)
    done = bender(tmp_path / "site", tmp_path, "effects", "amplifier_clipping", "--json")
    assert done.returncode == 0, done.stderr
