"""Dialects: the words for each thing that is asked of a supply.

A None is a thing that a dialect cannot say, or for which no manual was found; the driver leaves it out and says so.
Without the level, the switch of the output and who is there, nothing can be guarded: these are needed.

`bk_9115`: programming manual of the 9115 (also 9116, 9117) and chapter 5 of the 9200 series' manual, which share
their roots. In it `VOLT:LIM` is the LOWER bound of the output and `VOLT:RANG` the upper one, whatever the names
suggest: who sends `VOLT:LIM 50` to allow 50 V at most forbids everything below.

`bk_xln`: XLN series, a mixture of SCPI and short forms of its own (manual of the XLN series and published examples).
Its USB port is a serial bridge that is fed by the computer: it opens with the supply switched off, so an answer to
`*IDN?` is the only sign of life.
"""

from dataclasses import dataclass, fields

NEEDED = (
    "write_end", "read_end", "prepare", "set_voltage", "voltage_setting", "output_on", "output_off", "output_state",
    "identify",
)  # fmt: skip
"""Words that every supply has."""


@dataclass(frozen=True, slots=True)
class Dialect:
    """Words with `{}` where a number goes.

    Attributes:
        name: for messages.
        write_end: what ends a command.
        read_end: what ends an answer.
        prepare: sent once after identification, before anything is set.
        set_voltage, voltage_setting, measure_voltage: level in V.
        set_current, current_setting, measure_current: limit and reading in A.
        output_on, output_off, output_state: the output's switch.
        errors: takes the oldest entry from the error queue.
        set_upper_bound, upper_bound: highest voltage that may be set.
        set_protection, protection_setting: level of the overvoltage protection in V.
        protection_on, protection_state: its switch.
        protection_tripped: whether it has tripped.
        release: gives the front panel back.

    Raises:
        ValueError: a word is empty, or one that is needed is None; what else a supply does not have is None.
    """

    name: str
    write_end: str
    read_end: str
    prepare: tuple[str, ...]
    set_voltage: str
    voltage_setting: str
    measure_voltage: str | None
    set_current: str | None
    current_setting: str | None
    measure_current: str | None
    output_on: str
    output_off: str
    output_state: str
    errors: str | None
    set_upper_bound: str | None = None
    upper_bound: str | None = None
    set_protection: str | None = None
    protection_setting: str | None = None
    protection_on: str | None = None
    protection_state: str | None = None
    protection_tripped: str | None = None
    release: str | None = None
    identify: str = "*IDN?"

    def __post_init__(self) -> None:
        for field in fields(self):
            words = getattr(self, field.name)
            if words is None and field.name in NEEDED:
                needed = "()" if field.name == "prepare" else "a text: no supply can be guarded without it"
                raise ValueError(f"dialect {self.name}: {field.name}: found None, expected {needed}")
            if any(not x for x in (words if isinstance(words, tuple) else (words,)) if x is not None):
                left_out = "()" if field.name == "prepare" else "None, where the supply has no such command"
                raise ValueError(f"dialect {self.name}: {field.name}: found an empty command, expected {left_out}")


BK_9115 = Dialect(
    name="bk_9115",
    write_end="\n",
    read_end="\n",
    prepare=("*CLS", "SYST:REM"),
    set_voltage="VOLT {}",
    voltage_setting="VOLT?",
    measure_voltage="MEAS:VOLT?",
    set_current="CURR {}",
    current_setting="CURR?",
    measure_current="MEAS:CURR?",
    output_on="OUTP ON",
    output_off="OUTP OFF",
    output_state="OUTP?",
    errors="SYST:ERR?",
    set_upper_bound="VOLT:RANG {}",
    upper_bound="VOLT:RANG?",
    set_protection="VOLT:PROT {}",
    protection_setting="VOLT:PROT?",
    protection_on="VOLT:PROT:STAT ON",
    protection_state="VOLT:PROT:STAT?",
    protection_tripped="VOLT:PROT:TRIG?",
    release="SYST:LOC",
)

BK_XLN = Dialect(
    name="bk_xln",
    write_end="\r\n",
    read_end="\r\n",
    prepare=("*CLS",),
    set_voltage="SOUR:VOLT {}",
    voltage_setting="SOUR:VOLT?",
    measure_voltage="VOUT?",
    set_current="SOUR:CURR {}",
    current_setting="SOUR:CURR?",
    measure_current="IOUT?",
    output_on="OUTP ON",
    output_off="OUTP OFF",
    output_state="OUTP?",
    errors="ERR?",
    set_protection="OVSET {}",
    protection_setting="OVSET?",
    release="SYST:LOC",
)
