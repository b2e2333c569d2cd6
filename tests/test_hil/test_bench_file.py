from pathlib import Path

import pytest

from bender_hil.bench_file import emulated_bench, read_bench
from bender_hil.supply.select import SupplySettings
from bender_loop.errors import InputError

REAL = """
[supply]
resource = "TCPIP::192.168.1.7::5025::SOCKET"
model = "9115"

[camera]
source = 0
frames_per_s = 30
delay_s = 0.012
calibration = "calibration.toml"

[camera.settings]
backend = "v4l2"
exposure = 40.0

[vision]
enters_from = "right"

[guard]
maximum_V = 40
protection_V = 44.0
travel_um = [-5, 30]

[controller]
gains = "gains.toml"
"""


def _read(tmp_path: Path, text: str):
    path = tmp_path / "bench.toml"
    path.write_text(text)
    return read_bench(path)


def test_a_real_bench(tmp_path: Path):
    bench = _read(tmp_path, REAL)
    assert bench.emulator is None
    assert isinstance(bench.source, SupplySettings)
    assert bench.source.model == "9115"
    assert (bench.camera.source, bench.camera.delay_s) == (0, 0.012)
    assert bench.camera_settings.exposure == 40.0
    assert bench.guard.travel_um == (-5, 30)
    assert bench.resolve("gains.toml") == tmp_path / "gains.toml"


def test_an_emulated_bench(tmp_path: Path):
    bench = _read(
        tmp_path,
        '[emulator]\nlink = "pty"\nseed = 3\n[emulator.parameters]\n"creep.share" = 0.1\n[emulator.scene]\ndust = 0\n'
        "[emulator.terminals]\nfall_time_s = 0.2\n",
    )
    assert bench.emulator is not None
    assert (bench.emulator.link, bench.emulator.parameters) == ("pty", {"creep.share": 0.1})
    assert bench.load_calibration().um_per_px == 1.5


def test_without_a_file_everything_is_emulated():
    bench = emulated_bench()
    assert bench.emulator is not None
    assert bench.source is None
    assert bench.load_calibration().width_px == 640


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("nonsense", "is not valid TOML"),
        ("[suply]\n", r"unknown table 'suply'"),
        ("[guard]\nmaximum = 3\n", "guard.maximum: unknown key"),
        ('[guard]\nmaximum_V = "50"\n', "guard.maximum_V: found '50'"),
        ("[guard]\nmaximum_V = 60\n", "guard: protection_V must lie above maximum_V"),
        ("[guard]\ntravel_um = [1]\n", "guard.travel_um"),
        ("[guard]\ntravel_um = [5, 1]\n", "guard: travel_um must be two numbers in order"),
        ("guard = 3\n", "guard: found 3, expected a table"),
        ("[camera]\nsettings = 3\n", "settings: found 3, expected a table"),
        ("[camera]\nframes_per_s = 0\n", "camera: frames_per_s"),
        ("[camera.settings]\nbackend = 'vhs'\n", "camera.settings: backend"),
        ("[vision]\nmethod = 'guess'\n", "vision: method"),
        ("[emulator]\nlink = 'gpib'\n", "emulator: link must be one of"),
        ("[emulator]\nsupply = '9103'\n", "emulator: supply must be one of"),
        ("[emulator]\n[emulator.scene]\ndurst = 1\n", "emulator.scene: durst"),
        ("[emulator]\n[emulator.terminals]\nvolume = 1\n", "emulator: terminals"),
        ("[emulator]\n[supply]\nresource = 'ASRL1::INSTR'\n", "emulate everything or nothing"),
        ("[emulator]\n[camera]\nsource = 0\n", "emulate everything or nothing"),
        ("[supply]\nmodel = '9115'\n", "supply.resource: is missing"),
        ("[supply]\nresource = 'ASRL1::INSTR'\nmodel = '9103'\n", "supply: model must be one of"),
        ("[guard]\n", "supply is missing"),
        ("[supply]\nresource = 'ASRL1::INSTR'\n", "camera.source is missing"),
        ("[supply]\nresource = 'ASRL1::INSTR'\n[camera]\nsource = 0\n", "camera.calibration is missing"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, text: str, complaint: str):
    with pytest.raises(InputError, match=complaint) as caught:
        _read(tmp_path, text)
    assert str(tmp_path / "bench.toml") in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there(tmp_path: Path):
    with pytest.raises(InputError, match="expected a bench file"):
        read_bench(tmp_path / "none.toml")
