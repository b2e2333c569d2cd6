"""The bench file: one TOML file says which instruments there are, or that they are emulated, and what limits hold.

Its tables are the settings of the parts, key by key; an unknown key, a wrong type or a value out of its range is an
error that names it. Without a file the emulated bench is used, with every default.
"""

from dataclasses import MISSING, asdict, dataclass, field, fields
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_origin, get_type_hints

from bender_hil.bounds import Bounds, check_numbers
from bender_hil.calibration.scale import Calibration
from bender_hil.camera.settings import CameraSettings
from bender_hil.emulator.bench import EmulationSettings
from bender_hil.emulator.microscope.settings import SceneSettings
from bender_hil.guard.settings import GuardSettings
from bender_hil.supply.select import SupplySettings
from bender_hil.vision.settings import TrackerSettings
from bender_loop.errors import InputError
from bender_loop.shell.complaint import first_complaint
from bender_loop.shell.toml_file import read_toml_file

_T = TypeVar("_T")
_MOST_DEVICES, _LONGEST_SENTENCE = 255, 300
_SUPPLY_BOUNDS: dict[str, Bounds] = {
    "timeout_s": (0.005, 30.0),
    "baud": (300, 10_000_000),
    "spacing_s": (0.0, 1.0),
    "gain": (-1e4, 1e4),
}
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
        supply: the instrument; None on the emulated bench.
        camera: where frames come from.
        camera_settings: how the camera is opened and what is locked on it, from `[camera.settings]`.
        vision: how the tip is looked for.
        guard: limits.
        controller: gains.
        emulator: the emulated bench; None for a real one.
        path: of the file, None for the defaults.
    """

    supply: SupplySettings | None = None
    camera: CameraTable = field(default_factory=CameraTable)
    camera_settings: CameraSettings = field(default_factory=CameraSettings)
    vision: TrackerSettings = field(default_factory=TrackerSettings)
    guard: GuardSettings = field(default_factory=GuardSettings)
    controller: ControllerTable = field(default_factory=ControllerTable)
    emulator: EmulationSettings | None = None
    path: Path | None = None

    def resolve(self, name: str) -> Path:
        """A file that the bench file names: relative names count from where the bench file lies."""
        return Path(name) if self.path is None else self.path.parent / name

    def load_calibration(self) -> Calibration:
        """The camera's calibration; that of the scene on an emulated bench that names none. InputError."""
        if self.camera.calibration is not None:
            calibration = Calibration.load(self.resolve(self.camera.calibration))
        else:
            scene = SceneSettings.from_table(self.emulator.scene if self.emulator is not None else {})
            calibration = Calibration.told(scene.um_per_px, scene.width_px, scene.height_px)
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
    return BenchFile(emulator=EmulationSettings())


def read_bench(path: Path) -> BenchFile:
    """Read a bench file.

    Raises:
        InputError: naming the file and the key, what was found and what was expected.
    """
    path = Path(path)
    table = read_toml_file(path, "a bench file (TOML)")
    camera = dict(_table(path, table, "camera"))
    known = {
        "supply": SupplySettings,
        "camera": CameraTable,
        "vision": TrackerSettings,
        "guard": GuardSettings,
        "controller": ControllerTable,
        "emulator": EmulationSettings,
    }
    for name in table:
        if name not in known:
            raise InputError(f"{path}: found the unknown table {name!a:.60}, expected some of {', '.join(known)}")
    camera_settings = _made(path, "camera.settings", CameraSettings, _table(path, camera, "settings"))
    camera.pop("settings", None)
    bench = BenchFile(
        supply=_made(path, "supply", SupplySettings, table["supply"]) if "supply" in table else None,
        camera=_made(path, "camera", CameraTable, camera),
        camera_settings=camera_settings,
        vision=_made(path, "vision", TrackerSettings, _table(path, table, "vision")),
        guard=_made(path, "guard", GuardSettings, _table(path, table, "guard")),
        controller=_made(path, "controller", ControllerTable, _table(path, table, "controller")),
        emulator=_made(path, "emulator", EmulationSettings, table["emulator"]) if "emulator" in table else None,
        path=path,
    )
    if bench.supply is not None:
        _check_supply(path, bench.supply)
    _check(path, bench)
    return bench


def _check_supply(path: Path, supply: SupplySettings) -> None:
    try:
        check_numbers(supply, _SUPPLY_BOUNDS, whole=("baud",))
    except ValueError as error:
        raise InputError(f"{path}: supply: {error}") from None
    if supply.gain == 0.0:
        raise InputError(f"{path}: supply: gain: found 0, expected a number other than 0")


_WHAT_IT_IS = {
    "supply": "a section with the resource and the model of the power supply",
    "camera.source": "the number of a camera, its address, or a video file that stands for one",
    "camera.calibration": "a file that `bender calibrate` makes",
}


def _check(path: Path, bench: BenchFile) -> None:
    """A bench is wholly emulated or not at all: a real supply with an emulated camera would be driven blindly."""
    if bench.emulator is None:
        for name, found in (
            ("supply", bench.supply),
            ("camera.source", bench.camera.source),
            ("camera.calibration", bench.camera.calibration),
        ):
            if found is None:
                raise InputError(f"{path}: {name} is missing, {_WHAT_IT_IS[name]}; a bench without [emulator] needs it")
        return
    for name, found in (("supply", bench.supply), ("camera.source", bench.camera.source)):
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


def _table(path: Path, table: dict[str, Any], name: str) -> dict[str, Any]:
    found = table.get(name, {})
    if not isinstance(found, dict):
        raise InputError(_shortened(f"{path}: {name}: found {found!r}, expected a table"))
    return found


def _made(path: Path, name: str, kind: type[_T], table: Any) -> _T:
    """A part's settings from its table: types by pydantic, values by the settings themselves."""
    from pydantic import ConfigDict, Field, ValidationError, create_model

    if not isinstance(table, dict):
        raise InputError(_shortened(f"{path}: {name}: found {table!r}, expected a table"))
    if (found := _unprintable(table)) is not None:
        raise InputError(f"{path}: {name}: found the text {found!a:.60}, expected printable characters")
    hints = get_type_hints(kind)
    columns: dict[str, Any] = {}
    for entry in fields(kind):  # pyright: ignore[reportArgumentType]
        hint = hints[entry.name]
        hint = Annotated[hint, Field(strict=False)] if get_origin(hint) is tuple else hint
        columns[entry.name] = (hint, ... if entry.default is entry.default_factory is MISSING else None)
    model = create_model(kind.__name__, __config__=ConfigDict(extra="forbid", strict=True), **columns)
    try:
        checked = model.model_validate(table)
    except ValidationError as error:
        raise InputError(f"{path}: {_shortened(first_complaint(error, name))}") from None
    given = {key: getattr(checked, key) for key in checked.model_fields_set}
    try:
        return kind(**given)
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
