"""Faults of the emulated bench, switched by script through its console while everything runs."""

from dataclasses import dataclass, fields, replace

FOR_EVER = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Faults:
    """What is wrong at present; the values given here are "nothing".

    On the wire:

    Attributes:
        no_reply: so many answers are not given.
        delay_s: answers come so much later.
        garble: so many answers have a wrong byte.
        truncate: so many answers lack their second half.
        stale: every answer is the one to the question before.
        refuse: new connections are closed at once.
        reset_on_merged_writes: two commands in one packet cost the connection.
        hung: nothing is read any more.
        hung_s: the next line is read so much later.
        drip_s: answers come byte by byte, each so much after the one before, while further lines are carried out.
        flood: nonsense comes without pause, "lines" with ends or "bytes" without.
        no_end: answers lack their end.
        answer: every answer is this text.
        twice: every answer comes twice.
        echo: every line comes back before its answer.
        lost_lines: so many lines are never carried out.
        drops: so many questions cost the connection.

    In the instrument:

        local: somebody has pressed the Local key: settings are refused until it is called to remote again.
        deaf: settings are taken without a word and have no effect.
        complaining: the error queue never becomes empty.
        other_model: it says that it is this model.
        other_unit: another unit of the same model answers, off and at 0 V; the first one stays as it is.
        off_delay_s: the output goes off so much after it was told.
        stuck_on: the output cannot be switched off, and says that it is on; without a switch, it does not come down.
        stuck_relay: the output cannot be switched off, and says that it is off.

        reading_V, reading_A: what it says that it measures, whatever there is.

    At the terminals:

        offset_V: the output lies so much beside its setting.
        leak_A: so much more flows.
        limiting: the output gives way to its current limit and sags to this fraction; 1 for none.

    At the camera's picture of the tip:

        travel_um: the tip is so much beside where it should be.

    At an emulated sensor that is no camera, beside those on the wire, `reading_V` and `travel_um`:

        noise_um: its readings scatter so much more.
        frozen: it says the same for ever.
    """

    no_reply: int = 0
    delay_s: float = 0.0
    garble: int = 0
    truncate: int = 0
    stale: bool = False
    refuse: bool = False
    reset_on_merged_writes: bool = False
    hung: bool = False
    hung_s: float = 0.0
    drip_s: float = 0.0
    flood: str = ""
    no_end: bool = False
    answer: str = ""
    twice: bool = False
    echo: bool = False
    lost_lines: int = 0
    drops: int = 0
    local: bool = False
    deaf: bool = False
    complaining: bool = False
    other_model: str = ""
    other_unit: bool = False
    off_delay_s: float = 0.0
    reading_V: str = ""
    reading_A: str = ""
    stuck_on: bool = False
    stuck_relay: bool = False
    offset_V: float = 0.0
    leak_A: float = 0.0
    limiting: float = 1.0
    travel_um: float = 0.0
    noise_um: float = 0.0
    frozen: bool = False

    def with_fault(self, name: str, value: float | str) -> "Faults":
        """The same with one more fault; ValueError for a name that is not one."""
        kinds = {field.name: type(field.default) for field in fields(self)}
        if name not in kinds:
            raise ValueError(f"there is no fault {name!r}; there are: {', '.join(kinds)}")
        return replace(self, **{name: kinds[name](value)})
