"""What the guard holds the run to."""

import json
import math
from dataclasses import asdict, dataclass, field
from typing import Any

from bender_hil.sources.amplifier import Amplifier
from bender_hil.sources.kinds import SourceSettings, kind_of, make_source, source_class
from bender_hil.supply.parse import Identity
from bender_hil.supply.source import USUAL_PROTECTION_V, Bounds, Source

_MOST = {
    "maximum_V": 1000.0, "protection_V": 1500.0, "current_limit_A": 10.0, "current_trip_A": 10.0,
    "slew_V_per_s": 1e6, "burst_s": 1.0, "ramp_V_per_s": 1e6, "heartbeat_s": 5.0, "frame_age_s": 5.0,
    "lost_frames": 100, "band_V": 50.0, "settle_s": 5.0, "safe_V": 30.0, "shutdown_limit_s": 60.0,
    "discharge_limit_s": 600.0,
}  # fmt: skip
"""Larger limits guard nothing: no supply of the table goes beyond 600 V, no loop is silent for minutes."""
_FARTHEST_UM = 1e5


@dataclass(frozen=True, slots=True)
class GuardSettings:
    """Limits of a run; the defaults suit the actuator of the paper.

    Attributes:
        maximum_V: commands are clamped to `minimum_V` ... this.
        minimum_V: 0, or below with a source of both polarities.
        protection_V: level of the supply's own overvoltage protection.
        current_limit_A: limit set at the supply: the first bound of what a fault can do.
        current_trip_A: a measured current above this for longer than `settle_s` ends the run.
        slew_V_per_s: fastest change during a run, both ways.
        burst_s: a single change is at most slew times this.
        ramp_V_per_s: how fast the way down is.
        heartbeat_s: longest silence of the controller.
        frame_age_s: oldest frame that a command may rest on.
        lost_frames: so many frames in a row may be without a tip.
        travel_um: the tip stays between these.
        band_V: a measured voltage may be so far from what was set within `settle_s`.
        settle_s: how long the output may take to follow.
        safe_V: below this the output is harmless.
        shutdown_limit_s: the way down, with all its attempts, is given up after this.
        discharge_limit_s: how long the output may take to fall below `safe_V` once it is off.

    Raises:
        ValueError: a value is out of its range.
    """

    maximum_V: float = 50.0
    minimum_V: float = 0.0
    protection_V: float = USUAL_PROTECTION_V
    current_limit_A: float = 0.01
    current_trip_A: float = 0.008
    slew_V_per_s: float = 250.0
    burst_s: float = 0.05
    ramp_V_per_s: float = 500.0
    heartbeat_s: float = 0.1
    frame_age_s: float = 0.11
    lost_frames: int = 2
    travel_um: tuple[float, float] = (-10.0, 45.0)
    band_V: float = 1.0
    settle_s: float = 0.25
    safe_V: float = 1.0
    shutdown_limit_s: float = 6.0
    discharge_limit_s: float = 10.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "travel_um", tuple(self.travel_um))
        for name in (
            "slew_V_per_s", "burst_s", "ramp_V_per_s", "heartbeat_s", "frame_age_s", "band_V", "settle_s", "safe_V",
            "shutdown_limit_s", "discharge_limit_s", "current_trip_A",
        ):  # fmt: skip
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be a finite number > 0, found {value!r}")
        for name, most in _MOST.items():
            if getattr(self, name) > most:
                raise ValueError(f"{name} must be at most {most:g}, found {getattr(self, name)!r}")
        if self.lost_frames < 0:
            raise ValueError(f"lost_frames must be >= 0, found {self.lost_frames!r}")
        if len(self.travel_um) != 2 or not self.travel_um[0] < self.travel_um[1]:
            raise ValueError(f"travel_um must be two numbers in order, found {self.travel_um!r}")
        if max(map(abs, self.travel_um)) > _FARTHEST_UM:
            raise ValueError(f"travel_um must lie within +-{_FARTHEST_UM:g}, found {self.travel_um!r}")
        self.bounds()

    def bounds(self) -> Bounds:
        """What the supply is told to keep to."""
        return Bounds(self.maximum_V, self.protection_V, self.current_limit_A, self.minimum_V)


@dataclass(frozen=True, slots=True)
class GuardOrders:
    """Everything that a guard is told when it starts.

    Attributes:
        source: which instrument.
        limits: what to hold the run to.
        journal: where its journal goes.
        port: where the controller listens.
        password: what the controller wants to hear.
        realtime: whether it runs before every ordinary process.
        make_safe: whether it does nothing but switch off.
        stop_token: what a datagram has to hold that brings the output down; "" for no ear.
        identity: what the instrument of the run said of itself, for a guard that comes after another one.
        amplifier: behind the source; None for none.
        watch_port: where the watchman listens; None for none.
        watch_password: what the watchman wants to hear.
    """

    source: SourceSettings
    journal: str
    limits: GuardSettings = field(default_factory=GuardSettings)
    port: int | None = None
    password: str = ""
    realtime: bool = False
    make_safe: bool = False
    stop_token: str = ""
    identity: Identity | None = None
    amplifier: Amplifier | None = None
    watch_port: int | None = None
    watch_password: str = ""

    def make_source(self) -> Source:
        """Return the source with its amplifier, not open yet."""
        return make_source(self.source, self.amplifier, self.identity)

    def to_json(self) -> str:
        """One line that `from_json` reads."""
        return json.dumps({**asdict(self), "kind": kind_of(self.source)})

    @classmethod
    def from_json(cls, line: str) -> "GuardOrders":
        """What `to_json` wrote."""
        table: dict[str, Any] = json.loads(line)
        source, limits = source_class(table.pop("kind"))(**table.pop("source")), GuardSettings(**table.pop("limits"))
        identity, amplifier = table.pop("identity"), table.pop("amplifier")
        return cls(
            source=source,
            limits=limits,
            identity=None if identity is None else Identity(*identity),
            amplifier=None if amplifier is None else Amplifier(**amplifier),
            **table,
        )
