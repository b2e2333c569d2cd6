"""What a first model may consist of: lags and modes in series with a gain and a delay."""

from collections.abc import Sequence
from dataclasses import dataclass

from bender_plant.model import BlockSettings, Model
from bender_plant.parameter import ModelError

LAGS = ("time_constant_s", "second_time_constant_s")
"""Of the plant's own lags, where what acts on the input comes before them and what acts on the output behind."""
LEAST_DAMPING, MOST_DAMPING = 1e-4, 0.949
LONGEST_LAG_S, LONGEST_DELAY_S = 1e6, 1e4
LOWEST_Hz, HIGHEST_Hz = 1e-6, 1e6
LEAST_PERIODS = 2.0
"""Of a mode within the records: one that does not swing back twice is not told from a lag, a loop or a drift."""


@dataclass(frozen=True, slots=True)
class Structure:
    """A gain with so many lags and modes, and a delay or none.

    The numbers of a structure are, in this order: the time constants in s, longest first; frequency in Hz and damping
    ratio of each mode; the share of the second mode; the delay in s.
    """

    lags: int = 0
    modes: int = 0
    delay: bool = False

    @property
    def order(self) -> int:
        """The order of the differential equation, the delay apart."""
        return self.lags + 2 * self.modes

    @property
    def parts(self) -> int:
        """How many parts it has beside the gain: lags, modes, the delay."""
        return self.lags + self.modes + self.delay

    @property
    def name(self) -> str:
        """The structure in words: `gain+lag+mode+delay`."""
        parts = ["gain", *["lag"] * self.lags, *["mode"] * self.modes, *["delay"] * self.delay]
        return "+".join(parts)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of its numbers, with units."""
        lags = [f"time_constant_{k + 1}_s" if self.lags > 1 else "time_constant_s" for k in range(self.lags)]
        modes: list[str] = []
        for k in range(self.modes):
            mark = f"_{k + 1}" if self.modes > 1 else ""
            modes += [f"frequency{mark}_Hz", f"damping_ratio{mark}"]
        share = ["share_2"] if self.modes > 1 else []
        return (*lags, *modes, *share, *(["delay_s"] if self.delay else []))

    def with_delay(self) -> "Structure":
        """Return the same structure with a delay."""
        return Structure(self.lags, self.modes, delay=True)

    def model(self, values: Sequence[float], gain: float = 1.0, offset: float = 0.0, name: str = "first") -> Model:
        """Return the plant with these numbers.

        Args:
            values: one number for each of `names`.
            gain: static gain, in units of the reading per unit of the input.
            offset: constant of the reading.
            name: of the model.

        Raises:
            ModelError: a number is out of the bounds of its block.
        """
        if len(values) != len(self.names):
            raise ModelError(f"first model: found {len(values)} numbers, expected {len(self.names)}")
        left = list(values)
        table: list[tuple[str, dict[str, object]]] = [("linear_transduction", {"sensitivity_um_per_V": gain})]
        if self.lags:
            table.append(("plant_lag", {name: left.pop(0) for name in LAGS[: self.lags]}))
        if self.modes:
            frequency, damping = left.pop(0), left.pop(0)
            table.append(("bending_modes", {"first_frequency_Hz": frequency, "damping_ratio": damping}))
        if self.modes > 1:
            frequency, damping, share = left.pop(0), left.pop(0), left.pop(0)
            table.append(("second_mode", {"frequency_Hz": frequency, "damping_ratio": damping, "share": share}))
        if self.delay:
            table.append(("transport_delay", {"delay_s": left.pop(0)}))
        table.append(("calibration", {"offset_um": offset}))
        blocks = tuple(_block(block, parameters) for block, parameters in table)
        return Model(name, None, blocks, f"A first model from records: {self.name.replace('+', ' + ')}")


def _block(block: str, parameters: dict[str, object]) -> BlockSettings:
    from bender_plant.blocks import BLOCKS

    return BlockSettings(block, BLOCKS[block].parameters(**parameters))


STRUCTURES = (
    Structure(),
    Structure(lags=1),
    Structure(lags=2),
    Structure(modes=1),
    Structure(lags=1, modes=1),
    Structure(lags=2, modes=1),
    Structure(modes=2),
)
"""Every structure up to the fourth order, simple ones first; each is tried with a delay too."""
TEMPLATES = {"gain": Structure(), "gain+lag": Structure(lags=1), "gain+mode": Structure(modes=1)}
