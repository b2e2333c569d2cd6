"""What the emulated supply's process is told when it starts."""

import json
import math
from dataclasses import asdict, dataclass, field
from typing import Any

from bender_emulator.sensors.settings import SensorEmulation
from bender_emulator.terminals import TerminalSettings


@dataclass(frozen=True, slots=True)
class SupplyEmulation:
    """The emulated supply and the plant behind it.

    Attributes:
        fmu: path of the plant's FMU.
        board: path of the tip board, which the process makes.
        output: which output of the FMU the microscope sees; None for the one that FMI names or that is alone.
        parameters: values by FMI name.
        model: which supply it is.
        maximum_V: its highest voltage.
        maximum_A: its highest current limit.
        answer_end: what ends its answers.
        link: "tcp" or "pty".
        baud: of the pseudo-terminal.
        terminal_path: where the pseudo-terminal is to be found.
        port: of the socket at loopback; 0 takes a free one.
        step_s: of the plant.
        seed: of the noise.
        terminals: constants of the output.
        amplifier: between the instrument and the actuator: output volts per input volt with their sign, and the
            output with 0 V at its input; None for none.
        sensor: beside the microscope; None for none.

    Raises:
        ValueError: a value is out of its range.
    """

    fmu: str
    board: str
    output: str | None = None
    parameters: dict[str, float] = field(default_factory=dict)
    model: str = "9115"
    maximum_V: float = 80.0
    maximum_A: float = 60.0
    answer_end: str = "\n"
    link: str = "tcp"
    baud: int = 57600
    terminal_path: str = ""
    port: int = 0
    step_s: float = 0.001
    seed: int = 0
    terminals: TerminalSettings = field(default_factory=TerminalSettings)
    amplifier: tuple[float, float] | None = None
    sensor: SensorEmulation | None = None

    def __post_init__(self) -> None:
        if self.link not in ("tcp", "pty"):
            raise ValueError(f"link must be tcp or pty, found {self.link!r}")
        if not (math.isfinite(self.step_s) and 1e-4 <= self.step_s <= 0.01):
            raise ValueError(f"step_s must lie within 0.0001 and 0.01, found {self.step_s!r}")
        if self.link == "pty" and not self.terminal_path:
            raise ValueError("terminal_path must say where the pseudo-terminal is to be found, found nothing")

    def to_json(self) -> str:
        """One line that `from_json` reads."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, line: str) -> "SupplyEmulation":
        """What `to_json` wrote."""
        table: dict[str, Any] = json.loads(line)
        amplifier, sensor = table.pop("amplifier"), table.pop("sensor")
        return cls(
            **{**table, "terminals": TerminalSettings(**table["terminals"])},
            amplifier=None if amplifier is None else (amplifier[0], amplifier[1]),
            sensor=None if sensor is None else SensorEmulation(**sensor),
        )
