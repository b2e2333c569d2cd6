"""A run as NeXus: bit for bit, with units, uncertainty and where it comes from."""

import json
from pathlib import Path

import numpy as np
import pytest

from bender_cli.main import main
from bender_hil.calibration.sensor_scale import fit_sensor
from bender_hil.log.nexus import NEXUS, read_nexus, write_nexus
from bender_loop.errors import InputError
from bender_loop.records.record import Record, read_record, write_record
from piezo_bender import load_record

h5py = pytest.importorskip("h5py")

RNG = np.random.default_rng(2)
TIME_S = np.cumsum(RNG.uniform(0.02, 0.04, 50))
MOVED_UM = np.where(RNG.random(50) < 0.1, np.nan, 20.0 * RNG.random(50))


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """The journals and the record of a run, as the runner writes them."""
    calibration = fit_sensor([0.0, 4.0], [0.0, 100.0], "V", reference_um=0.5)
    fields = {name: getattr(calibration, name) for name in calibration.__dataclass_fields__}
    start = {
        "n": 0, "t": 0.0, "kind": "start", "date": "2026-11-27T12:00:00+00:00", "emulated": True,
        "calibration": fields, "metadata": {"operator": "me", "specimen": "bender 3", "room": "12"},
        "versions": {"piezo-bender": "0.2.0"},
        "sensor": {"kind": "multimeter", "identity": {"manufacturer": "Keysight", "model": "34465A"}, "cannot": []},
    }  # fmt: skip
    rest = {"n": 1, "t": 1.0, "kind": "rest", "noise_um": 0.03}
    (tmp_path / "run.jsonl").write_text(f"{json.dumps(start)}\n{json.dumps(rest)}\n")
    opened = {"n": 0, "t": 0.0, "kind": "opened", "manufacturer": "Siglent", "model": "SDG1032X", "serial": "7"}
    (tmp_path / "guard.jsonl").write_text(f"{json.dumps(opened)}\n")
    write_record(
        tmp_path / "record.csv", Record(TIME_S, 50.0 * RNG.random(50), MOVED_UM, setpoint_um=np.full(50, 12.0))
    )
    return tmp_path


def test_the_record_comes_back_bit_for_bit(run: Path):
    path = write_nexus(run)
    assert path == run / NEXUS
    told, back = read_record(run / "record.csv").columns(), read_nexus(path).columns()
    assert list(told) == list(back)
    for name, values in told.items():
        assert np.asarray(values).tobytes() == np.asarray(back[name]).tobytes(), name


def test_every_command_reads_it_as_a_record(run: Path):
    loaded = load_record(write_nexus(run))
    assert np.array_equal(loaded.record.displacement_um, MOVED_UM, equal_nan=True)


def test_a_viewer_finds_the_signal_its_axis_its_units_and_its_errors(run: Path):
    with h5py.File(write_nexus(run)) as file:
        entry = file[file.attrs["default"]]
        data = entry[entry.attrs["default"]]
        assert (entry.attrs["NX_class"], data.attrs["NX_class"]) == ("NXentry", "NXdata")
        signal, axis = data[data.attrs["signal"]], data[data.attrs["axes"][0]]
        assert signal.shape == axis.shape == data[f"{data.attrs['signal']}_errors"].shape
        assert (signal.attrs["units"], axis.attrs["units"]) == ("um", "s")
        # 0.5 um at each end of 100 um is 0.707 % of the scale; the noise at rest beside it
        errors = np.array(data["displacement_um_errors"])
        expected = np.hypot(0.5 * np.sqrt(2.0) / 100.0 * MOVED_UM, 0.03)
        np.testing.assert_allclose(errors, expected, rtol=1e-9)
        assert entry["user/name"][()] == b"me"
        assert entry["sample/name"][()] == b"bender 3"
        assert entry["metadata/room"][()] == b"12"
        assert entry["instrument/source/model"][()] == b"SDG1032X"
        assert json.loads(entry["provenance/data"][()])["date"].startswith("2026-11-27")


def test_a_file_is_not_written_over_and_a_folder_without_a_run_is_told(run: Path, tmp_path: Path, capsys):
    assert main(["hil", "nexus", str(run)]) == 0
    assert main(["hil", "nexus", str(run)]) == 2
    assert "is there already" in capsys.readouterr().err
    assert main(["hil", "nexus", str(run), "--out", str(tmp_path / "other.h5")]) == 0
    (tmp_path / "text.h5").write_text("no HDF5")
    with pytest.raises(InputError, match="layout of NeXus"):
        read_nexus(tmp_path / "text.h5")
