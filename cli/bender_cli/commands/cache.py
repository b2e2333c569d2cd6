"""`bender cache`: where built FMUs and compiled code are kept, how large they are, and to clear them."""

import argparse
import sys
from dataclasses import asdict

HELP = "show where built FMUs and compiled code are kept, or clear them"
EXAMPLE = """\
bender cache
bender cache --clear"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the clearing."""
    parser.add_argument("--clear", action="store_true", help="remove everything; commands make it again when needed")


def run(arguments: argparse.Namespace) -> int:
    """Print the place and its size; clear it on request.

    Raises:
        InputError: a file cannot be removed.
    """
    from bender_loop.shell.cache import cache_folder, cached_files, clear
    from bender_loop.shell.progress import print_table
    from bender_loop.shell.run import answer

    folder, found = cache_folder(), cached_files(cache_folder())
    size = sum(x.size_bytes for x in found)
    if arguments.clear:
        clear(folder)
    answer({"folder": str(folder), "bytes": size, "cleared": arguments.clear, "holds": [asdict(x) for x in found]})
    print_table(str(folder), ["kind", "files", "MB"], [[x.kind, x.files, x.size_bytes / 1e6] for x in found])
    sys.stdout.write(
        f"{size / 1e6:.1f} MB {'cleared' if arguments.clear else 'in all; to clear: bender cache --clear'}\n"
    )
    return 0
