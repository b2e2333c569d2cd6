"""`bender effects [ID]`: the catalogue of effects, or one of them with a picture of its signature."""

import argparse
import sys
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bender_discrepancy.effects.catalogue import Effect
    from piezo_bender import Catalogue

HELP = "list the effects that a model may lack, or show one of them"
EXAMPLE = """\
bender effects
bender effects creep
bender effects creep --json"""
WIDTH = 100


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the effect and where its picture goes."""
    parser.add_argument("effect", nargs="?", metavar="ID", help="one effect, by the id that the list shows")
    parser.add_argument("--out", type=Path, metavar="DIR", help="for signature.png (default: results/effect-ID)")
    parser.add_argument("--json", action="store_true", help="print JSON instead, and draw nothing")


def run(arguments: argparse.Namespace) -> int:
    """Print the catalogue, or one effect and write its signature.png.

    Raises:
        InputError: there is no such effect, or --out has nothing to write.
    """
    from bender_loop.errors import InputError
    from piezo_bender import effects

    asked: str | None = arguments.effect
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
        picture = _draw(found, arguments.out)
        _print_effect(found.only)
        sys.stdout.write(f"written: {picture}\n")
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


def _draw(found: "Catalogue", out: Path) -> Path:
    from bender_loop.shell.files import prepare_directory, write_atomically

    picture = found.picture()
    path = prepare_directory(out) / "signature.png"
    write_atomically(path, picture)
    return path


def _print_effect(effect: "Effect") -> None:
    from bender_loop.shell.progress import print_table

    cause = effect.block.module.__doc__ if effect.block.id == effect.id else effect.summary
    sys.stdout.write(f"{effect.title} ({effect.id}, {effect.stage})\n\n{_indented(cause or effect.summary)}\n\n")
    for heading, text in (
        ("leaves", effect.signature),
        ("resembles", ", ".join(effect.confusables)),
        ("told apart", effect.separation),
        ("shown by", effect.excitation),
        ("note", effect.unusual),
    ):
        if text:
            sys.stdout.write(_hanging(heading, text) + "\n")
    sys.stdout.write("\n")
    rows = [
        [name, known.unit, _range((known.low, known.high)), _range(effect.covered.get(name)), *_typical(effect, name)]
        for name, known in effect.parameters.items()
    ]
    sizes = "covered and typical in size" if any(x.low < 0.0 for x in effect.parameters.values()) else ""
    title = f"block {effect.block.id} of the model file" + (f", {sizes}" if sizes else "")
    print_table(title, ["parameter", "unit", "bounds", "covered", "typical", "why"], rows)
    sys.stdout.write(f"page: {effect.page}\n")


def _typical(effect: "Effect", name: str) -> tuple[str | None, str | None]:
    low, high, text = effect.typical.get(name, (None, None, None))
    return (None, None) if low is None or high is None else (_range((low, high)), text)


def _range(limits: tuple[float, float] | None) -> str | None:
    return None if limits is None else f"{limits[0]:g} to {limits[1]:g}"


def _indented(text: str) -> str:
    return "\n".join(f"  {line}".rstrip() for line in text.strip().splitlines())


def _hanging(heading: str, text: str) -> str:
    return textwrap.fill(text, WIDTH, initial_indent=f"  {heading:<12}", subsequent_indent=" " * 14)
