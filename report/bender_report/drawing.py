"""Whether pictures can be drawn here: matplotlib belongs to the extra `pictures`."""

import importlib.util

from bender_loop.shell.extras import install_command, require


def can_draw() -> bool:
    """Return whether matplotlib is installed; it is not imported."""
    return importlib.util.find_spec("matplotlib") is not None


def no_pictures() -> str:
    """Return the sentence to say in place of a picture."""
    return f"matplotlib, which draws pictures, is not installed: {install_command('pictures')}"


def require_drawing(what: str) -> None:
    """Refuse what is nothing without a picture, where none can be drawn.

    Raises:
        InputError: matplotlib is not installed; says how it comes.
    """
    require("matplotlib", "pictures", what)
