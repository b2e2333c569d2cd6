"""Starting and ending the emulated supply's process."""

import contextlib
import json
import math
import subprocess
import sys
import time

from bender_emulator.settings import SupplyEmulation
from bender_loop.errors import InputError, RunError
from bender_loop.shell.closed_at_exit import ClosedAtExit
from bender_loop.shell.messages import Channel, Message, call
from bender_loop.shell.process_group import own_group

_LEAVE_S = 10.0
_QUIET_S = 0.3
"""Nobody who has just been dropped waits longer before coming again."""


class EmulatedSupply(ClosedAtExit):
    """The process of an emulated supply.

    Args:
        settings: what it is told.

    Attributes:
        resource: its VISA address.
        port: of its socket; 0 for a serial line.
        sensor_resource: that of the sensor beside the microscope; None where there is none.
        console: a channel to its fault console.

    Raises:
        InputError: the FMU is not one that it can drive.
        RunError: the process does not start.
    """

    def __init__(self, settings: SupplyEmulation) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "bender_emulator"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            **own_group(),
        )
        try:
            place = self._place(settings)
        except BaseException:
            self.close()
            raise
        self.resource: str = place["resource"]
        self.port: int = place.get("port", 0)
        self.sensor_resource: str | None = place.get("sensor")
        self.console: Channel = call(place["console"], place["password"])

    def fault(self, name: str, value: float | str = 1) -> None:
        """Switch a fault of `Faults`, or do one of the console's own.

        Those are "error", "ovp_trip", "drop_link", "panel_off", "panel_V" and "mains_dip".

        Raises:
            ValueError: there is no such fault.
        """
        answer = self.console.ask({"do": "fault", "name": name, "value": value})
        if "error" in answer:
            raise ValueError(answer["error"])

    def sensor_fault(self, name: str, value: float | str = 1) -> None:
        """Switch a fault of the sensor beside the microscope, or "drop_link".

        Raises:
            ValueError: there is no such fault, or no such sensor.
        """
        answer = self.console.ask({"do": "sensor_fault", "name": name, "value": value})
        if "error" in answer:
            raise ValueError(answer["error"])

    def mend_sensor(self) -> None:
        """Take all faults of the sensor away, with nobody connected; RunError when somebody does not go."""
        end_s = time.perf_counter() + _LEAVE_S
        while self.console.ask({"do": "sensor_reset"}).get("is_busy"):
            if time.perf_counter() > end_s:
                raise RunError(f"somebody is connected to the emulated sensor for more than {_LEAVE_S:g} s")
            time.sleep(0.01)

    def truth(self) -> Message:
        """What is really at the terminals."""
        return self.console.ask({"do": "truth"})

    def reset(self) -> None:
        """Take all faults away."""
        self.console.ask({"do": "reset"})

    def power_on(self) -> None:
        """As after the mains switch: output off, 0 V, no faults."""
        self.console.ask({"do": "power_on"})

    def make_ready(self) -> None:
        """As after the mains switch, with nobody connected; RunError when somebody does not go.

        Who was connected may come again at once, so that nobody may have been there for some time.
        """
        self.power_on()
        busy_s = time.perf_counter() if self.truth()["is_busy"] else -math.inf
        self.fault("drop_link")
        end_s = time.perf_counter() + _LEAVE_S
        while (now_s := time.perf_counter()) < busy_s + _QUIET_S:
            if now_s > end_s:
                raise RunError(f"somebody is connected to the emulated supply for more than {_LEAVE_S:g} s")
            time.sleep(0.01)
            busy_s = now_s if self.truth()["is_busy"] else busy_s
        # who was connected may have said something since
        self.power_on()

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

    def _place(self, settings: SupplyEmulation) -> Message:
        stdin, stdout = self.process.stdin, self.process.stdout
        if stdin is None or stdout is None:
            raise RunError("the emulated supply has no pipes")
        stdin.write(settings.to_json() + "\n")
        stdin.flush()
        line = stdout.readline()
        if not line:
            raise RunError("the emulated supply did not start; see its message above")
        place = json.loads(line)
        if "failed" in place:
            raise (InputError if place["status"] == 2 else RunError)(place["failed"])
        return place
