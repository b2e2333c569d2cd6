"""Small slaves in C: the controller and the reference, whose `rest` and `step` are all there is to translate."""

from collections.abc import Mapping
from typing import Any

from bender_export.slaves.controller import PidController, table_of
from bender_export.slaves.reference import TABLE as REFERENCE_TABLE
from bender_export.slaves.reference import StaircaseReference
from bender_export.slaves.shell import Row, Shell
from bender_loop.control.pid import PidState
from bender_native.model_source import Source, Staging
from bender_native.staging.calls import python_call
from bender_native.staging.values import Known, Number


def controller_source(dual: bool = False, start: Mapping[str, float] | None = None) -> Source:
    """Return the PID block in C.

    Args:
        dual: with derivatives.
        start: start values of its parameters in place of its own, by name.

    Raises:
        TranslationError: the translator does not know a construct of the block.
    """
    return _source(PidController, table_of(start or {}), PidState(), dual)


def reference_source(dual: bool = False) -> Source:
    """Return the setpoint of the closed loop in C.

    Raises:
        TranslationError: the translator does not know a construct of it.
    """
    return _source(StaircaseReference, REFERENCE_TABLE, (), dual)


def _source(kind: type[Shell], table: tuple[Row, ...], memory: Any, dual: bool) -> Source:
    staging = Staging(kind.__name__, table, dual)
    # the block says itself what of its memory must be finite
    staging.sound = "number != NULL"
    places = staging.remembered(memory, "memory")

    def run(method: str, *arguments: Any) -> None:
        context = staging.context
        instance: Any = object.__new__(kind)
        values = [staging.value(k) for k in range(len(table))]
        instance.__dict__.update(
            values=Known(values, context.region), memory=places, block=None, start_time_s=Number("m->start_time_s")
        )
        python_call(context, getattr(kind, method), [instance, *arguments], {}, None)
        staging.stop_if_failed()
        staging.stored([staging.value(k) for k in range(len(table))], list(instance.values))
        staging.stored(places, instance.memory)

    staging.function("model_prepare", lambda: staging.context.emit("(void)m;"))
    staging.function("model_at_rest", lambda: run("rest"))
    staging.function("model_advance", lambda: run("step", Number("time_s"), Number("step_s")), ("time_s", "step_s"))
    return staging.source()
