"""Anybody's FMU between stages of ours, as one FMU that other tools take, and as a system (SSP) beside it.

The original stands in it byte for byte, with its licence. The container library steps its parts one after the other,
so that an inner step passes through all of them; it is the work of others and carried under their licence.
"""

import logging
import os
import tempfile
import zipfile
from collections.abc import Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from bender_export.archive import packed, unpacked
from bender_export.assembly import stop_time_s
from bender_export.description import unit_element
from bender_export.origin import generation_date
from bender_export.slaves.shell import Row
from bender_export.slaves.stage import StagesBefore, StagesBehind, beside_table, stage_table
from bender_export.system import one_component
from bender_loop.errors import RunError
from bender_loop.fmu.file import read_text
from bender_loop.fmu.ports import Port
from bender_loop.shell.bounded import in_one_line
from bender_loop.shell.extras import install_command
from bender_native.build import Way, native_beside_fmu, native_stage_fmu
from bender_plant.model import Model

if TYPE_CHECKING:
    from collections.abc import Iterator

    from fmu_manipulation_toolbox.container import FMUContainer

BEFORE, PLANT, BEHIND = "before.fmu", "plant.fmu", "behind.fmu"
WITH, WITHOUT = "inside.fmu", "without.fmu"
_TOOLBOX = "fmu-manipulation-toolbox"
_SIGNALS = ("taken", "shown")
_PASSED = "passed"


@dataclass(frozen=True, slots=True)
class Behind:
    """Stages of ours on a further output of an FMU.

    Attributes:
        output: the variable.
        stages: um to um.
        rest: of the output before anything moves, in its own unit; the stages act on what differs.
    """

    output: Port
    stages: Model
    rest: float


@dataclass(frozen=True, slots=True)
class Corrected:
    """An FMU with stages of ours around it.

    Attributes:
        original: the file.
        input: the variable that takes the command.
        output: the variable that is read.
        before: the stages on the input, V to V; None for none.
        behind: the stages on the output, um to um; None for none.
        output_rest: of the output before anything moves, in its own unit; the stages behind act on what differs.
        step_s: the inner step; a host steps by whole ones of it.
        start_values: of parameters of the original, by name; set for good.
        open: parameters of the original that a host may set, as `plant.…`.
        further: what stands behind further outputs; their parameters are `behind_2.…` and so on.
        inside: a model of the original with what acts inside it, V to um, and one without; None for none. What the
            first shows more than the second is added to the output of the original.
        units: by variable, those in which inputs and outputs are taken for which the original declares none.
    """

    original: Path
    input: Port
    output: Port
    before: Model | None
    behind: Model | None
    output_rest: float
    step_s: float
    start_values: Mapping[str, float] = field(default_factory=dict)
    open: tuple[str, ...] = ()
    further: tuple[Behind, ...] = ()
    inside: tuple[Model, Model] | None = None
    units: Mapping[str, str] = field(default_factory=dict)


def is_at_hand() -> bool:
    """Return whether the library that makes containers is installed."""
    try:
        import fmu_manipulation_toolbox.container as found
    except ImportError:
        return False
    return bool(found)


def container_fmu(corrected: Corrected, made: Way, name: str = "Corrected") -> bytes:
    """Return the FMU that holds the original and stages around it; same parts, same bytes, but for the date.

    Its input and output have the names and units of the original's, and so have further inputs and outputs. Parameters
    are those of the stages, `before.…`, `behind.…` and, for what acts inside the original, `inside.…` and `without.…`;
    start values of the original are set in it for good.

    Args:
        corrected: the original and what stands around it.
        made: how the stages are made.
        name: the model identifier.

    Raises:
        RunError: no compiler, no container library, or the original is not one that it can hold.
    """
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / PLANT).write_bytes(corrected.original.read_bytes())
        for stages, file, kind, port, rest in _stages(corrected):
            (place / file).write_bytes(native_stage_fmu(kind, stages, made, port.internal, rest, own=True))
        for file, (model, sign) in _beside(corrected).items():
            scales = corrected.input.internal, corrected.output.internal
            content = native_beside_fmu(model, made, sign, scales, corrected.output_rest, own=True)
            (place / file).write_bytes(content)
        with zipfile.ZipFile(corrected.original) as archive:
            original = ElementTree.fromstring(read_text(archive))
        with _messages(corrected.original):
            _linked(corrected, place, name, _stop_s(original, corrected)).make_fmu(
                f"{name}.fmu", step_size=corrected.step_s, sequential=True
            )
        entries = unpacked(place / f"{name}.fmu")
    entries["modelDescription.xml"] = _described(entries, original, corrected)
    entries["documentation/licenses/container.txt"] = _licence()
    return packed(entries)


def corrected_system(container: bytes, corrected: Corrected, parameters: Mapping[str, float]) -> bytes:
    """Return an SSP archive with the container in it, and its parameters as `resources/corrected.ssv`.

    Args:
        container: the FMU.
        corrected: what is in it.
        parameters: of the container, by name.
    """
    variables = _variables(container)
    ports = [(x.attrib["name"], x.attrib["causality"]) for x in variables if x.get("causality") in ("input", "output")]
    return one_component("Corrected", container, ports, parameters, corrected.step_s)


def parameters_of(container: bytes) -> dict[str, float]:
    """Return the parameters of a container and their start values."""
    found: dict[str, float] = {}
    for variable in _variables(container):
        value = variable.find("Real")
        if variable.get("causality") == "parameter" and value is not None:
            found[variable.attrib["name"]] = float(value.get("start", "0"))
    return found


def _variables(container: bytes) -> list[ElementTree.Element]:
    """Return the variables that the model description of an FMU lists."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "container.fmu"
        path.write_bytes(container)
        with zipfile.ZipFile(path) as archive:
            root = ElementTree.fromstring(read_text(archive))
    return list(root.iter("ScalarVariable"))


def parameter_values(corrected: Corrected) -> dict[str, float]:
    """Return what `parameters_of` finds in the container, without making it."""
    return {
        f"{Path(file).stem}.{x.name}": float(x.start)
        for file, table in _tables(corrected)
        for x in table
        if x.causality == "parameter"
    }


def _tables(corrected: Corrected) -> list[tuple[str, tuple[Row, ...]]]:
    """Return the variables of every stage, beside its file."""
    tables = [(file, stage_table(kind, x, port.internal, rest)) for x, file, kind, port, rest in _stages(corrected)]
    scales = corrected.input.internal, corrected.output.internal
    beside = _beside(corrected).items()
    return tables + [(file, beside_table(x, sign, scales, corrected.output_rest)) for file, (x, sign) in beside]


def _stages(corrected: Corrected) -> list[tuple[Model, str, Any, Port, float]]:
    """Return the stages, the file of each, its kind, the variable that it acts on, and where that rests."""
    found: list[tuple[Model, str, Any, Port, float]] = []
    if corrected.before is not None:
        found.append((corrected.before, BEFORE, StagesBefore, corrected.input, 0.0))
    if corrected.behind is not None:
        found.append((corrected.behind, BEHIND, StagesBehind, corrected.output, corrected.output_rest))
    further = enumerate(corrected.further, 2)
    return found + [(x.stages, f"behind_{k}.fmu", StagesBehind, x.output, x.rest) for k, x in further]


def _beside(corrected: Corrected) -> dict[str, tuple[Model, float]]:
    """Return the models that stand beside the original, by their files, and whether they are added or taken off."""
    if corrected.inside is None:
        return {}
    return {WITH: (corrected.inside[0], 1.0), WITHOUT: (corrected.inside[1], -1.0)}


def _stop_s(original: Element, corrected: Corrected) -> float:
    """Return how long the default experiment lasts: as that of the original, or as the slowest stage asks for."""
    experiment = original.find("DefaultExperiment")
    try:
        own_s = float((experiment.get("stopTime") if experiment is not None else None) or 0.0)
    except ValueError:
        own_s = 0.0
    return max(own_s, *(stop_time_s(table) for _, table in _tables(corrected)), 1.0)


def _linked(corrected: Corrected, place: Path, name: str, stop_s: float) -> "FMUContainer":
    from fmu_manipulation_toolbox.container import FMUContainer

    made: Any = FMUContainer(name, place)
    made.start_time, made.stop_time = 0.0, stop_s
    behind = {port.name: file for _, file, kind, port, _ in _stages(corrected) if kind is StagesBehind}
    beside = list(_beside(corrected))
    order = [*([BEFORE] if corrected.before else []), PLANT, *beside, *behind.values()]
    ports = {file: dict(made.get_fmu(file).ports) for file in order}
    command, reading = corrected.input.name, corrected.output.name
    made.add_input(command, order[0], _SIGNALS[0] if corrected.before else command)
    commanded = [(PLANT, command), *((file, _SIGNALS[0]) for file in beside)]
    for file, port in commanded:
        if corrected.before:
            made.add_link(BEFORE, _SIGNALS[1], file, port)
        elif file != order[0]:
            made.add_input(command, file, port)
    shown = (PLANT, reading)
    for file in beside:
        made.add_link(*shown, file, _PASSED)
        shown = (file, _SIGNALS[1])
    for name, file in behind.items():
        made.add_link(*(shown if name == reading else (PLANT, name)), file, _SIGNALS[0])
        made.add_output(file, _SIGNALS[1], name)
    if reading not in behind:
        made.add_output(*shown, reading)
    for port, value in corrected.start_values.items():
        # a start value of the library's comes after what a host sets, so it is not a parameter beside
        made.add_start_value(PLANT, port, _spelled(value))
    for port in corrected.open:
        made.add_input(f"plant.{port}", PLANT, port)
    _passed_on(made, ports, (command, reading, *behind))
    return made


def _passed_on(made: Any, ports: Mapping[str, Mapping[str, Any]], taken: tuple[str, ...]) -> None:
    """Pass on the further inputs and outputs of the original, and the parameters of the stages."""
    for file, own in ports.items():
        for port, about in own.items():
            if file != PLANT and about.causality == "parameter":
                made.add_input(f"{Path(file).stem}.{port}", file, port)
            if file == PLANT and port not in taken and about.causality == "input":
                made.add_input(port, PLANT, port)
            if file == PLANT and port not in taken and about.causality == "output":
                made.add_output(PLANT, port, port)


def _spelled(value: float) -> str:
    return str(int(value)) if value == int(value) and abs(value) < 2**31 else repr(value)


@contextmanager
def _messages(original: Path) -> "Iterator[None]":
    """Keep what the library logs to itself, and name the original where it refuses it."""
    try:
        from fmu_manipulation_toolbox.container import FMUContainerError
    except ImportError:
        raise RunError(
            f"a corrected FMU of {original} is a container: found no {_TOOLBOX}, expected it "
            f"({install_command('container')})"
        ) from None
    log = logging.getLogger("fmu_manipulation_toolbox")
    before = log.disabled
    log.disabled = True
    try:
        yield
    except (FMUContainerError, OSError, KeyError, ValueError) as problem:
        raise RunError(f"{original}: no container can be made of it ({' '.join(str(problem).split())})") from None
    finally:
        log.disabled = before


def _described(entries: Mapping[str, bytes], original: Element, corrected: Corrected) -> bytes:
    """Return the description of the container with its own words, a GUID of its content, and the original's units."""
    import hashlib
    from uuid import UUID

    root = ElementTree.fromstring(entries["modelDescription.xml"])
    hasher = hashlib.sha256()
    for name in sorted(set(entries) - {"modelDescription.xml"}):
        hasher.update(name.encode() + b"\0" + hashlib.sha256(entries[name]).digest())
    about = original.get("modelName") or in_one_line(Path(corrected.original.stem))
    root.attrib |= {
        "guid": f"{{{UUID(hex=hasher.hexdigest()[:32])}}}",
        "modelName": f"{about}, corrected",
        "description": f"{about}, corrected: the original with what acts before it, beside it and behind it",
        "author": "made by piezo-bender",
        "license": "those of its parts: resources/*/, documentation/licenses",
        "copyright": "those of its parts",
        "generationDateAndTime": generation_date(),
    }
    _with_units(root, original, corrected.units)
    _with_descriptions(root, original)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"


def _with_units(root: Element, original: Element, taken: Mapping[str, str]) -> None:
    """Give inputs and outputs the units that they have in the original, or else are taken in."""
    known = {x.get("name"): x for x in original.iterfind("UnitDefinitions/Unit")}
    units = dict(taken)
    for variable in original.find("ModelVariables") or ():
        number = variable.find("Real") if variable.tag == "ScalarVariable" else variable
        unit = None if number is None else number.get("unit")
        if unit and variable.get("causality") in ("input", "output"):
            units[variable.attrib["name"]] = unit
    if not units:
        return
    listed = Element("UnitDefinitions")
    for unit in sorted(set(units.values())):
        entry = SubElement(listed, "Unit", name=unit)
        declared = known[unit] if unit in known else unit_element(unit)
        base = declared.find("BaseUnit")
        if base is not None:
            SubElement(entry, "BaseUnit", base.attrib)
    root.insert(1, listed)
    for variable in root.iter("ScalarVariable"):
        number = variable.find("Real")
        unit = units.get(variable.attrib["name"])
        if number is not None and unit and variable.get("causality") in ("input", "output"):
            number.set("unit", unit)


def _with_descriptions(root: Element, original: Element) -> None:
    """Give inputs and outputs the words that they have in the original: what 1 V stands for may be among them."""
    ports = [x for x in original.find("ModelVariables") or () if x.get("causality") in ("input", "output")]
    words = {x.attrib["name"]: x.attrib["description"] for x in ports if x.get("description")}
    for variable in root.iter("ScalarVariable"):
        if variable.get("causality") in ("input", "output") and variable.attrib["name"] in words:
            variable.set("description", words[variable.attrib["name"]])


def _licence() -> bytes:
    """Return the licence of the container library."""
    try:
        found = [x for x in files(_TOOLBOX) or () if "license" in x.name.lower() and "dist-info" in os.fspath(x)]
        return b"\n".join(x.read_binary() for x in found)
    except (PackageNotFoundError, OSError):
        return b"Container library of the FMU Manipulation Toolbox, BSD 2-Clause, Copyright Renault SAS\n"
