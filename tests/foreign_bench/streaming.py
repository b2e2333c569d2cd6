# pyright: basic, reportOptionalMemberAccess=false
"""A laser head, as a laboratory would write it: it streams frames of 10 bytes, the height in nanometres."""

import socket
import struct
import time
from dataclasses import dataclass

from bender_hil.sensors.sensor import Reading
from bender_hil.supply.parse import Identity

AVERAGED_S = 0.002
FRAME = struct.Struct(">HHiBB")
LOST = {1: "out of range", 2: "no light"}


@dataclass(frozen=True, slots=True)
class LaserHead:
    host: str
    port: int = 6201

    def make(self, rate_Hz):
        return LaserSensor(self.host, self.port, rate_Hz)


class LaserSensor:
    unit, cannot = "nm", ()

    def __init__(self, host, port, rate_Hz):
        self.address, self.rate_Hz = (host, port), rate_Hz
        self.link, self.waiting = None, b""

    def open(self):
        self.link, self.waiting = socket.create_connection(self.address, timeout=1.0), b""
        self.link.sendall(b"I")
        model, _, serial = self.link.recv(16, socket.MSG_WAITALL).decode().strip().partition(" ser ")
        self.link.sendall(b"R" + struct.pack(">H", round(self.rate_Hz)))
        return Identity("Lasertron", model.strip(), serial, "1")

    def read(self, timeout_s):
        self.link.settimeout(timeout_s)
        while len(self.waiting) < FRAME.size:
            try:
                came = self.link.recv(4096)
            except TimeoutError:
                return None
            if not came:
                raise ConnectionError("the laser head closed the link")
            self.waiting += came
        came_s, whole = time.perf_counter(), len(self.waiting) // FRAME.size
        frame, self.waiting = self.waiting[(whole - 1) * FRAME.size :], self.waiting[whole * FRAME.size :]
        head, _, height_nm, status, check = FRAME.unpack(frame[: FRAME.size])
        if head != 0xAA55 or sum(frame[2:9]) & 255 != check:
            raise ValueError(f"found {frame.hex()} in place of a frame")
        return Reading(height_nm, came_s - AVERAGED_S / 2, LOST.get(status), whole - 1)

    def close(self):
        if self.link is not None:
            self.link.close()
