"""The plants of a fleet: each corrected model as an FMU, opened and linearised once."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from bender_fleet.results.folder import read_fleet
from bender_fleet.results.parts import UNITS
from bender_fleet.results.tables import UNIT_TABLE
from bender_fleet.sources.keys import folder_name
from bender_loop.control.metrics import SETTLING_BAND
from bender_loop.control.plant import Plant
from bender_loop.errors import InputError, RunError
from bender_loop.fmu.plant import FmuPlant
from bender_tuner.model.linear_model import Linearisation, OperatingPoint, linearise_at, settle
from bender_tuner.model.reduced_model import ReducedModel, reduce_model
from bender_tuner.task.settings import TuneSettings

_APART = 1e-3
"""Of the span of the limits: ten times as far as the operating point is known."""


@dataclass(frozen=True, slots=True, eq=False)
class UnitPlant:
    """One unit's corrected model, open.

    Attributes:
        name: of the unit.
        plant: its FMU.
        linearisation: at the setpoint.
        reduced: gain, lag and delay of its loop.
    """

    name: str
    plant: FmuPlant
    linearisation: Linearisation
    reduced: ReducedModel


@dataclass(frozen=True, slots=True)
class Opened:
    """The plants of a fleet, and the units that no controller can serve, with the reason."""

    plants: tuple[UnitPlant, ...]
    unserved: dict[str, str]


def corrected_models(fleet: Path) -> dict[str, Path]:
    """Return the corrected model of every unit that has one.

    Raises:
        InputError: the directory is not of a fleet that was diagnosed, or no unit has a corrected model.
    """
    import pyarrow.parquet as pq

    told = read_fleet(fleet)
    if told is None or told["action"] != "diagnose" or not (fleet / UNIT_TABLE).is_file():
        raise InputError(f"{fleet}: expected the output directory of bender fleet diagnose")
    rows = pq.read_table(fleet / UNIT_TABLE, columns=["unit", "has_model"]).to_pylist()
    named = [x["unit"] for x in rows if x["has_model"]]
    found = {x: fleet / UNITS / folder_name(x) / "model.toml" for x in named}
    found = {name: path for name, path in found.items() if path.is_file()}
    if not found:
        raise InputError(f"{fleet}: found no unit with a corrected model, expected at least one")
    return found


@contextmanager
def opened(models: dict[str, Path], settings: TuneSettings, tell: Callable[[int, int, str], None]) -> Iterator[Opened]:
    """Give the plants of a fleet, open until the end of the block.

    A unit whose plant cannot reach the setpoint, or does not answer, is not served; it is no fault of the fleet.

    Raises:
        InputError: there is no place where the FMUs can be built.
        RunError: there is neither a compiler nor a PythonFMU for this platform.
    """
    from bender_native.ready import ready_plant_fmu
    from bender_plant.model import load_model

    plants: list[UnitPlant] = []
    unserved: dict[str, str] = {}
    with ExitStack() as stack:
        for number, (name, path) in enumerate(models.items()):
            tell(number, len(models), name)
            fmu = ready_plant_fmu(load_model(str(path)))
            plant = FmuPlant(fmu)
            stack.callback(plant.close)
            try:
                linear = linearise_at(plant, settings.setpoint_um, settings.sampling, settings.limits)
                if reason := why_unservable(plant, linear.point, settings):
                    unserved[name] = reason
                    continue
                reduced = reduce_model(linear.model, settings.latency_frames)
            except (InputError, RunError) as error:
                unserved[name] = str(error)
                continue
            plants.append(UnitPlant(name, plant, linear, reduced))
        yield Opened(tuple(plants), unserved)


def why_unservable(plant: Plant, point: OperatingPoint, settings: TuneSettings) -> str:
    """Return why no integral action holds a plant that rests on levels further apart than the band is wide, or "".

    Between two such levels a loop hunts for ever, and a small step at their edge shows any gain between none and many
    times that of the plant.
    """
    least_V = _APART * (settings.upper_V - settings.lower_V)
    low, high = sorted(
        settle(plant, point.voltage_V + sign * least_V, settings.sampling).displacement_um for sign in (-1.0, 1.0)
    )
    if high - low <= 2.0 * SETTLING_BAND * abs(settings.setpoint_um):
        return ""
    return f"near {settings.setpoint_um:g} µm it rests at {low:.4g} or at {high:.4g} µm, nowhere between"


def median_unit(plants: Sequence[UnitPlant]) -> UnitPlant:
    """Return the unit in the middle by gain: the nominal one of the population."""
    ordered = sorted(plants, key=lambda x: (x.reduced.gain_um_per_V, x.name))
    return ordered[len(ordered) // 2]
