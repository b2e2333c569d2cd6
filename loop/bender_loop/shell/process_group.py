"""A process of its own group: what is typed at the controller's terminal does not reach it."""

import os
import subprocess
from typing import Any


def own_group() -> dict[str, Any]:
    """Return the keywords of Popen that keep the signals of the terminal's keys from the child."""
    if os.name == "nt":
        return {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}
    return {"start_new_session": True}
