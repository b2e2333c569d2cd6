"""An amplifier between a source and the actuator."""

from dataclasses import dataclass

from bender_loop.bounds import ANY, check_numbers

POLARITIES = ("positive", "inverting")


@dataclass(frozen=True, slots=True)
class Amplifier:
    """The table `[amplifier]`: all voltages elsewhere in a bench file, and in records, are those of its output.

    Attributes:
        gain: output volts per input volt, by its size.
        polarity: "positive", or "inverting" where the output falls when the input rises.
        offset_V: what it gives with 0 V at its input; at most what the guard calls safe, as that is what stays there.
        slew_V_per_s: fastest change of its output; None where it is not known.
        lowest_V, highest_V: limits of its output.

    Raises:
        ValueError: a value is out of its range.
    """

    gain: float
    polarity: str = "positive"
    offset_V: float = 0.0
    slew_V_per_s: float | None = None
    lowest_V: float = -1000.0
    highest_V: float = 1000.0

    def __post_init__(self) -> None:
        bounds = {
            "gain": (1e-3, 1e4), "offset_V": (-30.0, 30.0), "slew_V_per_s": (1e-3, 1e9), "lowest_V": ANY,
            "highest_V": ANY,
        }  # fmt: skip
        check_numbers(self, bounds)
        if self.polarity not in POLARITIES:
            raise ValueError(f"polarity: found {self.polarity!r}, expected one of {', '.join(POLARITIES)}")
        if not self.lowest_V <= 0.0 < self.highest_V:
            raise ValueError(
                f"lowest_V, highest_V: found {self.lowest_V:g} and {self.highest_V:g}, expected 0 between them"
            )

    @property
    def factor(self) -> float:
        """Output volts per input volt, with its sign."""
        return -self.gain if self.polarity == "inverting" else self.gain

    def output_V(self, input_V: float) -> float:
        """What it gives for an input."""
        return self.factor * input_V + self.offset_V

    def input_V(self, output_V: float) -> float:
        """What it needs for an output."""
        return (output_V - self.offset_V) / self.factor
