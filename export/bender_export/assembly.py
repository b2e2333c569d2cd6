"""The FMUs put together: PythonFMU's part, the model description, the pages, the icon and the licences beside it."""

from importlib.resources import files

import tomli_w

from bender_export.archive import packed
from bender_export.content import Content
from bender_export.description import Description, described
from bender_export.documentation import controller_page, plant_page, reference_page
from bender_export.packager import pythonfmu_entries, pythonfmu_licence
from bender_export.slaves import controller, plant, reference
from bender_plant.blocks import BLOCKS
from bender_plant.model import Model

_AFTER_THE_TIP = ("surroundings", "sensor")


def plant_archive(model: Model, content: Content) -> bytes:
    """Return the plant FMU; the model goes along as `resources/model.toml`."""
    text = f"Piezo bending actuator, model {model.name!r}: {model.description}".rstrip(": ")
    table = plant.table_of(model)
    parameters = [row.name for row in table if row.causality == "parameter"]
    # at rest the tip is at zero; what comes after it shows in the reading even then
    shown = [name for name in parameters if _stage(name) in _AFTER_THE_TIP]
    initial = {"displacement": shown, "tip_displacement": ()}
    description = Description(content.guid, text, table, stop_time_s=1.0, step_s=0.001, initial_dependencies=initial)
    page = plant_page("Piezo bending actuator", text, content.guid, model, table)
    return _archive(content, description, page, {"resources/model.toml": tomli_w.dumps(model.to_table()).encode()})


def controller_archive(content: Content) -> bytes:
    """Return the controller FMU."""
    text = "PID controller of the piezo bending actuator, one sample for each communication step"
    initial = {"command": ("limits.lower", "limits.upper")}
    page = controller_page("PID controller", text, content.guid, controller.TABLE)
    return _archive(content, Description(content.guid, text, controller.TABLE, 1.0, 0.01, initial), page, {})


def reference_archive(content: Content) -> bytes:
    """Return the FMU of the setpoint, for systems whose tool brings no source of signals."""
    text = "Setpoint of the piezo bending actuator: a step or a staircase"
    initial = {"setpoint": [row.name for row in reference.TABLE if row.causality == "parameter"]}
    page = reference_page("Setpoint", text, content.guid, reference.TABLE)
    return _archive(content, Description(content.guid, text, reference.TABLE, 1.0, 0.01, initial), page, {})


def _archive(content: Content, description: Description, page: bytes, more: dict[str, bytes]) -> bytes:
    pages = files("bender_export") / "pages"
    entries = pythonfmu_entries(content)
    entries["modelDescription.xml"] = described(entries["modelDescription.xml"], description)
    entries["model.png"] = (pages / "icon.png").read_bytes()
    entries["documentation/index.html"] = page
    entries["documentation/licenses/license.txt"] = (pages / "licence.txt").read_bytes()
    entries["documentation/licenses/pythonfmu.txt"] = pythonfmu_licence()
    return packed(entries | more)


def _stage(parameter: str) -> str:
    """Return the stage of the block that a parameter belongs to, nothing for one of the beam."""
    block = BLOCKS.get(parameter.partition(".")[0])
    return "" if block is None else block.stage
