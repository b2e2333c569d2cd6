"""A model is data: a beam, and the blocks of the chain with their values, in a TOML file.

    format = 1
    name = "paper"
    [beam]           length, width, neutral axis, and [[beam.layer]] from the bottom up
    [[block]]        id = "…" and the parameters of that block
    [valid]          lowest_V, highest_V, longest_s: what the records covered that the model was learned from
    [origin]         these records, the numbers with their intervals, units of the records, the report

Unknown keys are errors, missing parameters take their defaults.
"""

import difflib
import os
import stat
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

from bender_plant.blocks import BLOCKS
from bender_plant.composite_beam import CompositeBeam, Layer
from bender_plant.origin import Origin
from bender_plant.parameter import ModelError as ModelError
from bender_plant.parameter import meanings, spoken_name
from bender_plant.valid_range import ValidRange

FORMAT = 1
BUILT_IN = ("paper", "beam", "bench")
_MOST_BYTES = 1 << 22
"""4 MiB; a model has some kilobytes."""
_SHOWN = 100
"""Characters of a value in a message."""
_TOP_KEYS = ("format", "name", "description", "beam", "block", "valid", "origin")


@dataclass(frozen=True, slots=True)
class BlockSettings:
    """One block of a model: its id and its parameters (an instance of that block's `Parameters`)."""

    id: str
    parameters: Any


@dataclass(frozen=True, slots=True)
class Model:
    """A plant as data. The blocks stand in the order of the physics, whatever order they were given in.

    `name` is that of the device; what cannot be printed in it is replaced by question marks. `valid` is where the model
    was learned and `origin` from what; None where nothing is known of that.

    Raises:
        ModelError: a block is unknown or stands twice, or there is not exactly one transducer.
    """

    name: str
    beam: CompositeBeam | None
    blocks: tuple[BlockSettings, ...]
    description: str = ""
    valid: ValidRange | None = None
    origin: Origin | None = None

    def __post_init__(self) -> None:
        ids = [settings.id for settings in self.blocks]
        for block_id in ids:
            if block_id not in BLOCKS:
                raise ModelError(f"block: found id {block_id!r}, {_like(block_id)}")
            if ids.count(block_id) > 1:
                raise ModelError(f"block: found {block_id!r} twice, expected each block once")
        transducers = [block_id for block_id in ids if BLOCKS[block_id].transducer]
        if len(transducers) != 1:
            known = ", ".join(block.id for block in BLOCKS.values() if block.transducer)
            raise ModelError(f"block: found {transducers or 'none'}, expected exactly one of {known}")
        if "bending_modes" not in ids and any(BLOCKS[block_id].modify for block_id in ids):
            raise ModelError("block: found a block that changes the bending modes, expected bending_modes beside it")
        order = list(BLOCKS)
        # a name may come from a file's, which need not be text; it goes into XML, JSON and TOML
        object.__setattr__(self, "name", "".join(sign if sign.isprintable() else "?" for sign in self.name))
        object.__setattr__(self, "blocks", tuple(sorted(self.blocks, key=lambda s: order.index(s.id))))
        for settings in self.blocks:
            BLOCKS[settings.id].constants(settings.parameters, self.beam)

    @property
    def units(self) -> tuple[str, str] | None:
        """Units of commands and readings that 1 V and 1 um stand for; None where the model says nothing of them."""
        return None if self.origin is None else (self.origin.command_unit, self.origin.reading_unit)

    def to_table(self) -> dict[str, Any]:
        """Return the model as the table that its TOML file holds."""
        table: dict[str, Any] = {"format": FORMAT, "name": self.name, "description": self.description}
        if self.beam is not None:
            beam = {f.name: getattr(self.beam, f.name) for f in fields(self.beam) if f.name != "layers"}
            beam["layer"] = [{f.name: getattr(x, f.name) for f in fields(x)} for x in self.beam.layers]
            table["beam"] = beam
        table["block"] = [{"id": s.id} | _plain(s.parameters) for s in self.blocks]
        if self.valid is not None:
            table["valid"] = _plain(self.valid)
        if self.origin is not None:
            table["origin"] = _plain(self.origin)
        return table

    def values(self) -> dict[str, float]:
        """Return every number of the model by its FMI name (`beam.length`, `bending_modes.damping_ratio`)."""
        return {name: float(value) for name, _, value in _numbers(self)}

    def with_values(self, values: Mapping[str, float]) -> "Model":
        """Return the model with numbers changed, by their FMI names and in the units of those names.

        Raises:
            ModelError: a name is unknown or a value out of bounds.
        """
        table = self.to_table()
        places = {name: place for name, place, _ in _numbers(self)}
        for name, value in values.items():
            if name not in places:
                raise ModelError(f"parameter: found {name!r}, expected one of {', '.join(places)}")
            *path, last = places[name]
            holder: Any = table
            for key in path:
                holder = holder[key]
            holder[last] = value
        return model_from_table(table)

    def with_block(self, block_id: str, **parameters: Any) -> "Model":
        """Return the model with a block added, or replaced where it stands already.

        Raises:
            ModelError: the block or a parameter is unknown, or a value out of bounds.
        """
        kept = tuple(settings for settings in self.blocks if settings.id != block_id)
        return replace(self, blocks=(*kept, _block_settings({"id": block_id} | parameters)))


def _plain(settings: Any) -> dict[str, Any]:
    values = {f.name: getattr(settings, f.name) for f in fields(settings)}
    given = {name: value for name, value in values.items() if value is not None}
    return {name: list(value) if isinstance(value, tuple) else value for name, value in given.items()}


def _numbers(model: Model) -> list[tuple[str, tuple[Any, ...], Any]]:
    """List (FMI name, place in the table, value) of every number that has a meaning."""
    found: list[tuple[str, tuple[Any, ...], Any]] = []
    if model.beam is not None:
        found += _spoken(model.beam, "beam", ("beam",))
        for k, layer in enumerate(model.beam.layers):
            found += _spoken(layer, f"beam.layer[{k + 1}]", ("beam", "layer", k))
    for k, settings in enumerate(model.blocks):
        found += _spoken(settings.parameters, settings.id, ("block", k))
    return found


def _spoken(settings: Any, prefix: str, place: tuple[Any, ...]) -> list[tuple[str, tuple[Any, ...], Any]]:
    found: list[tuple[str, tuple[Any, ...], Any]] = []
    for name, meaning in meanings(settings).items():
        spoken = f"{prefix}.{spoken_name(name, meaning.unit)}"
        value = getattr(settings, name)
        if isinstance(value, tuple):
            found += [(f"{spoken}[{k + 1}]", (*place, name, k), x) for k, x in enumerate(value)]
        else:
            found.append((spoken, (*place, name), value))
    return found


def _made(kind: type, table: Any, where: str) -> Any:
    if not isinstance(table, Mapping):
        raise ModelError(f"{where}: found {table!r}, expected a table")
    known = [f.name for f in fields(kind)]
    for key in table:
        if key not in known:
            names = ", ".join("layer" if name == "layers" else name for name in known)
            raise ModelError(f"{where}.{key}: unknown key, expected one of {names}")
    hints = get_type_hints(kind)
    values = {key: _of_kind(hints[key], x, f"{where}.{key}") for key, x in table.items()}
    try:
        return kind(**values)
    except TypeError as error:
        raise ModelError(f"{where}: {str(error).split('__init__() ')[-1]}") from None


def _of_kind(hint: Any, value: Any, where: str) -> Any:
    """Return a value as a parameter takes it: a list as a tuple, where it is one.

    Raises:
        ModelError: it is a list or a table where a single value is expected, or has one in it.
    """
    takes_list = any(get_origin(x) is tuple for x in (hint, *get_args(hint)))
    items = value if isinstance(value, list | tuple) else [value]
    if (items is value and not takes_list) or any(isinstance(x, list | Mapping) for x in items):
        wanted = "a list of single values" if takes_list else "a single value"
        raise ModelError(f"{where}: found {str(value)[:_SHOWN]}, expected {wanted}")
    return tuple(value) if isinstance(value, list) else value


def _block_settings(table: Any) -> BlockSettings:
    if not isinstance(table, Mapping) or "id" not in table:
        raise ModelError(f"block: found {table!r}, expected a table with the key id")
    block_id = table["id"]
    if block_id not in BLOCKS:
        raise ModelError(f"block.id: found {block_id!r}, {_like(block_id)}")
    rest = {key: value for key, value in table.items() if key != "id"}
    return BlockSettings(block_id, _made(BLOCKS[block_id].parameters, rest, f"block[{block_id}]"))


def _like(block_id: object) -> str:
    """Return which known blocks an unknown id may mean, all of them where none is like it, in words."""
    near = difflib.get_close_matches(str(block_id).casefold(), BLOCKS, n=3)
    return f"expected the id of a block, as {' or '.join(near)}" if near else f"expected one of {', '.join(BLOCKS)}"


def _beam(table: Any) -> CompositeBeam:
    if not isinstance(table, Mapping) or not isinstance(table.get("layer"), list):
        raise ModelError("beam.layer: found none, expected [[beam.layer]] tables from the bottom up")
    layers = tuple(_made(Layer, x, f"beam.layer[{k + 1}]") for k, x in enumerate(table["layer"]))
    rest = {key: value for key, value in table.items() if key != "layer"}
    if "layers" in rest:
        raise ModelError("beam.layers: unknown key, expected [[beam.layer]] tables")
    return _made(CompositeBeam, rest | {"layers": layers}, "beam")


def model_from_table(table: Mapping[str, Any]) -> Model:
    """Return the model that a table (a parsed TOML file) describes.

    Raises:
        ModelError: a key is unknown or missing, or a value out of bounds; says which.
    """
    for key in table:
        if key not in _TOP_KEYS:
            raise ModelError(f"{key}: unknown key, expected one of {', '.join(_TOP_KEYS)}")
    if table.get("format") != FORMAT:
        raise ModelError(f"format: found {table.get('format')!r}, expected {FORMAT}")
    name = table.get("name")
    if not isinstance(name, str) or not name:
        raise ModelError(f"name: found {name!r}, expected a name")
    blocks = table.get("block")
    if not isinstance(blocks, list):
        raise ModelError(f"block: found {blocks!r}, expected [[block]] tables")
    beam = _beam(table["beam"]) if "beam" in table else None
    settings = tuple(_block_settings(x) for x in blocks)
    valid = _made(ValidRange, table["valid"], "valid") if "valid" in table else None
    origin = _made(Origin, table["origin"], "origin") if "origin" in table else None
    return Model(name, beam, settings, str(table.get("description", "")), valid, origin)


def load_model(name_or_path: str | Path) -> Model:
    """Return a built-in model by its name, or the model in a TOML file.

    Raises:
        ModelError: there is neither, the file is no TOML, or what it says cannot be; the file is named.
    """
    if str(name_or_path) in BUILT_IN:
        text = (Path(__file__).parent / "models" / f"{name_or_path}.toml").read_text(encoding="utf-8")
    else:
        text = _text(str(name_or_path))
    try:
        return model_from_table(tomllib.loads(text))
    except RecursionError:
        raise ModelError(f"{name_or_path}: nested too deeply, expected a model file (TOML)") from None
    except ArithmeticError as error:
        raise ModelError(f"{name_or_path}: its numbers are too large or too small to compute with ({error})") from None
    except tomllib.TOMLDecodeError as error:
        raise ModelError(
            f'{name_or_path}: no TOML ({error}), expected a model file: lines as name = "mine" and [[block]] tables'
        ) from None
    except (ValueError, TypeError) as error:  # or a value of another kind than asked for
        raise ModelError(f"{name_or_path}: {error}") from None


def _text(path: str) -> str:
    wanted = f"expected a model file (TOML) or one of {', '.join(BUILT_IN)}"
    try:
        # opened without waiting: a pipe without a writer would hold the process for ever
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
        with os.fdopen(descriptor, "rb") as file:
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                raise ModelError(f"{path}: found no regular file, {wanted}")
            data = file.read(_MOST_BYTES + 1)
        if len(data) > _MOST_BYTES:
            raise ModelError(f"{path}: found more than {_MOST_BYTES} bytes, {wanted}")
        return data.decode("utf-8")
    except UnicodeDecodeError:
        raise ModelError(f"{path}: not UTF-8 text; {wanted}") from None
    except OSError as error:
        raise ModelError(f"{path or repr(path)}: {error.strerror}; {wanted}") from None
    except ModelError:
        raise
    except ValueError as error:  # a zero byte in the name
        raise ModelError(f"{path!r}: {error}; {wanted}") from None
