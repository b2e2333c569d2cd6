"""The words of function generators and piezo controllers: one table. A row is a dialect, not a driver.

Sources of the words: Agilent 33220A/33250A/33500 and Keysight 33600 user's guides (`APPL`, `VOLT:OFFS`); Siglent SDG
series programming guide (`BSWV`, `OUTP`; its answers repeat the question); Thorlabs MDT693B/MDT694B operating manual
(lines end in CR, every command is answered by the prompt `*`, or `!` where it was not understood); PI General Command
Set, as E-709, E-625, E-665 and E-727 speak it (`SVA`, `VOL?`, `ERR?`).

What has no switch of its output is off at 0 V: it is told so, and its setting read back.
"""

from collections.abc import Mapping
from dataclasses import dataclass

NUMBER = r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*"
IDN = r"([^,]+),([^,]+),([^,]+),([^,]+)"


@dataclass(frozen=True, slots=True)
class LineDialect:
    """One instrument: words with `{}` where a number goes, `{axis}` where the channel goes, and what answers look like.

    Attributes:
        name: as `model` in the bench file has it.
        lowest_V, highest_V: of its output.
        decimals: of a voltage that is set.
        makers: beginnings of the manufacturer's name, in capitals.
        models: what the model's name may begin with, in capitals.
        identify: asks who is there.
        identity: matches the answer, or one of its lines; groups: maker, model, serial number, firmware.
        identity_lines: most lines of that answer.
        write_end, read_end: what ends a command and an answer.
        baud: of its serial port as delivered.
        axis: its channel unless the bench file names another.
        prepare: sent once after identification.
        set_voltage, voltage_setting, setting: sets the level in V, asks for it, matches the answer; the group is it.
            `voltage_setting` is None where it cannot be asked.
        armed: what the answer to `voltage_setting` has to match once it was prepared.
        limit, limit_answer: asks for the highest voltage that a switch at its back allows; None where there is none.
        serial, serial_answer: asks for its serial number where `identify` does not give it.
        measure_voltage, measured: asks for what is at the output and matches the answer; None where it cannot measure.
        output_on, output_off, output_state, is_on: the switch, and what matches the answer when it is on; None where
            there is none.
        errors, no_error: takes an entry from the error queue; what matches when there is none.
        refusal: what in an answer, or the prompt before it, says that a command was not taken.
        off_below_V: what is read back below this is 0 V, where there is no switch.
        release: gives the front panel back.
        cannot: what it cannot do, a sentence each.
    """

    name: str
    lowest_V: float
    highest_V: float
    decimals: int
    makers: tuple[str, ...]
    models: tuple[str, ...]
    prepare: tuple[str, ...]
    set_voltage: str
    voltage_setting: str | None
    setting: str = NUMBER
    armed: str = ".*"
    identify: str = "*IDN?"
    identity: str = IDN
    identity_lines: int = 1
    write_end: str = "\n"
    read_end: str = "\n"
    baud: int = 9600
    axis: str = "1"
    limit: str | None = None
    limit_answer: str = NUMBER
    serial: str | None = None
    serial_answer: str = r"\s*(\S+)\s*"
    measure_voltage: str | None = None
    measured: str = NUMBER
    output_on: str | None = None
    output_off: str | None = None
    output_state: str | None = None
    is_on: str = r"\s*(1|ON)\s*"
    errors: str | None = None
    no_error: str = r"\s*\+?0\b.*"
    refusal: str | None = None
    off_below_V: float = 0.01
    release: str | None = None
    cannot: tuple[str, ...] = ()


_GENERATOR = ("a function generator has no current limit and no overvoltage protection, and measures nothing",)

_AGILENT = LineDialect(
    name="33500",
    lowest_V=-10.0,
    highest_V=10.0,
    decimals=4,
    makers=("AGILENT", "KEYSIGHT", "HEWLETT"),
    models=("33",),
    prepare=("*CLS", "OUTP OFF", "OUTP:LOAD INF", "APPL:DC DEF,DEF,0.0000"),
    set_voltage="VOLT:OFFS {}",
    voltage_setting="VOLT:OFFS?",
    output_on="OUTP ON",
    output_off="OUTP OFF",
    output_state="OUTP?",
    errors="SYST:ERR?",
    release="SYST:LOC",
    cannot=_GENERATOR,
)

_SIGLENT = LineDialect(
    name="SDG",
    lowest_V=-10.0,
    highest_V=10.0,
    decimals=4,
    makers=("SIGLENT",),
    models=("SDG",),
    prepare=("*CLS", "C{axis}:OUTP OFF", "C{axis}:OUTP LOAD,HZ", "C{axis}:BSWV WVTP,DC", "C{axis}:BSWV OFST,0"),
    set_voltage="C{axis}:BSWV OFST,{}",
    voltage_setting="C{axis}:BSWV?",
    setting=r"C\d:BSWV .*\bOFST,([-+.\deE]+)V?\b.*",
    armed=r"C\d:BSWV WVTP,DC\b.*",
    output_on="C{axis}:OUTP ON",
    output_off="C{axis}:OUTP OFF",
    output_state="C{axis}:OUTP?",
    is_on=r"C\d:OUTP ON\b.*",
    cannot=(*_GENERATOR, "an SDG has no error queue that could be asked: its setting is read back instead"),
)

_NO_SWITCH = "it has no switch of its output: off is 0 V, read back"

_PROMPT = r"[*>!\s]*"

_THORLABS = LineDialect(
    name="MDT693B",
    lowest_V=0.0,
    highest_V=150.0,
    decimals=3,
    makers=("",),
    models=("MDT693B", "MDT694B"),
    prepare=("echo=0", "{axis}voltage=0"),
    set_voltage="{axis}voltage={}",
    # `xvoltage?` gives what is measured at the output, to 0.1 V, and not what was set
    voltage_setting=None,
    measure_voltage="{axis}voltage?",
    measured=rf"{_PROMPT}\[?{NUMBER}\]?\s*",
    limit="vlimit?",
    limit_answer=rf"{_PROMPT}\[?{NUMBER}\]?\s*",
    serial="serial?",
    serial_answer=rf"{_PROMPT}(\S+)\s*",
    identify="id?",
    identity=rf"{_PROMPT}()Model\s+(\S+).*()()",
    identity_lines=12,
    write_end="\r",
    read_end="\r",
    baud=115200,
    axis="x",
    refusal="!",
    off_below_V=0.5,
    cannot=(
        _NO_SWITCH,
        "it has no current limit and no overvoltage protection that could be set",
        "its setting cannot be read back: what it measures is held against the command instead",
    ),
)

_PI = LineDialect(
    name="GCS",
    lowest_V=-30.0,
    highest_V=135.0,
    decimals=4,
    makers=("(C)", "PHYSIK INSTRUMENTE"),
    models=("E-",),
    prepare=("SVO {axis} 0", "SVA {axis} 0"),
    set_voltage="SVA {axis} {}",
    voltage_setting="SVA? {axis}",
    setting=rf"\w+={NUMBER}",
    measure_voltage="VOL? {axis}",
    measured=rf"\w+={NUMBER}",
    baud=115200,
    errors="ERR?",
    no_error=r"\s*0\s*",
    cannot=(_NO_SWITCH, "it has no current limit and no overvoltage protection that could be set"),
)

LINE_DIALECTS: Mapping[str, LineDialect] = {entry.name: entry for entry in (_AGILENT, _SIGLENT, _THORLABS, _PI)}
"""Every generator and controller that `model` may name."""
