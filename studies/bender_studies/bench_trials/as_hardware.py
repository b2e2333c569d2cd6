"""The bench file that drives a running emulated bench as hardware is."""

from dataclasses import asdict, fields, is_dataclass
from pathlib import Path
from typing import Any

from bender_hil.bench_file import CameraTable
from bender_hil.emulated import MICROSCOPE, EmulatedBench, EmulationSettings
from bender_hil.guard.settings import GuardSettings
from bender_hil.sources.amplifier import Amplifier
from bender_hil.sources.kinds import kind_of
from bender_vision.scale import Calibration

HARMLESS_V = 1.0


def write_bench(
    folder: Path,
    bench: EmulatedBench,
    settings: EmulationSettings,
    limits: GuardSettings,
    amplifier: Amplifier | None = None,
    zero_readings: int = 5,
) -> Path:
    """Write the bench file that drives a running emulated bench as hardware is; returns its path."""
    import tomli_w

    source = settings.source(bench.resource)
    tables: dict[str, Any] = {"source": {"kind": kind_of(source), **_table(source)}, "guard": _table(limits)}
    if amplifier is not None:
        tables["amplifier"] = _table(amplifier)
    if settings.sensor == MICROSCOPE:
        Calibration.of_scale(1.5).save(folder / "calibration.toml")
        tables["camera"] = _table(CameraTable(bench.stream, calibration="calibration.toml", zero_frames=zero_readings))
    else:
        told = settings.sensor_table(str(bench.sensor_resource))
        sensor = {"kind": told.kind, "rate_Hz": told.rate_Hz, "zero_readings": zero_readings}
        tables["sensor"] = sensor | _table(told.instrument)
        calibration = settings.sensor_calibration()
        if calibration is not None:
            calibration.save(folder / "sensor.toml")
            tables["sensor"]["calibration"] = "sensor.toml"
    path = folder / "bench.toml"
    path.write_text(tomli_w.dumps(tables), encoding="utf-8")
    return path


def _table(settings: Any) -> dict[str, Any]:
    """Return what differs from the defaults, as a bench file would say it."""
    assert is_dataclass(settings)
    told = {}
    for field in fields(settings):
        value = getattr(settings, field.name)
        if value != field.default:
            told[field.name] = list(value) if isinstance(value, tuple) else value
    return {name: asdict(value) if is_dataclass(value) else value for name, value in told.items()}  # pyright: ignore[reportArgumentType]
