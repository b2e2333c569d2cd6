"""The FMUs put together: PythonFMU's part, the model description, the pages, the icon and the licences beside it."""

import math
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

import tomli_w

from bender_export.archive import packed
from bender_export.content import Content
from bender_export.description import Description, described
from bender_export.documentation import controller_page, following_page, plant_page, reference_page
from bender_export.origin import device_name
from bender_export.packager import pythonfmu_entries, pythonfmu_licence
from bender_export.slaves import controller, following, plant, reference
from bender_export.slaves.shell import Row
from bender_loop.tables.quantities import USUAL
from bender_plant.blocks import BLOCKS
from bender_plant.model import Model

Parts = tuple[Description, bytes, dict[str, bytes]]
"""What an FMU says of itself: its description, its page, and further entries of the archive."""

_AFTER_THE_TIP = ("surroundings", "sensor")


def plant_archive(model: Model, content: Content) -> bytes:
    """Return the plant FMU; the model goes along as `resources/model.toml`."""
    description, page, more = plant_parts(model, content.guid)
    return _archive(content, description, page, more)


def plant_parts(model: Model, guid: str) -> Parts:
    """Return what the plant FMU of a model says of itself, however it runs."""
    name = device_name(model)
    title = f"Piezo bending actuator, model {model.name!r}" if model.beam is not None else name
    text = f"{title}: {model.description}".rstrip(": ")
    table = plant.table_of(model)
    parameters = [row.name for row in table if row.causality == "parameter"]
    # at rest the tip is at zero; what comes after it shows in the reading even then
    shown = [name for name in parameters if _stage(name) in _AFTER_THE_TIP]
    initial = {"displacement": shown, "tip_displacement": ()}
    description = Description(guid, name, text, table, stop_time_s(table), step_s=0.001, initial_dependencies=initial)
    heading = "Piezo bending actuator" if name == "PiezoBender" else name
    page = plant_page(heading, text, guid, model, table)
    return description, page, {"resources/model.toml": tomli_w.dumps(model.to_table()).encode()}


def stop_time_s(table: Sequence[Row]) -> float:
    """Return five times the longest time of a plant, rounded up to one digit, within a second and a day."""
    longest_s = max((row.start for row in table if row.causality == "parameter" and row.unit == "s"), default=0.0)
    wanted_s = min(max(5.0 * longest_s, 1.0), 86400.0)
    digit = 10.0 ** math.floor(math.log10(wanted_s))
    return math.ceil(wanted_s / digit - 1e-9) * digit


def stage_parts(model: Model, guid: str, table: tuple[Row, ...]) -> Parts:
    """Return what the FMU of stages by themselves says of itself.

    Args:
        model: of the stages alone.
        guid: of the FMU.
        table: its variables, see `slaves.stage.stage_table`.
    """
    text = f"Stages of the chain by themselves, {model.name}: {model.description}".rstrip(": ")
    initial = {"shown": [row.name for row in table if row.causality == "parameter"]}
    page = plant_page("Stages of the chain", text, guid, model, table)
    parts = {"resources/model.toml": tomli_w.dumps(model.to_table()).encode()}
    description = Description(guid, model.name, text, table, 1.0, step_s=0.001, initial_dependencies=initial)
    return description, page, parts


def controller_archive(
    content: Content, start: Mapping[str, float], step_s: float, units: tuple[str, str] = USUAL[:2]
) -> bytes:
    """Return the controller FMU.

    Args:
        content: made of `start` and `units`.
        start: start values of its parameters in place of its own, by name.
        step_s: communication step that it proposes.
        units: of command and reading.
    """
    description, page, more = controller_parts(content.guid, controller.table_of(start, units), step_s)
    return _archive(content, description, page, more)


def controller_parts(guid: str, table: tuple[Row, ...], step_s: float) -> Parts:
    """Return what the controller FMU says of itself, however it runs."""
    text = "PID controller, one sample for each communication step"
    initial = {"command": ("limits.lower", "limits.upper")}
    page = controller_page("PID controller", text, guid, table)
    return Description(guid, "PidController", text, table, 1.0, step_s, initial), page, {}


def following_archive(settings: Mapping[str, Any], model: Model, content: Content) -> bytes:
    """Return the FMU of a model-following controller; its model goes along as `resources/model.toml`.

    Args:
        settings: as `slaves.following` takes them.
        model: the one in them.
        content: made of them.
    """
    description, page, more = following_parts(settings, model, content.guid)
    return _archive(content, description, page, more)


def following_parts(settings: Mapping[str, Any], model: Model, guid: str) -> Parts:
    """Return what the FMU of a model-following controller says of itself, however it runs."""
    text = f"Controller that follows the model {model.name!r}, one sample for each communication step"
    table = following.table_of(settings)
    initial = {"command": ("limits.lower", "limits.upper")}
    page = following_page("Model-following controller", text, guid, model, table)
    step_s = settings["start"]["sampling.period"]
    description = Description(guid, f"Controller of {device_name(model)}", text, table, 1.0, step_s, initial)
    return description, page, {"resources/model.toml": tomli_w.dumps(model.to_table()).encode()}


def reference_archive(content: Content) -> bytes:
    """Return the FMU of the setpoint, for systems whose tool brings no source of signals."""
    description, page, more = reference_parts(content.guid)
    return _archive(content, description, page, more)


def reference_parts(guid: str) -> Parts:
    """Return what the reference FMU says of itself, however it runs."""
    text = "Setpoint of a control loop: a step or a staircase"
    initial = {"setpoint": [row.name for row in reference.TABLE if row.causality == "parameter"]}
    page = reference_page("Setpoint", text, guid, reference.TABLE)
    return Description(guid, "StaircaseReference", text, reference.TABLE, 1.0, 0.01, initial), page, {}


def _archive(content: Content, description: Description, page: bytes, more: dict[str, bytes]) -> bytes:
    entries = pythonfmu_entries(content)
    entries["modelDescription.xml"] = described(entries["modelDescription.xml"], description)
    entries["documentation/licenses/pythonfmu.txt"] = pythonfmu_licence()
    return packed(entries | pages_of(page) | more)


def pages_of(page: bytes) -> dict[str, bytes]:
    """Return the entries that every FMU of this project has: icon, page and licence."""
    pages = files("bender_export") / "pages"
    return {
        "model.png": (pages / "icon.png").read_bytes(),
        "documentation/index.html": page,
        "documentation/licenses/license.txt": (pages / "licence.txt").read_bytes(),
    }


def _stage(parameter: str) -> str:
    """Return the stage of the block that a parameter belongs to, nothing for one of the beam."""
    block = BLOCKS.get(parameter.partition(".")[0])
    return "" if block is None else block.stage
