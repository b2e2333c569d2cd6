"""What each model can do: one table.

Voltage and current are those in the model's data sheet; the number of decimals is what its set command takes. The
driver reads back every setting, so a wrong entry shows itself before the output is switched on.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from bender_hil.supply.dialect import BK_9115, BK_XLN, Dialect


@dataclass(frozen=True, slots=True)
class Capability:
    """One model.

    Attributes:
        model: as `*IDN?` gives it.
        maximum_V: highest output voltage.
        maximum_A: highest current limit.
        dialect: its words.
        decimals: of a voltage that is set.
        current_decimals: of a current that is set.
        baud: of its serial port as delivered.
        makers: beginnings of the manufacturer's name that `*IDN?` may give, in capitals; none for any.
    """

    model: str
    maximum_V: float
    maximum_A: float
    dialect: Dialect
    decimals: int = 3
    current_decimals: int = 3
    baud: int = 9600
    makers: tuple[str, ...] = ()

    def is_answered_by(self, manufacturer: str, model: str) -> bool:
        """Whether a device that gives these names is one of this model."""
        by_its_maker = not self.makers or manufacturer.upper().startswith(self.makers)
        return model == self.model and by_its_maker

    @property
    def resolution_V(self) -> float:
        """Smallest step of a setting."""
        return 10.0**-self.decimals

    @property
    def resolution_A(self) -> float:
        """Smallest step of a current limit."""
        return 10.0**-self.current_decimals


BK = ("B&K", "BK")

MODELS: Mapping[str, Capability] = {
    entry.model: entry
    for entry in (
        Capability("9115", 80.0, 60.0, BK_9115, makers=BK),
        Capability("9116", 150.0, 30.0, BK_9115, makers=BK),
        Capability("9201", 60.0, 10.0, BK_9115, makers=BK),
        Capability("9202", 60.0, 15.0, BK_9115, makers=BK),
        Capability("9205", 60.0, 25.0, BK_9115, makers=BK),
        Capability("9206", 150.0, 10.0, BK_9115, makers=BK),
        Capability("XLN6024", 60.0, 24.0, BK_XLN, baud=57600, makers=BK),
        Capability("XLN8018", 80.0, 18.0, BK_XLN, baud=57600, makers=BK),
        Capability("XLN10014", 100.0, 14.4, BK_XLN, baud=57600, makers=BK),
        Capability("XLN15010", 150.0, 10.0, BK_XLN, baud=57600, makers=BK),
        Capability("XLN30052", 300.0, 5.2, BK_XLN, baud=57600, makers=BK),
        Capability("XLN60026", 600.0, 2.6, BK_XLN, baud=57600, makers=BK),
    )
}
"""Every supply that `model` in a bench file may name."""
