"""Starting and ending the emulated supply's process."""

import contextlib
import json
import os
import subprocess
import sys
from types import TracebackType
from typing import Any, Self

from bender_hil.emulator.settings import SupplyEmulation
from bender_hil.wire import Channel, Message, call
from bender_loop.errors import InputError, RunError


def own_group() -> dict[str, Any]:
    """Keywords of Popen that keep an interrupt at the keyboard from the child."""
    if os.name == "nt":
        return {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}
    return {"start_new_session": True}


class EmulatedSupply:
    """The process of an emulated supply.

    Args:
        settings: what it is told.

    Attributes:
        resource: its VISA address.
        console: a channel to its fault console.

    Raises:
        InputError: the FMU is not one that it can drive.
        RunError: the process does not start.
    """

    def __init__(self, settings: SupplyEmulation) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "bender_hil.emulator"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            **own_group(),
        )
        try:
            place = self._told(settings)
        except BaseException:
            self.close()
            raise
        self.resource: str = place["resource"]
        self.console: Channel = call(place["console"], place["password"])

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def fault(self, name: str, value: float | str = 1) -> None:
        """Switch a fault of `Faults`, or do "error", "ovp_trip", "drop_link".

        Raises:
            ValueError: there is no such fault.
        """
        answer = self.console.ask({"do": "fault", "name": name, "value": value})
        if "error" in answer:
            raise ValueError(answer["error"])

    def truth(self) -> Message:
        """What is really at the terminals."""
        return self.console.ask({"do": "truth"})

    def reset(self) -> None:
        """Take all faults away."""
        self.console.ask({"do": "reset"})

    def power_on(self) -> None:
        """As after the mains switch: output off, 0 V, no faults."""
        self.console.ask({"do": "power_on"})

    def close(self) -> None:
        """End the process."""
        process = self.process
        if hasattr(self, "console"):
            self.console.close()
        with contextlib.suppress(OSError):
            if process.stdin is not None:
                process.stdin.close()
        try:
            process.wait(timeout=5.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if process.stdout is not None:
            process.stdout.close()

    def _told(self, settings: SupplyEmulation) -> Message:
        stdin, stdout = self.process.stdin, self.process.stdout
        if stdin is None or stdout is None:
            raise RunError("the emulated supply has no pipes")
        stdin.write(settings.to_json() + "\n")
        stdin.flush()
        line = stdout.readline()
        if not line:
            raise RunError("the emulated supply did not start; its complaint stands above")
        place = json.loads(line)
        if "failed" in place:
            raise (InputError if place["status"] == 2 else RunError)(place["failed"])
        return place
