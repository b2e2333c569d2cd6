"""Your bench in ten minutes, on emulated instruments: every bench file of the page is checked and run as it stands.

Only addresses are replaced, by those of the emulated instruments.
"""

import json
import re
import shlex
from pathlib import Path

import pytest

from bender_cli.main import main
from bender_emulator.sources import daq_stand_in
from bender_hil.emulated import MICROSCOPE, EmulatedBench, EmulationSettings
from bender_hil.sources.amplifier import Amplifier
from bender_vision.scale import Calibration

pytest.importorskip("pyvisa_py", reason="needs the extra bench")

PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "your-bench-in-ten-minutes.md").read_text(encoding="utf-8")
FILES = dict(re.findall(r"```toml\n# (\S+)\n(.*?)```", PAGE, re.DOTALL))
COMMANDS = re.findall(r"^bender .*$", "".join(re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL)), re.MULTILINE)
# the machine that tests may be busy: what ends a run is not what is tested here
PATIENT = "heartbeat_s = 1.0\nframe_age_s = 0.8\ntravel_um = [-20, 60]\n"


def _as_it_stands(name: str, bench: EmulatedBench, folder: Path) -> Path:
    """Write a bench file of the page with the addresses of the emulated instruments."""
    text = FILES[name]
    addresses = iter([bench.resource, str(bench.sensor_resource)])
    text = re.sub(r'resource = "[^"]*"', lambda _: f'resource = "{next(addresses)}"', text)
    if bench.sensor_resource is None:
        text = text.replace("source = 0", f'source = "{bench.stream}"')
        Calibration.of_scale(1.5).save(folder / "calibration.toml")
    text = text.replace('device = "Dev1"', f'device = "{bench.sensor_resource}"\nbackend = "{daq_stand_in.__name__}"')
    text = text.replace("[guard]\n", f"[guard]\n{PATIENT}") if "[guard]" in text else f"{text}[guard]\n{PATIENT}"
    (folder / "bench.toml").write_text(text)
    return folder / "bench.toml"


def test_the_page_checks_plays_diagnoses_tunes_and_closes_the_loop():
    assert [line.split()[1] for line in COMMANDS] == ["bench", "hil", "diagnose", "tune", "hil"]
    assert "--gains results/gains/gains.toml" in COMMANDS[-1]


def test_the_page_has_three_benches_and_an_emulated_one():
    assert list(FILES) == [
        "supply-and-camera.toml", "generator-and-daq.toml", "controller-and-multimeter.toml", "emulated.toml",
    ]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "supply", "sensor", "amplifier"),
    [
        ("supply-and-camera.toml", "9115", MICROSCOPE, None),
        ("generator-and-daq.toml", "SDG", "daq", Amplifier(20.0)),
        ("controller-and-multimeter.toml", "MDT693B", "34465A", None),
    ],
)
def test_a_bench_of_the_page_is_checked_and_run(
    name: str, supply: str, sensor: str, amplifier: Amplifier | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    from bender_export.build import ensure_plant_fmu

    monkeypatch.chdir(tmp_path)
    rate = {"rate_Hz": 100.0} if sensor == "daq" else {}
    settings = EmulationSettings(supply=supply, sensor=sensor, sensor_settings=rate)
    with EmulatedBench(settings, ensure_plant_fmu("bench"), 30.0, amplifier=amplifier) as bench:
        calibration = None if sensor == MICROSCOPE else settings.sensor_calibration()
        if calibration is not None:
            calibration.save(tmp_path / "sensor.toml")
        path = _as_it_stands(name, bench, tmp_path)
        assert path.name == "bench.toml"
        for line in COMMANDS:
            assert main(shlex.split(line, comments=True)[1:]) == 0, line
            assert abs(bench.supply.truth()["output_V"]) < 1.0
    (check,) = Path("results").glob("check-*/check.json")
    states = {finding["what"]: finding["state"] for finding in json.loads(check.read_text())["findings"]}
    assert states["answer to the command"] == "fine"
    summary = json.loads(Path("results/step/summary.json").read_text())
    assert summary["step"]["steady_state_error_um"] == pytest.approx(0.0, abs=0.2)
    assert json.loads(Path("results/diagnosis/diagnosis.json").read_text())["verdict"]
