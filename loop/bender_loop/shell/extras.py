"""What an optional part needs, and the command that installs it here."""

import importlib.util
import re

from bender_loop.errors import InputError

DISTRIBUTION = "piezo-bender"


def install_command(extra: str) -> str:
    """Return the command that installs what an extra of this distribution needs, by the names of the distributions."""
    from importlib.metadata import PackageNotFoundError, requires

    try:
        lines = requires(DISTRIBUTION) or []
    except PackageNotFoundError:
        lines = []
    marker = re.compile(rf"extra == ['\"]{re.escape(extra)}['\"]")
    names = [re.split(r"[<>=!~ ;\[]", line, maxsplit=1)[0] for line in lines if marker.search(line)]
    what = " ".join(names) or f'".[{extra}]" in the checkout'
    return f"python -m pip install {what}"


def require(module: str, extra: str, what: str) -> None:
    """Refuse where a module that an extra brings cannot be found; nothing is imported.

    Args:
        module: its name.
        extra: the extra that brings it.
        what: what needs it, for the message.

    Raises:
        InputError: the module is not installed.
    """
    if importlib.util.find_spec(module) is None:
        raise InputError(f"{what} needs {module}, which is not installed: {install_command(extra)}")
