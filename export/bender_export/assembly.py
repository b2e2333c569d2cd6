"""The two FMUs put together: PythonFMU's part, the model description, the pages and licences beside it."""

import tomli_w

from bender_export.archive import packed
from bender_export.content import Content
from bender_export.description import Description, described
from bender_export.packager import pythonfmu_entries, pythonfmu_licence
from bender_export.slaves.controller import TABLE
from bender_export.slaves.plant import table_of
from bender_plant.model import Model


def plant_archive(model: Model, content: Content) -> bytes:
    """Return the plant FMU; the model goes along as `resources/model.toml`."""
    text = f"Piezo bending actuator, model {model.name!r}: {model.description}".rstrip(": ")
    description = Description(content.guid, text, table_of(model), stop_time_s=1.0, step_s=0.001)
    return _archive(content, description, {"resources/model.toml": tomli_w.dumps(model.to_table()).encode()})


def controller_archive(content: Content) -> bytes:
    """Return the controller FMU."""
    text = "PID controller of the piezo bending actuator, one sample for each communication step"
    return _archive(content, Description(content.guid, text, TABLE, stop_time_s=1.0, step_s=0.01), {})


def _archive(content: Content, description: Description, more: dict[str, bytes]) -> bytes:
    entries = pythonfmu_entries(content)
    entries["modelDescription.xml"] = described(entries["modelDescription.xml"], description)
    entries["documentation/licenses/pythonfmu.txt"] = pythonfmu_licence()
    return packed(entries | more)
