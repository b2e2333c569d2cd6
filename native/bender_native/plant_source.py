"""The plant in C, or stages of it: `Plant`, made and stepped by a slave of `bender_export`, with one model known."""

from dataclasses import fields
from typing import Any

from bender_export.slaves import plant as slave
from bender_export.slaves.plant import PiezoBender, table_of
from bender_export.slaves.shell import Row
from bender_export.slaves.stage import StageBeside, StagesBefore
from bender_native.model_source import Source, Staging
from bender_native.staging.calls import python_call
from bender_native.staging.values import Home, Known, Number, WithTail, made
from bender_plant.blocks import BLOCKS
from bender_plant.model import Model
from bender_plant.parameter import meanings
from bender_plant.plant import Plant, State, effective_settings
from bender_plant.variables import SIGNALS


def plant_source(model: Model, dual: bool = False) -> Source:
    """Return the plant of a model in C; `dual` adds the derivative beside every value.

    Raises:
        TranslationError: the translator does not know a construct of a kernel; says which, where.
    """
    return _source(PiezoBender, Plant.step.__name__, model, table_of(model), dual)


def stage_source(kind: type[PiezoBender], model: Model, table: tuple[Row, ...], dual: bool = False) -> Source:
    """Return stages of the chain by themselves in C.

    Args:
        kind: StagesBefore, StagesBehind or StageBeside.
        model: of the stages alone.
        table: their variables.
        dual: adds the derivative beside every value.

    Raises:
        TranslationError: as `plant_source`.
    """
    advance = Plant.step if kind is StageBeside else Plant.held if kind is StagesBefore else Plant.along
    return _source(kind, advance.__name__, model, table, dual)


def _source(kind: type[PiezoBender], advance: str, model: Model, table: tuple[Row, ...], dual: bool) -> Source:
    staging = Staging(kind.__name__, table, dual)
    unknown, settings = _unknown(model, staging, len(table) - len(table_of(model)) + len(SIGNALS))
    staging.context.general = {Plant.held, Plant.along}
    chain = effective_settings(model)
    plant = object.__new__(Plant)

    def prepare() -> None:
        context = staging.context
        context.inline = True
        for checked in settings:
            check = getattr(type(checked), "__post_init__", None)
            if check is not None:
                python_call(context, check, [checked], {}, None)
        python_call(context, Plant.__init__, [plant, unknown], {}, None)
        staging.stop_if_failed()
        for name in Plant.__slots__:
            setattr(plant, name, _installed(staging, name, getattr(plant, name), [block.id for block, _ in chain]))
        context.inline = False

    staging.function("model_prepare", prepare)
    memory = _memory(staging, chain, plant)

    def run(method: str, *arguments: Any) -> None:
        context = staging.context
        instance: Any = object.__new__(kind)
        values = [staging.value(k) for k in range(len(staging.table))]
        instance.__dict__.update(
            values=Known(values, context.region),
            memory=memory,
            initial=memory,
            stale=False,
            start_time_s=Number("m->start_time_s"),
            advance=getattr(plant, advance),
        )
        python_call(context, getattr(kind, method), [instance, *arguments], {}, None)
        staging.stop_if_failed()
        staging.stored([staging.value(k) for k in range(len(values))], list(instance.values))
        if method == "rest":
            context.emit("model_initial(m);")
        else:
            staging.stored([memory.voltage_V, memory.since_jump_s], [instance.memory[0], instance.memory[1]])

    def at_rest() -> None:
        staging.context.emit("model_initial(m);")
        run("rest")

    staging.function("model_at_rest", at_rest)
    staging.function("model_advance", lambda: run("step", Number("time_s"), Number("step_s")), ("time_s", "step_s"))
    return staging.source()


def _unknown(model: Model, staging: Staging, first: int) -> tuple[Model, list[Any]]:
    """Return the model with every FMI parameter unknown, and its parts in the order in which Python makes them."""
    place = first
    parts: list[Any] = []

    def unknown(settings: Any, more: dict[str, Any]) -> Any:
        nonlocal place
        values = {f.name: getattr(settings, f.name) for f in fields(settings)} | more
        for name in meanings(settings):
            many = isinstance(values[name], tuple)
            count = len(values[name]) if many else 1
            numbers = tuple(staging.value(place + k) for k in range(count))
            values[name] = numbers if many else numbers[0]
            place += count
        return made(type(settings), values)

    beam = model.beam
    if beam is not None:
        whole = unknown(beam, {})
        layers = tuple(unknown(layer, {}) for layer in beam.layers)
        object.__setattr__(whole, "layers", layers)
        parts += [*layers, whole]
        beam = whole
    blocks = []
    for settings in model.blocks:
        parts.append(unknown(settings.parameters, {}))
        blocks.append(made(type(settings), {"id": settings.id, "parameters": parts[-1]}))
    values = {
        "name": model.name,
        "beam": beam,
        "blocks": tuple(blocks),
        "description": model.description,
        "valid": None,
        "origin": None,
    }
    return made(Model, values), parts


def _installed(staging: Staging, name: str, value: Any, ids: list[str]) -> Any:
    """Return an attribute of the plant with the numbers in it kept in the struct."""
    if name in ("_links", "_commands"):
        return tuple(type(link)(*[staging.kept(x, f"{ids[link.slot]}") for x in link]) for link in value)
    return staging.kept(value, name.strip("_"))


def _memory(staging: Staging, chain: list[Any], plant: Plant) -> State:
    start = plant.initial()
    voltage = staging.remembered(start.voltage_V, "voltage_V")
    age = staging.remembered(start.since_jump_s, "since_jump_s")
    slots: list[Any] = []
    for (block, _), rest in zip(chain, start.blocks, strict=True):
        own = staging.remembered(rest, block.id)
        most = getattr(block.module, "MOST_UNDER_WAY", 0)
        slots.append(WithTail(own, staging.ring(f"{block.id}_under_way", 2 * most)) if most else own)
    return State(voltage, age, Home(slots))  # pyright: ignore[reportArgumentType]


__all__ = ["BLOCKS", "plant_source", "slave", "stage_source"]
