# pyright: basic, reportOptionalMemberAccess=false
"""A LabAmp, as a laboratory would write it: `V 12.5` has no answer, `V?` says what is set and what is at the output."""

import socket
from dataclasses import dataclass

from bender_hil.supply.parse import Identity


@dataclass(frozen=True, slots=True)
class LabAmp:
    host: str
    port: int = 6200
    has_switch = False

    def make(self):
        return LabAmpSource(self.host, self.port)


class LabAmpSource:
    lowest_V, highest_V, step_V = -10.0, 110.0, 0.01
    cannot = ("it has no output switch", "it has no current limit")

    def __init__(self, host, port):
        self.address = host, port
        self.wire = None

    def say(self, line):
        self.wire.write(line + "\r")
        self.wire.flush()

    def ask(self, line):
        self.say(line)
        return self.wire.readline().strip()

    def open(self):
        with socket.create_connection(self.address, timeout=1.0) as link:
            self.wire = link.makefile("rw", newline="\r")
        return Identity(*self.ask("ID").split("/"))

    def switch(self, on):
        if not on:
            self.set_voltage(0.0)

    def is_on(self):
        return self.setting_V() != 0.0

    def set_voltage(self, voltage_V):
        self.say(f"V {voltage_V:.2f}")

    def setting_V(self):
        return float(self.ask("V?").split()[0])

    def measured_V(self):
        return float(self.ask("V?").split()[1])

    def close(self):
        if self.wire is not None:
            self.wire.close()
