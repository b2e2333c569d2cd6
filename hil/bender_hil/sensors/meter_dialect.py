"""Words of bench multimeters that read a DC voltage, one reading per trigger.

`DMM6500`: Keithley DMM6500 reference manual, SCPI command set (also DAQ6510, DMM7510).
`34465A`: Keysight Truevolt operating and service guide (34460A, 34461A, 34465A, 34470A; the aperture in seconds is
34465A and 34470A only, the others take `VOLT:NPLC`).
Both give 9.9E37 for an overload.
"""

from collections.abc import Mapping
from dataclasses import dataclass

OVERLOAD = 9e37


@dataclass(frozen=True, slots=True)
class MeterDialect:
    """Words with `{range_V}` and `{aperture_s}` where a number goes.

    Attributes:
        name: as `model` in the bench file has it.
        makers: beginnings of the manufacturer's name that `*IDN?` gives, in capitals.
        models: what the model's name that it gives holds, one of them.
        prepare: sent once after identification.
        aperture_setting: asks for the aperture in s, which is compared with what was set.
        read: triggers one reading and asks for it.
        errors: takes the oldest entry from the error queue.
    """

    name: str
    makers: tuple[str, ...]
    models: tuple[str, ...]
    prepare: tuple[str, ...]
    aperture_setting: str
    read: str = "READ?"
    errors: str = "SYST:ERR?"
    write_end: str = "\n"
    read_end: str = "\n"


METERS: Mapping[str, MeterDialect] = {
    entry.name: entry
    for entry in (
        MeterDialect(
            "DMM6500",
            ("KEITHLEY",),
            ("DMM6500", "DAQ6510", "DMM7510"),
            (
                "*RST", "*CLS", 'SENS:FUNC "VOLT:DC"', "SENS:VOLT:DC:RANG {range_V}",
                "SENS:VOLT:DC:APER {aperture_s}", "SENS:VOLT:DC:AZER OFF", "SENS:COUN 1",
            ),
            "SENS:VOLT:DC:APER?",
        ),
        MeterDialect(
            "34465A",
            ("KEYSIGHT", "AGILENT"),
            ("34465A", "34470A"),
            (
                "*RST", "*CLS", "CONF:VOLT:DC {range_V}", "VOLT:DC:APER {aperture_s}", "VOLT:DC:ZERO:AUTO OFF",
                "TRIG:SOUR IMM", "TRIG:DEL 0", "SAMP:COUN 1",
            ),
            "VOLT:DC:APER?",
        ),
    )
}  # fmt: skip
"""Every multimeter that `model` may name."""
