"""Words of oscilloscopes that take one record per trigger, at once and whatever the signal.

`RedPitaya`: SCPI server of the STEMlab boards, OS 2.00 or newer (acquisition commands); its range is a jumper. The
samples after the trigger are those that a delay of `samples` less half the buffer leaves.
`DSOX`: Keysight InfiniiVision programmer's guide (1000 to 4000 X-series); the trigger is forced, its place is the first
of ten divisions.
"""

from collections.abc import Mapping
from dataclasses import dataclass

OVERLOAD = 9e37
"""What an oscilloscope gives in the place of a mean that it cannot measure."""
_BUFFER, _SAMPLE_HZ = 16384, 125e6
_FEWEST = 100
_DECIMATIONS = tuple(2**power for power in range(17))


@dataclass(frozen=True, slots=True)
class ScopeDialect:
    """Words with `{channel}`, `{range}`, `{aperture_s}` and what `numbers` gives where a number goes.

    Attributes:
        name: as `model` in the bench file has it.
        makers: beginnings of the manufacturer's name that `*IDN?` gives, in capitals.
        models: beginnings of the model's name that it gives.
        channels: how many inputs there are.
        ranges: words for each range by its largest voltage; empty where any is taken, as its full scale in V.
        longest_s: longest time that a record may cover.
        prepare: sent once after identification.
        trigger: starts one record.
        state: asks whether it is there.
        state_mask, state_done: the bits of the answer, and what they are when it is.
        read: asks for the mean, or for the samples.
        errors: takes the oldest entry from the error queue.
        begins: where the record begins, as a share of it before the trigger.
    """

    name: str
    makers: tuple[str, ...]
    models: tuple[str, ...]
    channels: int
    ranges: Mapping[float, str]
    longest_s: float
    prepare: tuple[str, ...]
    trigger: tuple[str, ...]
    state: str
    state_mask: int
    state_done: int
    read: str
    errors: str = "SYST:ERR?"
    begins: float = 0.0
    write_end: str = "\n"
    read_end: str = "\n"


def numbers(aperture_s: float) -> dict[str, str]:
    """Return decimation, samples and trigger delay of a board that samples at 125 MHz and decimates by powers of 2."""
    wanted = aperture_s * _SAMPLE_HZ / _FEWEST
    decimation = max((step for step in _DECIMATIONS if step <= wanted), default=1)
    samples = max(1, round(aperture_s * _SAMPLE_HZ / decimation))
    return {"decimation": str(decimation), "samples": str(samples), "delay": str(samples - _BUFFER // 2)}


SCOPES: Mapping[str, ScopeDialect] = {
    entry.name: entry
    for entry in (
        ScopeDialect(
            "RedPitaya",
            ("REDPITAYA",),
            ("INSTR",),
            4,
            {1.0: "LV", 20.0: "HV"},
            0.1,
            (
                "*CLS", "ACQ:RST", "ACQ:DEC {decimation}", "ACQ:AVG ON", "ACQ:DATA:FORMAT ASCII",
                "ACQ:DATA:UNITS VOLTS", "ACQ:SOUR{channel}:GAIN {range}", "ACQ:TRIG:DLY {delay}",
            ),
            ("ACQ:START", "ACQ:TRIG NOW"),
            "ACQ:TRIG:FILL?", 1, 1,
            "ACQ:SOUR{channel}:DATA:LAT:N? {samples}",
            write_end="\r\n",
            read_end="\r\n",
        ),
        ScopeDialect(
            "DSOX",
            ("KEYSIGHT", "AGILENT"),
            ("DSO-X", "DSOX", "MSO-X", "MSOX", "EDUX"),
            4,
            {},
            1.0,
            (
                "*RST", "*CLS", ":CHAN{channel}:DISP ON", ":CHAN{channel}:COUP DC", ":CHAN{channel}:OFFS 0",
                ":CHAN{channel}:RANG {range}", ":TIM:MODE MAIN", ":TIM:REF LEFT", ":TIM:POS 0",
                ":TIM:RANG {aperture_s}", ":TRIG:SWE NORM",
            ),
            (":SING", ":TRIG:FORC"),
            ":OPER:COND?", 8, 0,
            ":MEAS:VAV? DISP,CHAN{channel}",
            errors=":SYST:ERR?",
            begins=0.1,
        ),
    )
}  # fmt: skip
"""Every oscilloscope that `model` may name."""
