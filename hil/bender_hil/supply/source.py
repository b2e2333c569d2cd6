"""What the guard asks of whatever feeds the actuator."""

from dataclasses import dataclass
from typing import Protocol

from bender_hil.supply.parse import Identity
from bender_hil.supply.patience import Patience

USUAL_PROTECTION_V = 55.0


@dataclass(frozen=True, slots=True)
class Bounds:
    """What the instrument itself is told to keep to.

    Attributes:
        maximum_V: highest voltage that will be asked for.
        protection_V: level of the overvoltage protection.
        current_A: current limit.
        minimum_V: lowest voltage that will be asked for; below 0 only with a source of both polarities.

    Raises:
        ValueError: the levels are not in order or not positive.
    """

    maximum_V: float
    protection_V: float
    current_A: float
    minimum_V: float = 0.0

    def __post_init__(self) -> None:
        if not self.maximum_V > 0.0:
            raise ValueError(f"maximum_V must be > 0, found {self.maximum_V!r}")
        if not self.maximum_V < self.protection_V:
            raise ValueError(
                f"maximum_V is {self.maximum_V:g} V and protection_V {self.protection_V:g} V (its default is "
                f"{USUAL_PROTECTION_V:g}): set protection_V above maximum_V"
            )
        if not -self.protection_V < self.minimum_V <= 0.0:
            raise ValueError(f"minimum_V must lie above -protection_V and not above 0, found {self.minimum_V!r}")
        if not self.current_A > 0.0:
            raise ValueError(f"current_A must be > 0, found {self.current_A!r}")

    def check(self, lowest_V: float, highest_V: float, source: str) -> None:
        """Check that a source can give these voltages.

        Raises:
            ValueError: it cannot.
        """
        for name, found_V in (("maximum_V", self.maximum_V), ("minimum_V", self.minimum_V)):
            if not lowest_V <= found_V <= highest_V:
                raise ValueError(
                    f"{name} must lie within {lowest_V:g} ... {highest_V:g} V with {source}, found {found_V:g}; set it "
                    "under [guard], name the amplifier behind the source ([amplifier] gain), or take another source "
                    "(of an emulated bench: [emulator] supply)"
                )


class Source(Protocol):
    """A voltage source with a switch. Every method but `close` raises SupplyError.

    `blind` methods only write: they are for the way down, where waiting for an answer costs more than it tells.
    """

    @property
    def patience(self) -> Patience:
        """The deadline of every wait, and who is told of it."""
        ...

    @property
    def setting_tolerance_V(self) -> float:
        """How far a level that is read back may lie from the one that was sent."""
        ...

    def open(self) -> Identity:
        """Open the link and make sure that the right instrument is there."""
        ...

    def arm(self, bounds: Bounds) -> list[str]:
        """Output off, 0 V, bounds set and read back, output on; returns remarks on what could not be set."""
        ...

    def set_voltage(self, voltage_V: float) -> float:
        """Set the level and ask for complaints; returns `time.perf_counter` when the command was on the wire."""
        ...

    def set_voltage_blind(self, voltage_V: float) -> float:
        """Set the level without a question; returns when the command was on the wire."""
        ...

    def rounded(self, voltage_V: float) -> float:
        """The level that is really sent for `voltage_V`."""
        ...

    def voltage_setting_V(self) -> float:
        """The level as the instrument has it."""
        ...

    def measured_V(self) -> float | None:
        """What is at the terminals; None where the instrument cannot measure."""
        ...

    def measured_A(self) -> float | None:
        """What flows; None where the instrument cannot measure."""
        ...

    def is_on(self) -> bool:
        """Whether the output is switched on."""
        ...

    def confirm_off(self) -> bool:
        """Whether the output is off, asked in such a way that a late answer to an older question cannot say so."""
        ...

    def has_tripped(self) -> bool:
        """Whether the overvoltage protection has tripped; False where the instrument cannot tell."""
        ...

    def off_blind(self) -> None:
        """Switch the output off without a question."""
        ...

    def reconnect(self) -> None:
        """Close the link, open it again and ask nothing; only to make safe."""
        ...

    def resync(self) -> None:
        """After `reconnect`: nothing is owed from before, the right instrument answers, and it takes commands."""
        ...

    def release(self) -> None:
        """Give the front panel back."""
        ...

    def close(self) -> None:
        """Close the link; never raises."""
        ...
