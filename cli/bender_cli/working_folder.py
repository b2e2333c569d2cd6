"""On import, the working folder is forgotten: a `statistics.py` that lies there is not the one of Python.

This holds here and in every process that is started from here. Nothing is imported before it that Python has not loaded
to get here.
"""

import os
import sys


def _forget() -> None:
    os.environ["PYTHONSAFEPATH"] = "1"
    try:
        working = os.getcwd()
    except OSError:
        working = ""
    # `python -m` has put it first
    if not sys.flags.safe_path and sys.path and sys.path[0] in ("", working):
        del sys.path[0]


_forget()
