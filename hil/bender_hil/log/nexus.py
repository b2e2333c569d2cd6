"""A run as one HDF5 file in the layout of NeXus (NXentry with NXdata, NXsample, NXuser, NXinstrument).

The columns of the record are its datasets, bit for bit and under their own names, so every command reads the file like
any other HDF5 record. Beside them stand units, the standard uncertainty of each displacement, what the bench file says
under `[metadata]`, the identities of the instruments, and the first line of the run's journal as it is.

The uncertainty is that of the scale, which grows with the distance from rest, and the sensor's noise at rest, added as
squares (ISO/IEC Guide 98-3, 2008). It is left out where neither is known.
"""

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bender_hil.calibration.sensor_scale import SensorCalibration
from bender_hil.log.read_run import RunLog, malformed_is_bad_input, read_run
from bender_hil.log.results import RECORD
from bender_loop.errors import InputError
from bender_loop.records.record import Record, read_record
from bender_loop.shell.extras import install_command

NEXUS = "record.nxs.h5"
_UNITS = {"s": "s", "V": "V", "um": "um", "A": "A", "C": "degC"}
_USERS = {"operator": "name", "affiliation": "affiliation", "email": "email"}
_SAMPLES = {"specimen": "name", "material": "chemical_formula", "description": "description"}


def write_nexus(directory: Path, out: Path | None = None) -> Path:
    """Write the file of a run; returns its path.

    Args:
        directory: of the run.
        out: of the file; `record.nxs.h5` in the directory of the run where None.

    Raises:
        InputError: there is no run with a record, the file is there already or cannot be written, or h5py is missing.
    """
    h5py = _h5py()
    out = directory / NEXUS if out is None else out
    if out.exists():
        raise InputError(f"{out}: is there already; name another file with --out")
    log = read_run(directory)
    record = read_record(directory / RECORD)
    part = out.with_name(f".{out.name}.tmp")
    try:
        with malformed_is_bad_input(directory), h5py.File(part, "w") as file:
            _fill(file, log, record, hashlib.sha256((directory / RECORD).read_bytes()).hexdigest())
        part.replace(out)
    except OSError as error:
        raise InputError(f"{out}: cannot be written ({error.strerror or error})") from error
    finally:
        part.unlink(missing_ok=True)
    return out


def uncertainty_um(log: RunLog, record: Record) -> NDArray[np.float64] | None:
    """Return the standard uncertainty of each displacement, (n,); None where nothing is known of it."""
    noise_um = next((entry["noise_um"] for entry in log.events if entry["kind"] == "rest"), None)
    part = _scale_part(log.start.get("calibration"))
    if noise_um is None and not part:
        return None
    # displacements count from rest
    return np.hypot(part * np.asarray(record.displacement_um), noise_um or 0.0)


def _scale_part(calibration: dict[str, Any] | None) -> float:
    """Standard uncertainty of the scale, as a part of it; 0 where it is not known."""
    if calibration is None:
        return 0.0
    if "um_per_px" in calibration:
        return float(calibration["uncertainty"]) / float(calibration["um_per_px"])
    return SensorCalibration(**calibration).span_percent / 100.0


def _fill(file: Any, log: RunLog, record: Record, digest: str) -> None:
    entry = _group(file, "entry", "NXentry")
    file.attrs["default"], entry.attrs["default"] = "entry", "data"
    metadata = dict(log.start.get("metadata") or {})
    entry["title"] = metadata.pop("title", log.directory.name)
    entry["start_time"] = str(log.start.get("date", ""))
    entry["program_name"] = "piezo-bender"
    entry["program_name"].attrs["version"] = str(log.start.get("versions", {}).get("piezo-bender", "unknown"))
    _data(entry, record, uncertainty_um(log, record))
    user, sample = _group(entry, "user", "NXuser"), _group(entry, "sample", "NXsample")
    for name in list(metadata):
        for group, known in ((user, _USERS), (sample, _SAMPLES)):
            if name in known:
                group[known[name]] = metadata.pop(name)
    notes = _group(entry, "metadata", "NXcollection")
    for name, text in metadata.items():
        notes[name] = text
    _instruments(entry, log)
    provenance = _group(entry, "provenance", "NXnote")
    provenance["type"] = "application/json"
    provenance["data"] = json.dumps(log.start)
    provenance["sha256_of_the_record"] = digest


def _data(entry: Any, record: Record, errors_um: NDArray[np.float64] | None) -> None:
    data = _group(entry, "data", "NXdata")
    data.attrs["signal"], data.attrs["axes"] = "displacement_um", ["time_s"]
    data.attrs["auxiliary_signals"] = ["voltage_V"]
    for name, values in record.columns().items():
        dataset = data.create_dataset(name, data=np.asarray(values, dtype=np.float64))
        dataset.attrs["units"] = _UNITS[name.rpartition("_")[2]]
    if errors_um is not None:
        data.create_dataset("displacement_um_errors", data=errors_um).attrs["units"] = "um"


def _instruments(entry: Any, log: RunLog) -> None:
    instrument = _group(entry, "instrument", "NXinstrument")
    source, opened = _group(instrument, "source", "NXcollection"), log.guard_entry("opened") or {}
    for name in ("manufacturer", "model", "serial", "firmware"):
        source[name] = str(opened.get(name, ""))
    sensor, told = _group(instrument, "sensor", "NXsensor"), log.start.get("sensor")
    sensor["model"] = "camera" if told is None else " ".join(str(x) for x in (told["identity"] or {}).values() if x)
    sensor["measurement"] = "displacement"
    sensor["calibration"] = json.dumps(log.start.get("calibration"))


def _group(parent: Any, name: str, kind: str) -> Any:
    group = parent.create_group(name)
    group.attrs["NX_class"] = kind
    return group


def _h5py() -> Any:
    try:
        import h5py
    except ImportError as error:
        raise InputError(f"a file of NeXus needs h5py: {install_command('formats')}") from error
    return h5py
