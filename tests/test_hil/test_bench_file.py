"""Bench files and their check, and the file of scale and distortion from rulers drawn by formula."""

import contextlib
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bender_cli.main import main
from bender_hil.bench_file import emulated_bench, read_bench
from bender_hil.calibration.fit import RulerFit, fit_ruler
from bender_hil.calibration.fringes import find_fringes
from bender_hil.calibration.pictures import read_picture
from bender_hil.check import dry_runs
from bender_hil.guard.start import GuardFaultError, SourceFailedError, SourceRefusedError
from bender_hil.sensors.sensor_eyes import NoSensorError
from bender_hil.supply.select import SupplySettings
from bender_hil.supply.source import Bounds
from bender_loop.errors import InputError, RunError
from bender_vision.scale import Calibration

GENERATOR = (
    '[source]\nkind = "generator"\nresource = "ASRL1::INSTR"\nmodel = "SDG"\n'
    "[amplifier]\ngain = 25\nlowest_V = -250\nhighest_V = 250\n"
    '[sensor]\nkind = "text"\nresource = "ASRL2::INSTR"\nunit = "um"\n'
)
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
        (
            "[guard]\nmaximum_V = 60\n",
            "guard: maximum_V is 60 V and protection_V 55 V [(]its default is 55[)]: set protection_V above maximum_V",
        ),
        ("[guard]\ntravel_um = [1]\n", "guard.travel_um"),
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
        (
            "[supply]\nresource = 'ASRL1::INSTR'\nmodel = '9103'\n",
            "found '9103'; add another as a row .*of yours [(]docs.*[)]$",
        ),
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


@pytest.mark.parametrize(
    ("source", "told", "protection_V"),
    [
        ('[emulator]\nsupply = "MDT693B"\nsensor = "34465A"\n', "maximum_V = 120\n", 132.0),
        (GENERATOR, "maximum_V = 200\n", 220.0),
        (GENERATOR, "minimum_V = -100\n", 110.0),
        (GENERATOR, "", 55.0),
        (GENERATOR, "maximum_V = 200\nprotection_V = 300\n", 300.0),
    ],
)
def test_a_source_without_protection_is_not_asked_for_its_level(
    tmp_path: Path, source: str, told: str, protection_V: float
):
    assert _read(tmp_path, f"{source}[guard]\n{told}").guard.protection_V == pytest.approx(protection_V)


@pytest.mark.parametrize(
    ("error", "what", "advice"),
    [
        (InputError("maximum_V must lie within -10 ... 10 V"), "dry run at 0 V", "correct the bench file"),
        (NoSensorError("refused"), "sensor", "look at its cable, and at [sensor]; a search"),
        (GuardFaultError("a fault", "mend PSU30 of the package my_bench"), "source", "mend PSU30 of the package"),
        (SourceRefusedError("ACME PSU answers there"), "source", "correct the bench file; a search"),
        (SourceFailedError("no answer"), "source", "look at its cable and its address; a search"),
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


cv2 = pytest.importorskip("cv2", reason="needs the extra bench")

HEIGHT, WIDTH = 300, 400


def ruler(
    um_per_px: float,
    angle: float,
    *,
    distortion: float = 0.0,
    pitch_um: float = 10.0,
    phase: float = 0.3,
    seed: int = 1,
) -> np.ndarray:
    """Dark lines by formula, each a raised cosine to the fourth, under slanting light with noise."""
    rng = np.random.default_rng(seed)
    y, x = np.indices((HEIGHT, WIDTH), dtype=float)
    x, y = x - (WIDTH - 1) / 2, y - (HEIGHT - 1) / 2
    grown = um_per_px * (1.0 + distortion * (x * x + y * y) / ((WIDTH**2 + HEIGHT**2) / 4))
    along = grown * (x * math.cos(angle) + y * math.sin(angle))
    dark = (0.5 + 0.5 * np.cos(2.0 * math.pi * along / pitch_um + phase)) ** 4
    light = 180.0 * (1.0 + 0.2 * x / WIDTH - 0.3 * (y / HEIGHT) ** 2)
    return np.clip(np.rint(light * (1.0 - 0.7 * dark) + rng.normal(0.0, 3.0, x.shape)), 0, 255).astype(np.uint8)


def fit(*pictures: np.ndarray, pitch_um: float = 10.0, uncertainty: float = 0.0) -> RulerFit:
    return fit_ruler([find_fringes(one, "picture") for one in pictures], pitch_um, uncertainty, "test")


@pytest.mark.slow
@settings(max_examples=12, suppress_health_check=[HealthCheck.too_slow])
@given(
    um_per_px=st.floats(0.8, 2.2),
    angle=st.floats(-math.pi / 2, math.pi / 2),
    distortion=st.floats(-0.04, 0.04),
    phase=st.floats(-3.0, 3.0),
)
def test_scale_and_distortion_come_back(um_per_px: float, angle: float, distortion: float, phase: float):
    found = fit(ruler(um_per_px, angle, distortion=distortion, phase=phase)).calibration
    assert found.um_per_px == pytest.approx(um_per_px, rel=5e-4)
    assert found.distortion == pytest.approx(distortion, abs=2e-3)
    assert 0.0 < found.uncertainty < 1e-3 * found.um_per_px
    assert found.residual_um < 0.1


def test_scale_goes_with_the_pitch_that_is_told():
    picture = ruler(1.5, 0.1)
    one, ten = (fit(picture, pitch_um=pitch).calibration.um_per_px for pitch in (1.0, 10.0))
    assert ten == pytest.approx(10.0 * one, rel=1e-9)


def test_two_pictures_share_a_scale_and_tell_where_they_disagree():
    agree = fit(ruler(1.5, 0.1), ruler(1.5, 1.6, seed=2))
    assert agree.calibration.um_per_px == pytest.approx(1.5, rel=3e-4)
    assert agree.lone_um_per_px == pytest.approx([1.5, 1.5], rel=3e-4)
    assert np.cos(2 * np.radians(agree.angles_deg)) == pytest.approx(np.cos([0.2, 3.2]), abs=1e-3)
    apart = fit(ruler(1.5, 0.1), ruler(1.503, 1.6, seed=2))
    assert apart.lone_um_per_px[1] / apart.lone_um_per_px[0] == pytest.approx(1.002, abs=3e-4)


def test_uncertainty_of_the_ruler_is_added():
    picture = ruler(1.5, 0.1)
    bare, told = fit(picture).calibration, fit(picture, uncertainty=2e-3).calibration
    assert told.uncertainty / told.um_per_px == pytest.approx(
        math.hypot(bare.uncertainty / bare.um_per_px, 2e-3), rel=1e-6
    )


@pytest.mark.parametrize(
    ("picture", "expected"),
    [
        (np.full((HEIGHT, WIDTH), 128, np.uint8), "no evenly spaced lines"),
        (np.random.default_rng(1).integers(0, 256, (HEIGHT, WIDTH), np.uint8), "no evenly spaced|found clear lines"),
        (ruler(1.5, 0.1, pitch_um=3.6), "px apart"),
        (ruler(1.5, 0.1, pitch_um=120.0), "no evenly spaced lines|lines across|found clear"),
    ],
)
def test_picture_without_a_ruler_is_refused(picture: np.ndarray, expected: str):
    with pytest.raises(InputError) as caught:
        fit(picture)
    assert any(words in str(caught.value) for words in expected.split("|")), caught.value


def test_pictures_of_two_sizes_are_refused():
    with pytest.raises(InputError, match="400 x 300, 400 x 200"):
        fit(ruler(1.5, 0.1), ruler(1.5, 0.1)[:200])


@given(
    um_per_px=st.floats(1e-3, 1e3),
    distortion=st.floats(-0.3, 0.3),
    centre=st.floats(0, 640),
    source=st.text(max_size=20),
)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_file_keeps_every_bit(tmp_path: Path, um_per_px: float, distortion: float, centre: float, source: str):
    calibration = Calibration(um_per_px, 1e-4, distortion, 640, 480, centre, 239.5, 0.01, 10.0, source)
    calibration.save(tmp_path / "calibration.toml")
    assert Calibration.load(tmp_path / "calibration.toml") == calibration


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (None, "expected a calibration"),
        ("nonsense", "not valid TOML"),
        ("um_per_px = 1.5", r"the one table \[calibration\]"),
        ("[calibration]\num_per_px = 1.5", "is missing"),
        ("[calibration]\ncolour = 1", "unknown key 'colour'"),
        ("[calibration]\num_per_px = -1.0\nuncertainty = 0.0\ndistortion = 0.0\nwidth_px = 640\nheight_px = 480\n"
         "centre_x_px = 1.0\ncentre_y_px = 1.0", "um_per_px: found -1.0, expected at least 0.0001"),
    ],
)  # fmt: skip
def test_bad_file_is_refused_by_name(tmp_path: Path, text: str | None, expected: str):
    path = tmp_path / "calibration.toml"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=expected) as caught:
        Calibration.load(path)
    assert str(path) in str(caught.value)


def test_bad_values_are_named():
    good = Calibration.of_scale(1.5)
    for change, named in (
        ({"um_per_px": math.nan}, "um_per_px"), ({"distortion": 0.5}, "distortion"), ({"width_px": 1.5}, "width_px"),
        ({"uncertainty": -1.0}, "uncertainty"), ({"source": 1}, "source"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=f"^{named}: found"):
            replace(good, **change)


def test_to_um_is_odd_about_the_centre_and_linear_without_distortion():
    straight, bent = Calibration.of_scale(1.5), replace(Calibration.of_scale(1.5), distortion=0.02)
    assert straight.to_um(319.5 + 10.0, 239.5 - 4.0) == pytest.approx((15.0, -6.0))
    there, back = bent.to_um(400.0, 300.0), bent.to_um(239.0, 179.0)
    assert there == pytest.approx((-back[0], -back[1]))
    corner = bent.to_um(639.5, 479.5)
    assert corner == pytest.approx((1.02 * 1.5 * 320.0, 1.02 * 1.5 * 240.0), rel=1e-3)


def test_command_writes_the_file_and_a_marked_picture(tmp_path: Path, capsys):
    picture = tmp_path / "ruler.png"
    cv2.imwrite(str(picture), ruler(1.4, 0.2, phase=1.0))
    out = tmp_path / "out" / "scale.toml"
    assert main(["calibrate", str(picture), "--out", str(out), "--ruler-uncertainty-percent", "0.1"]) == 0
    found = Calibration.load(out)
    assert found.um_per_px == pytest.approx(1.4, rel=5e-4)
    assert found.uncertainty / found.um_per_px == pytest.approx(1e-3, rel=0.05)
    assert str(picture) in found.source
    said = capsys.readouterr().out
    assert f"{found.um_per_px:.6f}" in said
    marked = cv2.imread(str(out.with_suffix(".png")))
    red = (marked == (0, 0, 255)).all(axis=2)
    levels = cv2.imread(str(picture), cv2.IMREAD_GRAYSCALE)
    # the red lines lie where the picture is dark
    assert red.sum() > 500
    assert levels[red].mean() < levels.mean() - 20.0


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ([], "expected one of PICTURE"),
        (["a.png", "--emulated"], "expected one of PICTURE"),
        (["missing.png"], "missing.png: cannot be read"),
        (["--emulated", "--pitch-um", "0"], "--pitch-um: found 0.0"),
        (["--emulated", "--ruler-uncertainty-percent", "50"], "--ruler-uncertainty-percent: found 50.0"),
        (["--emulated", "--frames", "0"], "--frames: found 0"),
        (["--emulated", "--out", "scale.json"], "--out: found scale.json"),
        (["--camera", "gone.mp4"], "camera gone.mp4: found no such file"),
    ],
)
def test_command_refuses_in_one_line_and_writes_nothing(tmp_path, monkeypatch, capsys, words, expected):
    monkeypatch.chdir(tmp_path)
    assert main(["calibrate", *words]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert len(said.err.splitlines()) == 1
    assert expected in said.err
    assert list(tmp_path.iterdir()) == []


def test_command_calibrates_the_emulated_microscope(tmp_path: Path):
    out = tmp_path / "calibration.toml"
    assert main(["calibrate", "--emulated", "--out", str(out)]) == 0
    found = Calibration.load(out)
    assert found.um_per_px == pytest.approx(1.5, rel=5e-4)
    assert (found.width_px, found.height_px) == (640, 480)


@pytest.mark.parametrize("kind", [".png", ".jpg", ".bmp"])
def test_a_damaged_picture_makes_no_library_speak(kind: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    rng = np.random.default_rng(1)
    whole = bytes(cv2.imencode(kind, rng.integers(0, 255, (60, 80, 3), np.uint8))[1])
    for damage in range(20):
        data = bytearray(whole[: rng.integers(len(whole) // 2, len(whole) + 1)])
        for _ in range(10 * (damage % 3)):
            data[rng.integers(min(40, len(data)), len(data))] = rng.integers(256)
        (tmp_path / "picture").write_bytes(data)
        with contextlib.suppress(InputError):
            read_picture(tmp_path / "picture")
    assert capfd.readouterr() == ("", "")


def test_a_check_does_not_write_over_an_earlier_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    (tmp_path / "check.json").write_text("{}")
    assert main(["bench", "check", "--out", str(tmp_path)]) == 2
    assert "already holds a check; choose another directory with --out" in capsys.readouterr().err
    assert (tmp_path / "check.json").read_text() == "{}"
