"""The documentation that follows from the catalogue: tables of the pages, the index, the table of the plant's blocks.

A page keeps its prose (equation, typical values, what it leaves in the residual, excitation, sources). Its head, what
it is confused with and its parameters are written from the catalogue, here and nowhere else.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bender_effects.effect import OTHER_RIGS, Effect
from bender_plant.blocks import BLOCKS, STAGES, Block
from bender_report.wording import unit_text

INDEX = "docs/effects/index.md"
PLANT = "plant_src/README.md"
SKELETON = """\
# {title}

`{id}`

TODO: what happens, and in which device.

## Equation

```
TODO
```

TODO: what every symbol is: s = `{size}`.

## Typical values

- TODO: a size, and where it comes from.

## What it leaves in the residual

- TODO

## What it is confused with

| effect | what separates it |
|---|---|

## Which excitation shows it

TODO

## Parameters

## Sources

- TODO
"""
_SIGNALS = {
    "supply": "command v_c -> electrode voltage v",
    "material": "v -> quasi-static displacement w",
    "structure": "w -> tip y",
    "surroundings": "y",
    "sensor": "y -> reading r",
}


def root_of_checkout() -> Path | None:
    """Return the root of the checkout that this package stands in, None where it was installed without the pages."""
    root = Path(__file__).parents[2]
    return root if (root / INDEX).is_file() else None


def documents(effects: Mapping[str, Effect], root: Path) -> dict[Path, str]:
    """Return every generated document as it should be, by its path below `root`."""
    found = {Path(x.page): page(x, _read(root / x.page) or SKELETON) for x in effects.values()}
    found[Path(INDEX)] = index(effects, _read(root / INDEX))
    found[Path(PLANT)] = plant_table(_read(root / PLANT))
    return found


def stale(effects: Mapping[str, Effect], root: Path) -> list[str]:
    """Return what stands otherwise in the checkout than it should, and pages of no effect, by their paths."""
    wrong = [path.as_posix() for path, text in documents(effects, root).items() if _read(root / path) != text]
    pages = {path.stem for path in (root / INDEX).parent.glob("*.md")}
    return sorted([*wrong, *(f"docs/effects/{name}.md" for name in pages - {"index", *effects})])


def page(effect: Effect, text: str) -> str:
    """Return the page of an effect with its generated parts written anew."""
    head = f"`{effect.id}` · stage *{effect.stage}*"
    if effect.block.id != effect.id:
        head += f" · block `{effect.block.id}`"
    if effect.rigs == OTHER_RIGS:
        head += " · [other rigs](index.md#other-rigs)"
    prose = text.split("\n", 3)[3] if text.count("\n") > 3 else ""
    text = f"# {effect.title}\n\n{head}\n{prose}"
    rows = [[f"[`{other}`]({other}.md)", words] for other, words in effect.resembles.items()]
    text = _with_section(text, "What it is confused with", _table(["effect", "what separates it"], rows))
    covered = "covered ([scaled](index.md#ranges))" if effect.relative else "covered"
    heads = ["parameter", "unit", covered, "typical", "meaning"]
    rows = [_parameter_row(effect, name) for name in shown_parameters(effect)]
    return _with_section(text, "Parameters", _table(heads, rows))


def shown_parameters(effect: Effect) -> list[str]:
    """Return the parameters on a page: all but the range that a curve was learned from, which the index explains."""
    return [name for name in effect.defaults if not name.startswith("straight_")]


def _parameter_row(effect: Effect, name: str) -> list[str]:
    known = effect.parameters.get(name)
    if known is None:
        forms = ", ".join(f"`{form}`" for form in effect.block.module.FORMS)
        return [f"`{name}`", "–", "–", "–", f"one of {forms}"]
    ranges = [_range(effect.covered.get(name)), _range(effect.typical.get(name))]
    return [f"`{name}`", unit_text(known.unit) or "1", *ranges, known.text.replace("|", "&#124;")]


def index(effects: Mapping[str, Effect], text: str) -> str:
    """Return the index of the pages with its table and its lists written anew."""
    rows = [[f"[`{x.id}`]({x.id}.md)", x.stage, x.summary] for x in effects.values()]
    table = _table(["effect", "stage", "what it is"], rows)
    text = re.sub(r"^\|.*?\n(?!\|)", lambda _: f"{table}\n", text, count=1, flags=re.MULTILINE | re.DOTALL)
    for lead, chosen in (
        ("at any visible size:\n", [x for x in effects.values() if x.unusual]),
        ("no beam with a piezoelectric layer:\n", [x for x in effects.values() if x.rigs == OTHER_RIGS]),
    ):
        links = [f"[`{x.id}`]({x.id}.md)" for x in chosen]
        listed = ",\n".join(", ".join(links[k : k + 4]) for k in range(0, len(links), 4)) + ".\n"
        until_its_end = f"{re.escape(lead)}.*?\\.\n(?=\n)"
        text = re.sub(until_its_end, lambda _, new=lead + listed: new, text, flags=re.DOTALL)
    return text


def plant_table(text: str) -> str:
    """Return the README of the plant with the table of its blocks and the list of its transducers written anew."""
    rows = [[stage, _blocks_of(stage), _SIGNALS[stage]] for stage in STAGES]
    table = _table(["stage", "blocks", "signal"], rows)
    return re.sub(r"^\|.*?\n(?!\|)", lambda _: f"{table}\n", text, count=1, flags=re.MULTILINE | re.DOTALL)


def _blocks_of(stage: str) -> str:
    own = [block for block in BLOCKS.values() if block.stage == stage]
    if not any(block.transducer for block in own):
        return _listed(own)
    first = next(k for k, block in enumerate(own) if block.transducer)
    return f"{_listed(own[:first])}, one transducer, then {_listed(own[first:])}"


def _listed(blocks: list[Block]) -> str:
    return " ".join(f"`{block.id}`" for block in blocks if not block.transducer)


def _with_section(text: str, heading: str, body: str) -> str:
    """Return a page with what stands under a heading replaced.

    Raises:
        ValueError: the page lacks the heading.
    """
    before, found, rest = text.partition(f"## {heading}\n")
    if not found:
        raise ValueError(f"{text.splitlines()[0]}: found no heading {heading!r}, expected '## {heading}'")
    _, further, after = rest.partition("\n## ")
    return f"{before}{found}\n{body}\n{further}{after}"


def _table(heads: list[str], rows: list[list[str]]) -> str:
    lines = [heads, *rows]
    text = [f"| {' | '.join(line)} |" for line in lines]
    return "\n".join([text[0], "|" + "---|" * len(heads), *text[1:]])


def _range(limits: tuple[Any, ...] | None) -> str:
    return "–" if limits is None else " … ".join(f"{x:g}" for x in limits[:2])


def _read(path: Path) -> str:
    return path.read_text(encoding="utf-8") if path.is_file() else ""
