"""A source with its amplifier, which the guard owns as one: every voltage it says and hears is the amplifier's output.

What is measured is the source's, at the amplifier's input, and multiplied: a broken amplifier does not show in it. The
sensor's answer to the command is what shows it.
"""

from collections.abc import Sequence

from bender_hil.sources.amplifier import Amplifier
from bender_hil.supply.parse import Identity
from bender_hil.supply.patience import Patience
from bender_hil.supply.played_source import can_play
from bender_hil.supply.source import Bounds, Source

_LEAST_INPUT_V = 1e-3


class Amplified:
    """A source behind an amplifier, itself behind the `Source` protocol.

    Args:
        source: not open yet.
        amplifier: behind it.
    """

    def __init__(self, source: Source, amplifier: Amplifier) -> None:
        self._source, self._amplifier = source, amplifier

    @property
    def patience(self) -> Patience:
        """The deadline of every wait."""
        return self._source.patience

    @property
    def setting_tolerance_V(self) -> float:
        """That of the source, times the gain."""
        return self._amplifier.gain * self._source.setting_tolerance_V

    def open(self) -> Identity:
        """Open the source."""
        return self._source.open()

    def arm(self, bounds: Bounds) -> list[str]:
        """Arm the source at the input that gives 0 V; returns remarks.

        Raises:
            ValueError: the amplifier or the source cannot do what the bounds ask for.
            SupplyError: as the source's.
        """
        amplifier = self._amplifier
        for name, found, least, most in (
            ("maximum_V", bounds.maximum_V, 0.0, amplifier.highest_V),
            ("minimum_V", bounds.minimum_V, amplifier.lowest_V, 0.0),
        ):
            if not least <= found <= most:
                raise ValueError(
                    f"{name} must lie within {least:g} ... {most:g} V with this amplifier, found {found!r}"
                )
        try:
            remarks = self._source.arm(self._input_bounds(bounds))
        except ValueError as error:
            raise ValueError(f"at the input of the amplifier, {error}") from error
        self._source.set_voltage(amplifier.input_V(0.0))
        if self._source.measured_V() is not None:
            remarks.append("what is measured is the amplifier's input, multiplied by its gain")
        return remarks

    def rounded(self, voltage_V: float) -> float:
        """The level that is really sent for `voltage_V`."""
        return self._amplifier.output_V(self._source.rounded(self._amplifier.input_V(voltage_V)))

    def set_voltage(self, voltage_V: float) -> float:
        """Set the level; returns when the command was on the wire."""
        return self._source.set_voltage(self._amplifier.input_V(voltage_V))

    def set_voltage_blind(self, voltage_V: float) -> float:
        """Set the level and ask nothing; returns when the command was on the wire."""
        return self._source.set_voltage_blind(self._amplifier.input_V(voltage_V))

    @property
    def has_buffer(self) -> bool:
        """Whether the source plays from a buffer of its own."""
        return can_play(self._source)

    def play(self, levels_V: Sequence[float], rate_Hz: float) -> float:
        """Let the source play what gives these levels at the output; returns when the first began."""
        if not can_play(self._source):
            raise ValueError("this source has no buffer")
        return self._source.play([self._amplifier.input_V(level_V) for level_V in levels_V], rate_Hz)

    def voltage_setting_V(self) -> float:
        """The level as the instrument has it."""
        return self._amplifier.output_V(self._source.voltage_setting_V())

    def measured_V(self) -> float | None:
        """What the source measures at the amplifier's input, times the gain; None where it cannot."""
        measured_V = self._source.measured_V()
        return None if measured_V is None else self._amplifier.output_V(measured_V)

    def measured_A(self) -> float | None:
        """None: what flows into the amplifier's input says nothing of its output."""

    def is_on(self) -> bool:
        """Whether the source's output is switched on."""
        return self._source.is_on()

    def confirm_off(self) -> bool:
        """Whether the source's output is off."""
        return self._source.confirm_off()

    def has_tripped(self) -> bool:
        """Whether the source's protection has tripped."""
        return self._source.has_tripped()

    def off_blind(self) -> None:
        """Switch the source's output off and ask nothing."""
        self._source.off_blind()

    def reconnect(self) -> None:
        """Open the link anew and ask nothing."""
        self._source.reconnect()

    def resync(self) -> None:
        """Make sure that the right instrument answers to what it is asked."""
        self._source.resync()

    def release(self) -> None:
        """Give the front panel back."""
        self._source.release()

    def close(self) -> None:
        """Close the link."""
        self._source.close()

    def _input_bounds(self, bounds: Bounds) -> Bounds:
        ends = [self._amplifier.input_V(end_V) for end_V in (bounds.minimum_V, bounds.maximum_V, 0.0)]
        low_V, high_V = min(*ends, 0.0), max(*ends, _LEAST_INPUT_V)
        protection_V = max(1.1 * high_V, -1.1 * low_V, bounds.protection_V / self._amplifier.gain)
        return Bounds(high_V, protection_V, bounds.current_A, low_V)
