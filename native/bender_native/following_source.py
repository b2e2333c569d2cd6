"""The model-following controller in C: the slave that PythonFMU would run, around the C of the model that it follows.

The controller is translated from its Python source, as the PID block is. The model is the C of its own FMU, under
other names in a file beside it; the controller runs it through the few functions of `c/followed.h`.
"""

import functools
import re
from collections.abc import Mapping
from typing import Any

from bender_export.slaves.following import ModelFollowingController, table_of
from bender_export.slaves.plant import table_of as table_of_plant
from bender_export.slaves.shell import Row
from bender_loop.control.model_following import Memory
from bender_loop.control.pid import PidState
from bender_loop.control.shaper import Shaped
from bender_native.model_source import Source, Staging
from bender_native.plant_source import plant_source
from bender_native.staging.calls import python_call
from bender_native.staging.context import text_of
from bender_native.staging.values import Known, Number, Primitive, Ring, literal
from bender_plant.model import Model, model_from_table

_OF_A_FILE = re.compile(
    r"\b(Model|State|Numbers|Scratch|Variable|Role)\b"
    r"|\b(VARIABLES|INPUTS|OUTPUTS|STATES|MESSAGE_BYTES|MOST_DEPTH|MODEL_H|VARIABLE_TABLE|AN_INPUT|AN_OUTPUT|FIXED|TUNABLE)\b"
    r"|\b(model_\w+)\b"
)
_BUILT_IN = ("inverse.horizon", "sampling.latency")
"""What the C is written for: its loops and the length of its memory follow from it."""


def following_source(settings: Mapping[str, Any]) -> tuple[Source, dict[str, str]]:
    """Return the controller in C, and the further files that it includes or calls, by name.

    Args:
        settings: as `bender_export.following.following_settings` gives them.

    Raises:
        TranslationError: the translator does not know a construct of controller or model; says which, where.
    """
    whole = model_from_table(settings["model"]).with_values(settings["both"])
    plant = plant_source(whole)
    files = {
        "plant.h": _renamed(plant.header),
        "plant.c": _renamed(plant.body).replace('"model.h"', '"plant.h"'),
    }
    return _controller(settings, whole, plant), files


def _renamed(text: str) -> str:
    """Return the C of a plant under names that may stand beside those of the controller."""

    def other(found: re.Match[str]) -> str:
        kind, constant, function = found.groups()
        return f"Plant{kind}" if kind else f"PLANT_{constant}" if constant else f"plant_{function}"

    return _OF_A_FILE.sub(other, text)


def _controller(settings: Mapping[str, Any], whole: Model, plant: Source) -> Source:
    table = tuple(_as_built(row) for row in table_of(settings))
    staging = Staging(ModelFollowingController.__name__, table)
    staging.sound, staging.ring_sound = "number != NULL", "!isnan(state->name[k])"
    staging.headers.append("followed.h")
    context = staging.context
    context.inline = True
    names = [row.name for row in table_of_plant(whole)]
    output = names.index(settings["output"])
    capacity = len(table_of_plant(whole)) + plant.state_doubles
    predictor = _Followed(staging, "predictor", output, capacity)
    inverted = predictor
    if settings["left_out"]:
        inverted = _Followed(staging, "inverted", output, capacity)
    latency = int(settings["start"]["sampling.latency"])
    number = functools.partial(staging.remembered, 0.0)
    places = Memory(
        ahead=staging.ring("ahead", capacity),
        behind=staging.ring("behind", capacity),
        frames=staging.remembered((0.0,) * (latency + 1), "frames"),
        shaped=staging.remembered(Shaped(), "shaped"),
        standing_V=number("standing_V"),
        feedforward_V=number("feedforward_V"),
        slope_um_per_V=number("slope_um_per_V"),
        block=staging.remembered(PidState(), "block"),
        command_V=number("command_V"),
        begun=number("begun"),
        rest_um=number("rest_um"),
        way=number("way"),
        aside_V=number("aside_V"),
    )

    def prepare() -> None:
        predictor.made({})
        if inverted is not predictor:
            inverted.made({names.index(name): float(value) for name, value in settings["left_out"].items()})

    def run(method: str, *arguments: Any) -> None:
        instance: Any = object.__new__(ModelFollowingController)
        values = [row.start if row.name in _BUILT_IN else staging.value(k) for k, row in enumerate(table)]
        instance.__dict__.update(
            values=Known(values, context.region), memory=places, follower=None, lead_s=settings["lead_s"],
            predictor=predictor, inverted=inverted, start_time_s=Number("m->start_time_s"),
        )  # fmt: skip
        python_call(context, getattr(ModelFollowingController, method), [instance, *arguments], {}, None)
        staging.stop_if_failed()
        staging.stored([staging.value(k) for k in range(len(table))], list(instance.values))
        staging.stored(places, instance.memory)

    staging.function("model_prepare", prepare)
    staging.function("model_at_rest", lambda: run("rest"))
    staging.function("model_advance", lambda: run("step", Number("time_s"), Number("step_s")), ("time_s", "step_s"))
    return staging.source()


def _as_built(row: Row) -> Row:
    """Return the row of a variable; what the C is written for can take its own value only."""
    return row._replace(minimum=row.start, maximum=row.start) if row.name in _BUILT_IN else row


class _Followed:
    """A model as the controller runs it: `SavablePlant` of `bender_loop`, written in C."""

    def __init__(self, staging: Staging, name: str, output: int, capacity: int) -> None:
        staging.include_field(f"Followed {name};")
        self._staging, self._place, self._output, self._capacity = staging, f"&m->{name}", output, capacity
        self._message = f"m->{name}.plant"
        self.reset, self.step, self.read = Primitive(self._reset), Primitive(self._step), Primitive(self._read)
        self.save, self.restore, self.close = Primitive(self._save), Primitive(self._restore), Primitive(lambda: None)

    def made(self, values: Mapping[int, float]) -> None:
        """Write how the model is made of its start values and those of some of its parameters."""
        places = ", ".join(str(x) for x in values) or "0"
        numbers = ", ".join(literal(x) for x in values.values()) or "0.0"
        given = f"(const int[]){{{places}}}, (const double[]){{{numbers}}}"
        self._call(f"followed_made({self._place}, {len(values)}, {given});")

    def _reset(self) -> None:
        self._call(f"followed_reset({self._place});")

    def _step(self, voltage_V: Any, step_s: Any) -> Number:
        self._call(f"followed_step({self._place}, {text_of(voltage_V, 'd')}, {text_of(step_s, 'd')});")
        return self._read()

    def _read(self) -> Number:
        text = f"followed_read({self._place}, {self._output})"
        return self._staging.context.variable("reading", "d", constant_text=text)

    def _save(self) -> Ring:
        ring = self._staging.context.ring("kept", self._capacity, 1)
        self._staging.context.emit(f"{ring.count} = followed_kept({self._place}, {ring.array});")
        return ring

    def _restore(self, state: Ring) -> None:
        self._call(f"followed_back({self._place}, {state.array}, {state.count});")

    def _call(self, line: str) -> None:
        """Write a call, and what follows where the model fails."""
        context = self._staging.context
        context.emit(line)
        context.emit(f'if ({self._message}.failed) say(m, "%s", {self._message}.message);')
        self._staging.stop_if_failed()
