"""What channels beside the readings tell of an effect: a voltage that was read back, a current, a temperature."""

from dataclasses import dataclass
from typing import Literal

Side = Literal["", "below", "above"]


@dataclass(frozen=True, slots=True)
class Witnessed:
    """How other channels show an effect, or bound its first number.

    Attributes:
        before_terminals: nothing behind the supply's terminals does the same.
        before_electrodes: nothing behind the electrodes does the same.
        excludes: on which side of a bound a voltage that follows the command excludes the number; "" where it
            excludes none.
        bound: what is excluded there, in words.
        by_current: a current that stays at its limit shows it as well.
        by_temperature: it follows the temperature, and is no effect of the supply.
    """

    before_terminals: bool = False
    before_electrodes: bool = False
    excludes: Side = ""
    bound: str = ""
    by_current: bool = False
    by_temperature: bool = False

    def __post_init__(self) -> None:
        if (self.excludes == "") != (self.bound == ""):
            raise ValueError(f"witnessed: found excludes={self.excludes!r} and bound={self.bound!r}, expected both")
        if self.before_terminals and not self.before_electrodes:
            raise ValueError("witnessed: found before_terminals alone, expected before_electrodes as well")

    @property
    def by_voltage(self) -> bool:
        """Whether a voltage that is read back can show it."""
        return not self.by_temperature
