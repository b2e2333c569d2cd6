"""The fault console: how a test or a benchmark reaches behind the emulated supply's wire.

One line of JSON in, one out, over loopback. It shows the truth that no instrument shows (what is really at the
terminals, when the output went off) and switches faults; nothing of the bench itself uses it.
"""

import contextlib
import threading
from collections.abc import Callable
from typing import Any

from bender_emulator.faults import FOR_EVER, Faults
from bender_emulator.instrument import Instrument
from bender_emulator.physics import Physics
from bender_emulator.sensors.transducer import Transducer
from bender_loop.shell.messages import Channel, ClosedError, Listener, Message

_ACCEPT_S = 3600.0


class Console:
    """Listens, and serves each caller in a thread.

    Args:
        instrument: whose faults are switched.
        physics: whose truth is told.
        drop: breaks the supply's connection.
        is_busy: whether somebody is connected to it.
    """

    def __init__(
        self, instrument: Instrument, physics: Physics, drop: Callable[[], None], is_busy: Callable[[], bool]
    ) -> None:
        self._instrument, self._physics, self._drop, self._is_busy = instrument, physics, drop, is_busy
        self._listener = Listener()
        self.port, self.password = self._listener.port, self._listener.password
        self._actions: dict[str, Callable[[Message], Message]] = {
            "fault": self._fault,
            "truth": self._truth,
            "arrivals": self._arrivals,
            "reset": self._reset,
            "power_on": self._power_on,
        }
        threading.Thread(target=self._accept, daemon=True).start()

    def add_sensor(self, transducer: Transducer, drop: Callable[[], None], is_busy: Callable[[], bool]) -> None:
        """Let the sensor beside the microscope have faults too: "sensor_fault", and "drop_link" of its own wire."""

        def fault(message: Message) -> Message:
            name, value = str(message["name"]), message.get("value", 1)
            if name == "drop_link":
                drop()
                return {"ok": True}
            with transducer.lock:
                transducer.faults = transducer.faults.with_fault(name, FOR_EVER if value == "for ever" else value)
            return {"ok": True}

        def reset(_: Message) -> Message:
            with transducer.lock:
                transducer.faults = Faults()
            drop()
            return {"is_busy": is_busy()}

        self._actions |= {"sensor_fault": fault, "sensor_reset": reset}

    def close(self) -> None:
        """Listen no more."""
        self._listener.close()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                with contextlib.suppress(ClosedError):
                    channel = self._listener.accept(_ACCEPT_S)
                    threading.Thread(target=self._serve, args=(channel,), daemon=True).start()

    def _serve(self, channel: Channel) -> None:
        with contextlib.suppress(ClosedError):
            while True:
                message = channel.receive(_ACCEPT_S)
                if message is not None:
                    channel.send(self._answer(message))

    def _answer(self, message: Message) -> Message:
        action = self._actions.get(str(message.get("do")))
        if action is None:
            return {"error": f"expected one of {', '.join(self._actions)}, found {message.get('do')!r}"}
        try:
            return action(message)
        except (KeyError, TypeError, ValueError) as error:
            return {"error": str(error)}

    def _fault(self, message: Message) -> Message:
        name, value = str(message["name"]), message.get("value", 1)
        instrument = self._instrument
        with instrument.lock:
            if name == "error":
                instrument.complain(int(value))
            elif name == "ovp_trip":
                instrument.trip()
            elif name == "drop_link":
                self._drop()
            elif name == "panel_off":
                instrument.turn_panel("off", 0.0)
            elif name == "panel_V":
                instrument.turn_panel("level", float(value))
            elif name == "mains_dip":
                instrument.power_on()
                self._drop()
            else:
                amount = FOR_EVER if value == "for ever" else value
                instrument.faults = instrument.faults.with_fault(name, amount)
        return {"ok": True}

    def _truth(self, _: Message) -> Message:
        instrument, physics = self._instrument, self._physics
        with instrument.lock:
            truth: dict[str, Any] = {
                "is_on": instrument.is_on,
                "target_V": instrument.target_V,
                "output_V": instrument.output_V,
                "switched_off_s": instrument.switched_off_s,
                "is_remote": instrument.is_remote,
                "limit_A": instrument.limit_A,
                "upper_V": instrument.upper_V,
                "protection_V": instrument.protection_V,
                "protection_on": instrument.protection_on,
                "tip_um": physics.tip_um,
                "is_busy": self._is_busy(),
                "latest_s": physics.latest_s,
                "failure": None if physics.failure is None else str(physics.failure),
            }
        return truth

    def _arrivals(self, _: Message) -> Message:
        with self._instrument.lock:
            return {"arrivals": list(self._instrument.arrivals)}

    def _reset(self, _: Message) -> Message:
        """Faults gone, errors gone, the output left as it is."""
        with self._instrument.lock:
            self._instrument.faults = Faults()
            self._instrument.errors.clear()
            self._instrument.tripped = False
        return {"ok": True}

    def _power_on(self, _: Message) -> Message:
        """As after the mains switch: output off, 0 V, no faults."""
        self._instrument.power_on()
        return {"ok": True}
