"""The bench file: one TOML file says which instruments there are, or that they are emulated, and what limits hold.

Its tables are the settings of the parts, key by key; an unknown key, a wrong type or a value out of its range is an
error that names it. Without a file the emulated bench is used, with every default.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import MISSING, asdict, dataclass, field, fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, TypeVar, get_args, get_origin, get_type_hints

from bender_emulator.microscope.settings import SceneSettings
from bender_hil.calibration.sensor_scale import SensorCalibration
from bender_hil.camera.settings import CameraSettings
from bender_hil.emulated import MICROSCOPE, EmulationSettings
from bender_hil.guard.settings import GuardSettings
from bender_hil.sensors.kinds import CAMERA, sensor_class, sensor_kinds
from bender_hil.sensors.table import COMMON, SensorTable, conversion
from bender_hil.sources.amplifier import Amplifier
from bender_hil.sources.kinds import (
    SourceSettings,
    address_of,
    check_source,
    has_protection,
    source_class,
    source_kinds,
)
from bender_hil.supply.select import SupplySettings
from bender_hil.supply.source import USUAL_PROTECTION_V
from bender_loop.bounds import Bounds, check_numbers
from bender_loop.errors import InputError
from bender_loop.shell.complaint import first_complaint
from bender_loop.shell.toml_file import read_toml_file
from bender_vision.scale import Calibration
from bender_vision.settings import TrackerSettings

_T = TypeVar("_T")
_MOST_DEVICES, _LONGEST_SENTENCE = 255, 300
_SUPPLY_BOUNDS: dict[str, Bounds] = {
    "timeout_s": (0.005, 30.0),
    "baud": (300, 10_000_000),
    "spacing_s": (0.0, 1.0),
    "gain": (-1e4, 1e4),
}
_BEYOND = 1.1
"""So many times the highest voltage lies the protection that a source does not have."""
_LEAST_PERIODS = 2.0
"""So many times between readings the guard waits at the least for one."""
OF_SENSOR = ("heartbeat_s", "frame_age_s")
"""Limits of the guard that a file may leave to what the sensor does at rest."""
_LEAST_WIRE_PX, _LARGEST_WIRE = 2.0, 0.25
"""The wire is at least so many pixels thick, and at most this share of the picture."""


@dataclass(frozen=True, slots=True)
class CameraTable:
    """The table `[camera]`: where the frames come from.

    Attributes:
        source: device number, file, or address of a stream; None only on the emulated bench.
        frames_per_s: rate of the camera, which is the rate of the loop.
        delay_s: age of a picture when it is grabbed: half the exposure, readout and transport.
        exposure_s: how long the shutter is open, which goes into the record; None where it is not known.
        calibration: file that `bender calibrate` wrote; None only on the emulated bench.
        zero_frames: so many frames at 0 V make the rest position.
    """

    source: str | int | None = None
    frames_per_s: float = 30.0
    delay_s: float | None = None
    exposure_s: float | None = None
    calibration: str | None = None
    zero_frames: int = 15

    def __post_init__(self) -> None:
        bounds = {
            "frames_per_s": (1.0, 1000.0), "delay_s": (0.0, 1.0), "exposure_s": (0.0, 1.0), "zero_frames": (1, 1000),
        }  # fmt: skip
        check_numbers(self, bounds, whole=("zero_frames",))
        if (self.exposure_s or 0.0) * self.frames_per_s > 1.0:
            raise ValueError(
                f"exposure_s: found {self.exposure_s:g}, expected at most the time between frames, "
                f"{1.0 / self.frames_per_s:.4g} s"
            )
        if isinstance(self.source, int) and not 0 <= self.source <= _MOST_DEVICES:
            raise ValueError(f"source: found {self.source}, expected a device number from 0 to {_MOST_DEVICES}")


@dataclass(frozen=True, slots=True)
class ControllerTable:
    """The table `[controller]`.

    Attributes:
        gains: file that `bender tune` wrote; None for the gains that come with the package.
        realtime: controller and guard run before every ordinary process (Linux, needs the right to).
        response_um_per_V: how far the tip moves per volt, at the least: a tip that does not ends the run. The default
            is half of what the paper's actuator does; 0 expects nothing.
        slack_V: so far the command may go without moving the tip: dead zone and play.
    """

    gains: str | None = None
    realtime: bool = False
    response_um_per_V: float = 0.2
    slack_V: float = 10.0

    def __post_init__(self) -> None:
        check_numbers(self, {"response_um_per_V": (0.0, 1e3), "slack_V": (0.0, 1e3)})


@dataclass(frozen=True, slots=True)
class BenchFile:
    """A bench.

    Attributes:
        source: what feeds the actuator; None on the emulated bench.
        amplifier: behind the source; None for none.
        sensor: what says where the tip is; None for the camera.
        camera: where frames come from.
        camera_settings: how the camera is opened and what is locked on it, from `[camera.settings]`.
        vision: how the tip is looked for.
        guard: limits.
        controller: gains.
        emulator: the emulated bench; None for a real one.
        metadata: what else is to be known of the bench, for the log: specimen, operator, room.
        path: of the file, None for the defaults.
        follows_sensor: limits of the guard that follow from how steadily readings come at rest, of `OF_SENSOR`.
    """

    source: SourceSettings | None = None
    amplifier: Amplifier | None = None
    sensor: SensorTable | None = None
    camera: CameraTable = field(default_factory=CameraTable)
    camera_settings: CameraSettings = field(default_factory=CameraSettings)
    vision: TrackerSettings = field(default_factory=TrackerSettings)
    guard: GuardSettings = field(default_factory=GuardSettings)
    controller: ControllerTable = field(default_factory=ControllerTable)
    emulator: EmulationSettings | None = None
    metadata: dict[str, str] = field(default_factory=dict)
    path: Path | None = None
    follows_sensor: tuple[str, ...] = ()

    @property
    def address(self) -> str | None:
        """What tells the source from any other, for locks; None on the emulated bench."""
        return None if self.source is None else address_of(self.source)

    @property
    def rate_Hz(self) -> float:
        """Readings per second, which is the rate of the loop."""
        return self.camera.frames_per_s if self.sensor is None else self.sensor.rate_Hz

    @property
    def delay_s(self) -> float | None:
        """Age of a reading when it has its time; None where the file does not say it."""
        return self.camera.delay_s if self.sensor is None else self.sensor.delay_s

    @property
    def exposure_s(self) -> float | None:
        """How long a reading averages; None where it is not known."""
        return self.camera.exposure_s if self.sensor is None else self.sensor.averaged_s

    @property
    def deadline_s(self) -> float:
        """From the instant of a reading until its command is late: one period after the reading is complete."""
        averaged_s = 0.0 if self.sensor is None else self.sensor.averaged_s or 0.0
        return 1.0 / self.rate_Hz + 0.5 * averaged_s

    @property
    def zero_readings(self) -> int:
        """So many readings at 0 V make the rest position."""
        return self.camera.zero_frames if self.sensor is None else self.sensor.zero_readings

    def resolve(self, name: str) -> Path:
        """A file that the bench file names: relative names count from where the bench file lies."""
        return Path(name) if self.path is None else self.path.parent / name

    def calibration_of_readings(self) -> Calibration | SensorCalibration | None:
        """What readings are worth, of the camera or of the sensor; None of a sensor that gives a length. InputError."""
        return self.load_calibration() if self.sensor is None else self.load_sensor_calibration()

    def load_sensor_calibration(self) -> SensorCalibration | None:
        """What the sensor's unit is worth; None where it is a length, or where the sensor is the camera. InputError."""
        if self.sensor is None:
            return None
        calibration = None
        if self.sensor.calibration is not None:
            calibration = SensorCalibration.load(self.resolve(self.sensor.calibration))
        elif self.emulator is not None:
            calibration = self.emulator.sensor_calibration()
        try:
            conversion(self.sensor.instrument.make(self.sensor.rate_Hz).unit, calibration)
        except ValueError as error:
            raise InputError(f"{self.path or 'bench'}: sensor: {error}") from None
        return calibration

    def load_calibration(self) -> Calibration:
        """The camera's calibration; that of the scene on an emulated bench that names none. InputError."""
        if self.camera.calibration is not None:
            calibration = Calibration.load(self.resolve(self.camera.calibration))
        else:
            scene = SceneSettings.from_table(self.emulator.scene if self.emulator is not None else {})
            calibration = Calibration.of_scale(scene.um_per_px, scene.width_px, scene.height_px)
        thick_px = self.vision.wire_um / calibration.um_per_px
        most_px = _LARGEST_WIRE * min(calibration.width_px, calibration.height_px)
        if not _LEAST_WIRE_PX <= thick_px <= most_px:
            raise InputError(
                f"{self.path or 'bench'}: a wire of vision.wire_um = {self.vision.wire_um:g} µm is {thick_px:.3g} "
                f"pixels thick at {calibration.um_per_px:g} µm per pixel, expected {_LEAST_WIRE_PX:g} ... {most_px:g}"
            )
        return calibration

    def facts(self) -> dict[str, Any]:
        """Everything, for the log."""
        return {**asdict(self), "path": None if self.path is None else str(self.path)}


def emulated_bench() -> BenchFile:
    """The bench that is there when no file is given."""
    return BenchFile(emulator=EmulationSettings(), follows_sensor=OF_SENSOR)


def read_bench(path: Path) -> BenchFile:
    """Read a bench file.

    Raises:
        InputError: naming the file and the key, what was found and what was expected.
    """
    path = Path(path)
    table = read_toml_file(path, "a bench file (TOML)")
    known = (
        "source", "supply", "amplifier", "sensor", "camera", "vision", "guard", "controller", "emulator", "metadata",
    )  # fmt: skip
    for name in table:
        if name not in known:
            raise InputError(f"{path}: found the unknown table {name!a:.60}, expected some of {', '.join(known)}")
    sensor = dict(_table(path, table, "sensor"))
    camera = dict(_table(path, table, "camera"))
    if sensor.get("kind") == CAMERA:
        if "camera" in table:
            raise InputError(f"{path}: [camera] stands beside [sensor] with kind = {CAMERA!r}; put everything into one")
        del sensor["kind"]
        sensor, camera = {}, sensor
    camera_settings = _made(path, "camera.settings", CameraSettings, _table(path, camera, "settings"))
    camera.pop("settings", None)
    emulator = _made(path, "emulator", EmulationSettings, table["emulator"]) if "emulator" in table else None
    source = _source(path, table)
    bench = BenchFile(
        source=source,
        amplifier=_made(path, "amplifier", Amplifier, table["amplifier"]) if "amplifier" in table else None,
        sensor=_sensor(path, sensor) if sensor else None,
        camera=_made(path, "camera", CameraTable, camera),
        camera_settings=camera_settings,
        vision=_made(path, "vision", TrackerSettings, _table(path, table, "vision")),
        guard=_guard(path, _table(path, table, "guard"), emulator.source("") if emulator else source),
        controller=_made(path, "controller", ControllerTable, _table(path, table, "controller")),
        emulator=emulator,
        metadata=_metadata(path, _table(path, table, "metadata")),
        path=path,
        follows_sensor=tuple(name for name in OF_SENSOR if name not in _table(path, table, "guard")),
    )
    if isinstance(bench.source, SupplySettings):
        _check_supply(path, bench.source)
    _check(path, bench)
    if emulator is not None and emulator.sensor != MICROSCOPE:
        bench = replace(bench, sensor=emulator.sensor_table(""))
    _check_rate(path, bench)
    return bench


def _guard(path: Path, table: dict[str, Any], source: SourceSettings | None) -> GuardSettings:
    """The limits; a source that has no protection needs no level of it, which then lies above whatever is asked for."""
    given: dict[str, Any] = {}
    if source is not None and not has_protection(source) and "protection_V" not in table:
        ends_V = [table.get(name) for name in ("maximum_V", "minimum_V")]
        highest_V = max((abs(x) for x in ends_V if isinstance(x, int | float)), default=0.0)
        if 0.0 < _BEYOND * highest_V < math.inf:
            given["protection_V"] = max(_BEYOND * highest_V, USUAL_PROTECTION_V)
    return _made(path, "guard", GuardSettings, table, given)


def _source(path: Path, table: dict[str, Any]) -> SourceSettings | None:
    """What `[source]` or `[supply]` names; None for neither."""
    if "supply" in table and "source" in table:
        raise InputError(f"{path}: [supply] stands beside [source]; a bench has one source")
    if "supply" in table:
        return _made(path, "supply", SupplySettings, table["supply"])
    if "source" not in table:
        return None
    kind, settings = _of_a_kind(path, "source", dict(_table(path, table, "source")), source_class, source_kinds)
    try:
        check_source(kind, settings)
    except ValueError as error:
        raise InputError(f"{path}: source: {error}") from None
    return settings


def _sensor(path: Path, table: dict[str, Any]) -> SensorTable:
    common = {name: table.pop(name) for name in COMMON if name in table}
    kind, instrument = _of_a_kind(path, "sensor", table, sensor_class, sensor_kinds)
    return _made(path, "sensor", SensorTable, common, {"kind": kind, "instrument": instrument})


def _of_a_kind(
    path: Path, name: str, table: dict[str, Any], find: Callable[[str], type[Any]], known: Callable[[], list[str]]
) -> tuple[str, Any]:
    """The kind that a table names, and the settings of that kind from its other keys."""
    kind = table.pop("kind", None)
    if not isinstance(kind, str):
        raise InputError(f"{path}: {name}.kind: found {kind!r:.60}, expected one of {', '.join(known())}")
    try:
        settings = find(kind)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return kind, _made(path, name, settings, table)


def _metadata(path: Path, table: dict[str, Any]) -> dict[str, str]:
    for name, value in table.items():
        if not isinstance(value, str) or not value.isprintable() or len(value) > _LONGEST_SENTENCE:
            raise InputError(_shortened(f"{path}: metadata.{name}: found {value!r}, expected a text of one line"))
    return dict(table)


def _check_supply(path: Path, supply: SupplySettings) -> None:
    try:
        check_numbers(supply, _SUPPLY_BOUNDS, whole=("baud",))
    except ValueError as error:
        raise InputError(f"{path}: supply: {error}") from None
    if supply.gain == 0.0:
        raise InputError(f"{path}: supply: gain: found 0, expected a number other than 0")


_WHAT_IT_IS = {
    "supply": "a section with the resource and the model of the power supply, or [source] with its kind",
    "camera.source": "the number of a camera, its address, or a video file that stands for one",
    "camera.calibration": "a file that `bender calibrate` makes",
}


def _check(path: Path, bench: BenchFile) -> None:
    """A bench is wholly emulated or not at all: a real supply with an emulated camera would be driven blindly."""
    if bench.emulator is None:
        needed: dict[str, object] = {"supply": bench.source}
        if bench.sensor is None:
            needed |= {"camera.source": bench.camera.source, "camera.calibration": bench.camera.calibration}
        for name, found in needed.items():
            if found is None:
                raise InputError(f"{path}: {name} is missing, {_WHAT_IT_IS[name]}; a bench without [emulator] needs it")
        return
    for name, found in (("supply", bench.source), ("sensor", bench.sensor), ("camera.source", bench.camera.source)):
        if found is not None:
            raise InputError(f"{path}: {name} stands beside [emulator]; emulate everything or nothing")
    try:
        SceneSettings.from_table(bench.emulator.scene)
    except ValueError as error:
        raise InputError(f"{path}: emulator.scene: {error}") from None
    period_s = 1.0 / bench.camera.frames_per_s
    if bench.emulator.exposure_s > period_s:
        raise InputError(
            f"{path}: emulator: exposure_s: found {bench.emulator.exposure_s:g}, expected at most the time between "
            f"frames, {period_s:.4g} s"
        )


def _check_rate(path: Path, bench: BenchFile) -> None:
    """The guard's patience suits the sensor, and its slew the amplifier."""
    guard, amplifier = bench.guard, bench.amplifier
    if bench.sensor is not None and guard.frame_age_s < _LEAST_PERIODS / bench.rate_Hz:
        raise InputError(
            f"{path}: sensor.rate_Hz = {bench.rate_Hz:g} gives a reading every {1e3 / bench.rate_Hz:.0f} ms, and "
            f"guard.frame_age_s ends a run after {1e3 * guard.frame_age_s:.0f} ms; set it to at least "
            f"{_LEAST_PERIODS / bench.rate_Hz:.3g}"
        )
    if amplifier is None:
        return
    if amplifier.slew_V_per_s is not None and guard.slew_V_per_s > amplifier.slew_V_per_s:
        raise InputError(
            f"{path}: guard.slew_V_per_s: found {guard.slew_V_per_s:g}, expected at most what the amplifier can do, "
            f"{amplifier.slew_V_per_s:g} (amplifier.slew_V_per_s)"
        )
    if abs(amplifier.offset_V) >= guard.safe_V:
        raise InputError(
            f"{path}: amplifier.offset_V: found {amplifier.offset_V:g}, expected less than guard.safe_V = "
            f"{guard.safe_V:g}: it stays at the actuator when the source is off; trim the amplifier"
        )
    for name, wanted_V in (("maximum_V", guard.maximum_V), ("minimum_V", guard.minimum_V)):
        if not amplifier.lowest_V <= wanted_V <= amplifier.highest_V:
            raise InputError(
                f"{path}: guard.{name}: found {wanted_V:g}, the amplifier gives {amplifier.lowest_V:g} ... "
                f"{amplifier.highest_V:g} V"
            )


def _table(path: Path, table: dict[str, Any], name: str) -> dict[str, Any]:
    found = table.get(name, {})
    if not isinstance(found, dict):
        raise InputError(_shortened(f"{path}: {name}: found {found!r}, expected a table"))
    return found


def _made(path: Path, name: str, kind: type[_T], table: Any, given: Mapping[str, Any] = MappingProxyType({})) -> _T:
    """A part's settings from its table: types by pydantic, values by the settings themselves; `given` go beside it."""
    from pydantic import ConfigDict, Field, ValidationError, create_model

    if not isinstance(table, dict):
        raise InputError(_shortened(f"{path}: {name}: found {table!r}, expected a table"))
    if (found := _unprintable(table)) is not None:
        raise InputError(f"{path}: {name}: found the text {found!a:.60}, expected printable characters")
    hints = get_type_hints(kind)
    columns: dict[str, Any] = {}
    for entry in fields(kind):  # pyright: ignore[reportArgumentType]
        if entry.name in given:
            continue
        hint = hints[entry.name]
        is_tuple = any(get_origin(part) is tuple for part in (hint, *get_args(hint)))
        hint = Annotated[hint, Field(strict=False)] if is_tuple else hint
        columns[entry.name] = (hint, ... if entry.default is entry.default_factory is MISSING else None)
    model = create_model(kind.__name__, __config__=ConfigDict(extra="forbid", strict=True), **columns)
    try:
        checked = model.model_validate(table)
    except ValidationError as error:
        raise InputError(f"{path}: {_shortened(first_complaint(error, name))}") from None
    try:
        return kind(**given, **{key: getattr(checked, key) for key in checked.model_fields_set})
    except (ValueError, OverflowError) as error:
        raise InputError(f"{path}: {name}: {_shortened(str(error))}") from None


def _shortened(sentence: str) -> str:
    """Return a sentence that quotes what was found, however long that is."""
    return sentence if len(sentence) <= _LONGEST_SENTENCE else f"{sentence[:_LONGEST_SENTENCE]} ..."


def _unprintable(value: Any) -> str | None:
    """Return the first text in a table that can be no name of a file or an instrument, None for none."""
    for part in [*value.keys(), *value.values()] if isinstance(value, dict) else value:
        if isinstance(part, str) and not part.isprintable():
            return part
        if isinstance(part, dict | list) and (found := _unprintable(part)) is not None:
            return found
    return None
