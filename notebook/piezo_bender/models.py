"""Models of the plant, and the FMUs built from them."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias, runtime_checkable

from bender_loop.errors import InputError
from bender_plant import model as plant_models
from bender_plant.model import Model
from bender_plant.parameter import ModelError
from piezo_bender.shared import axes_or_new, frame_of, html_table, one_of

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike, NDArray
    from pandas import DataFrame

SHOWN_V, SHOWN_S, SHOWN_ROWS = 50.0, 40.0, 1201
"""A model is pictured under one slow triangle over the actuator's range."""


@dataclass(frozen=True, slots=True, repr=False)
class PlantModel:
    """A plant as data: the blocks of its chain with their numbers."""

    model: Model

    @property
    def name(self) -> str:
        """The model's name."""
        return self.model.name

    def with_block(self, block_id: str, **parameters: Any) -> "PlantModel":
        """Return the model with a block added or replaced.

        Raises:
            InputError: the block or a parameter is unknown, or a value out of its bounds.
        """
        return _plant(lambda: self.model.with_block(block_id, **parameters))

    def with_values(self, values: dict[str, float]) -> "PlantModel":
        """Return the model with numbers changed, by their FMI names.

        Raises:
            InputError: a name is unknown or a value out of its bounds.
        """
        return _plant(lambda: self.model.with_values(values))

    def simulate(
        self, time_s: "ArrayLike", voltage_V: "ArrayLike", *, input_hold: str = "hold"
    ) -> "NDArray[np.float64]":
        """Return the readings (n,) in µm of a plant at rest that is driven with a voltage.

        Args:
            time_s: (n,) instants of the readings, increasing.
            voltage_V: (n,) commands; row k is read before command k acts.
            input_hold: "hold" or "linear": the voltage between two rows.

        Raises:
            InputError: the columns are no rows of a record, or the model runs away under this voltage.
        """
        import numpy as np

        from bender_compiled.simulation import Drive, Simulator
        from bender_loop.records.record import record_from_columns

        one_of("input_hold", input_hold, ("hold", "linear"))
        still = np.zeros(np.shape(time_s))
        columns = {"time_s": time_s, "voltage_V": voltage_V, "displacement_um": still}
        record = record_from_columns(columns, "simulate")
        drive = Drive.of_rows(record.time_s - record.time_s[0], record.voltage_V, linear=input_hold == "linear")
        try:
            return Simulator(drive).run(self.model).reading_um
        except (ModelError, ArithmeticError) as error:
            raise InputError(f"the model {self.name} cannot be simulated under this voltage: {error}") from None

    def save(self, folder: Path | str) -> Path:
        """Write model.toml into a directory; return the directory.

        Raises:
            InputError: it cannot be written.
        """
        import tomli_w

        from bender_loop.shell.files import prepare_directory, write_atomically

        out = prepare_directory(Path(folder))
        write_atomically(out / "model.toml", tomli_w.dumps(self.model.to_table()))
        return out

    def plot(self, axes: "Axes | None" = None) -> "Axes":
        """Draw the reading over the voltage of one slow triangle; return the axes drawn into."""
        import numpy as np

        from bender_loop.records.acting_voltage import acting_V
        from bender_report.palette import light

        time_s = np.linspace(0.0, SHOWN_S, SHOWN_ROWS)
        volts = SHOWN_V * (1.0 - np.abs(2.0 * time_s / SHOWN_S - 1.0))
        reading_um = self.simulate(time_s, volts)
        drawn = axes_or_new(axes, 6.0, 4.0)
        drawn.plot(acting_V(time_s, time_s, volts), reading_um, color=light("with"))
        drawn.set(xlabel="voltage (V)", ylabel="displacement (µm)", title=f"{self.name}, {SHOWN_S:g} s")
        return drawn

    def to_dict(self) -> dict[str, Any]:
        """Return the table that a model file holds."""
        return self.model.to_table()

    def to_frame(self) -> "DataFrame":
        """Return every number of the model by its FMI name (needs pandas)."""
        values = self.model.values()
        return frame_of({"parameter": list(values), "value": list(values.values())})

    def __repr__(self) -> str:
        return f"<PlantModel {self.name}: {', '.join(x.id for x in self.model.blocks)}>"

    def _repr_html_(self) -> str:
        return html_table(f"model {self.name}", ("parameter", "value"), self.model.values().items())


@dataclass(frozen=True, slots=True, repr=False)
class PlantFmu:
    """The FMU of a model: its content, and the model it was built from."""

    plant: PlantModel
    content: bytes

    def save(self, folder: Path | str) -> Path:
        """Write PiezoBender.fmu and PidController.fmu into a directory; return the directory.

        Raises:
            InputError: they cannot be written.
        """
        from bender_export.build import CONTROLLER_FMU, PLANT_FMU, controller_fmu
        from bender_loop.shell.files import prepare_directory, write_atomically

        controller = controller_fmu()
        out = prepare_directory(Path(folder))
        write_atomically(out / PLANT_FMU, self.content)
        write_atomically(out / CONTROLLER_FMU, controller)
        return out

    def plot(self, axes: "Axes | None" = None) -> "Axes":
        """Draw the plant's reading over the voltage of one slow triangle; return the axes drawn into."""
        return self.plant.plot(axes)

    def to_dict(self) -> dict[str, Any]:
        """Return the interface: inputs, outputs and parameters with their starting values."""
        return {
            "model": self.plant.name,
            "inputs": ["voltage"],
            "outputs": ["displacement", "tip_displacement"],
            "parameters": self.plant.model.values(),
        }

    def to_frame(self) -> "DataFrame":
        """Return the parameters with their starting values (needs pandas)."""
        return self.plant.to_frame()

    def __repr__(self) -> str:
        return f"<PlantFmu {self.plant.name}: FMI 2.0 co-simulation, {len(self.content) / 1000:.0f} kB>"

    def _repr_html_(self) -> str:
        return f"<p>{self.__repr__().strip('<>')}</p>{self.plant._repr_html_()}"


@runtime_checkable
class HasModel(Protocol):
    """A result that found a model: of `diagnose` and `fit_model`."""

    @property
    def model(self) -> PlantModel:
        """The model."""
        ...


@runtime_checkable
class HasPlant(Protocol):
    """A result that has a model: of `identify` and `build_fmu`."""

    @property
    def plant(self) -> PlantModel:
        """The model."""
        ...


AnyModel: TypeAlias = str | Path | Model | PlantModel | HasModel | HasPlant
"""A built-in name, a model file, a model, or a result that has one."""


def file_or_model(given: AnyModel, argument: str = "model") -> str | Path | Model:
    """Return a name, a file, or the model that an object is or has found.

    Raises:
        InputError: it has none, or one that stands in for an FMU.
    """
    if isinstance(given, str | Path | Model):
        return given
    if isinstance(given, PlantModel):
        return given.model
    if getattr(given, "stand_in", None) is not None:
        raise InputError(
            f"{argument}: found a {type(given).__name__} of an FMU, expected a model: save it and pass "
            "fmu='FOLDER/model.fmu'"
        )
    for name in ("model", "plant"):
        found = getattr(given, name, None)
        if isinstance(found, PlantModel | Model):
            return found.model if isinstance(found, PlantModel) else found
    raise InputError(
        f"{argument}: found a {type(given).__name__}, expected the name of a built-in model, a model file, a model "
        "from load_model, or a result that has one"
    )


def load_model(model: AnyModel = "paper") -> PlantModel:
    """Return a built-in model (paper, beam, bench), that of a model file, or that of a result.

    Raises:
        InputError: there is none, or what the file says cannot be.
    """
    given = file_or_model(model)
    return PlantModel(given) if isinstance(given, Model) else _plant(lambda: plant_models.load_model(given))


def build_fmu(model: AnyModel = "paper") -> PlantFmu:
    """Return the FMU of a model; `save` writes it and the controller's FMU.

    Raises:
        InputError: there is no such model.
    """
    from bender_export.build import plant_fmu

    plant = load_model(model)
    return PlantFmu(plant, plant_fmu(plant.model))


def _plant(make: Any) -> PlantModel:
    try:
        return PlantModel(make())
    except ModelError as error:
        raise InputError(str(error)) from None
