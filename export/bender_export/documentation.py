"""The page that an FMU carries: how it is stepped, its equations, its variables.

The equations are those above the code that is in the FMU, so they cannot say anything else than what runs.
"""

import inspect
import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from types import ModuleType

from jinja2 import Environment, StrictUndefined

from bender_export.origin import facts_of
from bender_export.slaves.shell import Row
from bender_loop.control import inverse, model_following, pid, shaper
from bender_plant import composite_beam
from bender_plant.blocks import BLOCKS
from bender_plant.model import Model

HEAD = ("variable", "kind", "unit", "start", "from", "to", "meaning")
_PLANT_RULES = (
    "The voltage is held over a communication step, whose length is free and may vary.",
    "displacement is what the sensor reads at the end of the step, before the next voltage acts; tip_displacement is "
    "where the tip is.",
    "The plant starts at rest, whatever the start time. Disturbances count their phase from t = 0.",
    "A voltage that is not finite, or a parameter out of its bounds, is an FMI error with a message.",
)
_CONTROLLER_RULES = (
    "One communication step is one sample: its length is the sampling time dt.",
    "The command follows at the end of the step from the inputs that were set before it.",
    "Before the first sample the command is the one nearest to 0 that the limits allow.",
)
_FOLLOWING_RULES = (
    *_CONTROLLER_RULES,
    "The model starts at rest with the controller: start it with the plant, at rest.",
    "Where all components of a system step at the same time, each measurement is one step old: sampling.latency is 1.",
)
_REFERENCE_RULES = (
    "The setpoint is worked out at the end of the communication step, for that time.",
    "It starts at `initial`; a stair that begins at a communication point shows at the next one.",
)


@dataclass(frozen=True, slots=True)
class _Part:
    title: str
    place: str
    paragraphs: tuple[tuple[str, str], ...]


def plant_page(name: str, text: str, guid: str, model: Model, table: Sequence[Row]) -> bytes:
    """Return the page of a plant FMU."""
    return _page(name, text, guid, _PLANT_RULES, _parts_of(model), table, model)


def controller_page(name: str, text: str, guid: str, table: Sequence[Row]) -> bytes:
    """Return the page of the controller FMU."""
    return _page(name, text, guid, _CONTROLLER_RULES, [_pid_part()], table)


def following_page(name: str, text: str, guid: str, model: Model, table: Sequence[Row]) -> bytes:
    """Return the page of a model-following controller, with the equations of its model."""
    parts = [
        _Part("Model-following control", "", _paragraphs(model_following)),
        _Part("Shaper", "", _paragraphs(shaper)),
        _Part("Inverse of the model", "", _paragraphs(inverse)),
        _pid_part(),
        *_parts_of(model),
    ]
    return _page(name, text, guid, _FOLLOWING_RULES, parts, table, model)


def reference_page(name: str, text: str, guid: str, table: Sequence[Row]) -> bytes:
    """Return the page of the reference FMU."""
    from bender_export.slaves import reference

    return _page(name, text, guid, _REFERENCE_RULES, [_Part("Staircase", "", _paragraphs(reference))], table)


def origin_page(name: str, text: str, model: Model) -> bytes:
    """Return the page of an FMU of somebody else's with stages of ours around it: where these come from."""
    lines = "".join(
        f"<dt>{escape(title)}</dt>" + "".join(f"<dd>{escape(x)}</dd>" for x in said) for title, said in facts_of(model)
    )
    body = (
        f"<h1>{escape(name)}</h1><p>{escape(text)}</p><h2>Where it comes from</h2><dl>{lines}</dl>"
        '<p>The report of the diagnosis: <a href="report.html">report.html</a>.</p>'
    )
    head = f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(name)}</title></head>'
    return f"{head}<body>{body}</body></html>\n".encode()


def cells(row: Row) -> tuple[str, ...]:
    """Return what a table of variables says of one of them, in the order of `HEAD`."""
    kind = f"{row.variability} parameter" if row.causality == "parameter" else row.causality
    start = "" if row.causality == "output" else _number(row.start)
    return row.name, kind, row.unit, start, _number(row.minimum), _number(row.maximum), row.description


def _pid_part() -> _Part:
    return _Part("PID block", "", _paragraphs(pid) + _paragraphs_of(inspect.getdoc(pid.step) or ""))


def _parts_of(model: Model) -> list[_Part]:
    """List the beam and the blocks of a model, each with its equations."""
    parts = []
    if model.beam is not None:
        parts.append(_Part("Composite beam", "", _paragraphs(composite_beam)))
    for settings in model.blocks:
        block = BLOCKS[settings.id]
        parts.append(_Part(block.title, f"{block.stage}, block {block.id}", _paragraphs(block.module)))
    return parts


def _page(
    name: str,
    text: str,
    guid: str,
    rules: Sequence[str],
    parts: Sequence[_Part],
    table: Sequence[Row],
    model: Model | None = None,
) -> bytes:
    source = (files("bender_export") / "pages" / "page.html.j2").read_text(encoding="utf-8")
    template = Environment(autoescape=True, undefined=StrictUndefined).from_string(source)
    rows = [cells(row) for row in table]
    facts = () if model is None else facts_of(model)
    has_report = model is not None and model.origin is not None and bool(model.origin.report)
    page = template.render(
        name=name,
        text=text,
        guid=guid,
        facts=facts,
        has_report=has_report,
        rules=rules,
        parts=parts,
        head=HEAD,
        rows=rows,
    )
    return page.encode() + b"\n"


def _paragraphs(module: ModuleType) -> tuple[tuple[str, str], ...]:
    return _paragraphs_of(inspect.cleandoc(module.__doc__ or ""))


def _paragraphs_of(text: str) -> tuple[tuple[str, str], ...]:
    """Split prose from equations: equations are indented."""
    found = []
    for paragraph in text.split("\n\n"):
        indented = paragraph.startswith("    ")
        found.append(("pre", inspect.cleandoc("\n" + paragraph)) if indented else ("p", paragraph))
    return tuple(found)


def _number(value: float) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.6g}" if math.isfinite(value) else ""
