"""`bender effects [ID]`: the catalogue of effects, one of them with a picture of its signature, or a new one."""

import argparse
import sys
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bender_effects.catalogue import Effect
    from piezo_bender import Catalogue

HELP = "list the effects that a model may lack, or explain one of them"
EXAMPLE = """\
bender effects
bender effects creep
bender effects creep --json
bender effects new reading_ceiling --stage sensor
bender effects --write-docs"""
WIDTH = 100
NEW = "new"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the effect, where its picture goes, and what a new one needs."""
    parser.add_argument("effect", nargs="?", metavar="ID", help="one effect, by the id that the list shows; or: new")
    parser.add_argument("new_id", nargs="?", metavar="NEW_ID", help="with new: the id of the effect to begin")
    parser.add_argument("--stage", help="with new: supply, material, structure, surroundings or sensor")
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="directory of signature.png (default: results/effect-ID)"
    )
    parser.add_argument("--json", action="store_true", help="print JSON instead, and draw nothing")
    parser.add_argument(
        "--write-docs", action="store_true", help="write the generated tables of the documentation pages"
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the catalogue, or one effect and write its signature.png; or begin an effect, or write the pages.

    Raises:
        InputError: there is no such effect, or options do not go together.
    """
    from bender_loop.errors import InputError
    from piezo_bender import effects

    asked: str | None = arguments.effect
    if arguments.write_docs:
        return _write_docs(arguments)
    if asked == NEW:
        return _begin(arguments)
    for name, given in (("NEW_ID", arguments.new_id), ("--stage", arguments.stage)):
        if given is not None:
            raise InputError(f"{name}: found {given!r}, expected it with new only: {EXAMPLE.splitlines()[3]}")
    found = effects(asked)
    if arguments.out is not None and (asked is None or arguments.json):
        reason = "together with --json" if arguments.json else "without an effect"
        raise InputError(f"--out: found {arguments.out} {reason}, expected one effect to draw: bender effects creep")
    if arguments.json:
        _print_json(found, alone=asked is not None)
    elif asked is None:
        _print_list(found.effects)
    else:
        if arguments.out is None:
            arguments.out = Path("results") / f"effect-{asked}"
        last = _draw(found, arguments.out)
        _print_effect(found.only)
        sys.stdout.write(f"{last}\n")
    return 0


def _begin(arguments: argparse.Namespace) -> int:
    """Write the skeleton of a new effect into the checkout."""
    from bender_effects.checkout import begun
    from bender_loop.errors import InputError

    if arguments.new_id is None or arguments.stage is None or arguments.json or arguments.out is not None:
        raise InputError(f"effects new: expected an id and a stage and nothing else: {EXAMPLE.splitlines()[3]}")
    sys.stdout.writelines(f"{line}\n" for line in begun(arguments.new_id, arguments.stage))
    return 0


def _write_docs(arguments: argparse.Namespace) -> int:
    """Write the generated parts of the documentation into the checkout."""
    from bender_effects.checkout import documented
    from bender_loop.errors import InputError

    if any(x is not None for x in (arguments.effect, arguments.stage, arguments.out)) or arguments.json:
        raise InputError("--write-docs: expected nothing beside it: bender effects --write-docs")
    sys.stdout.writelines(f"{line}\n" for line in documented())
    return 0


def _print_list(effects: "Sequence[Effect]") -> None:
    from bender_loop.shell.progress import print_table

    rows = [[effect.id, effect.stage, effect.summary] for effect in effects]
    print_table("Effects that a measurement may show and a model may lack", ["effect", "stage", "what it is"], rows)
    sys.stdout.write("one of them, with a picture of what it leaves in the residual: bender effects creep\n")


def _print_json(found: "Catalogue", alone: bool) -> None:
    import json

    entries = list(found.to_dict().values())
    text = json.dumps(entries[0] if alone else entries, indent=2, ensure_ascii=False, allow_nan=False)
    sys.stdout.write(text + "\n")


def _draw(found: "Catalogue", out: Path) -> str:
    """Write the picture; returns the line that says where it is, or why there is none."""
    from bender_loop.shell.files import prepare_directory, write_atomically
    from bender_report.drawing import can_draw, no_pictures

    if not can_draw():
        return no_pictures()
    picture = found.picture()
    path = prepare_directory(out) / "signature.png"
    write_atomically(path, picture)
    return f"written: {path}"


def _print_effect(effect: "Effect") -> None:
    from bender_loop.shell.progress import print_table
    from bender_report.wording import unit_text

    cause = effect.block.module.__doc__ if effect.block.id == effect.id else effect.summary
    sys.stdout.write(f"{effect.title} ({effect.id}, {effect.stage})\n\n{_indented(cause or effect.summary)}\n\n")
    for heading, text in (
        ("signature", effect.signature),
        ("resembles", ", ".join(effect.confusables)),
        ("differs", effect.separation),
        ("shown by", effect.excitation),
        ("note", effect.unusual),
    ):
        if text:
            sys.stdout.write(_hanging(heading, text) + "\n")
    sys.stdout.write("\n")
    rows = [
        [name, unit_text(x.unit) or "1", _range((x.low, x.high)), *_covered_and_typical(effect, name)]
        for name, x in effect.parameters.items()
    ]
    sizes = "covered and typical in size" if any(x.low < 0.0 for x in effect.parameters.values()) else ""
    title = f"block {effect.block.id} of the model file" + (f", {sizes}" if sizes else "")
    print_table(title, ["parameter", "unit", "bounds", "covered", "typical", "why"], rows)
    sys.stdout.write(f"page: {effect.page}\n")


def _covered_and_typical(effect: "Effect", name: str) -> tuple[str | None, ...]:
    low, high, text = effect.typical.get(name, (None, None, None))
    typical = (None, None) if low is None or high is None else (_range((low, high)), text)
    return _range(effect.covered.get(name)), *typical


def _range(limits: tuple[float, float] | None) -> str | None:
    from bender_plant.parameter import WIDEST

    if limits is None:
        return None
    return " to ".join(f"{x:g}" if abs(x) < WIDEST else "∞" if x > 0.0 else "-∞" for x in limits)


def _indented(text: str) -> str:
    return "\n".join(f"  {line}".rstrip() for line in text.strip().splitlines())


def _hanging(heading: str, text: str) -> str:
    return textwrap.fill(text, WIDTH, initial_indent=f"  {heading:<12}", subsequent_indent=" " * 14)
