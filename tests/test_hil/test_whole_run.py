"""What exit status and last line say of a run, against the truth behind the terminals."""

from pathlib import Path

import pytest
from bench_trials.whole_run import last_word_faults

from bender_emulator.sources.controllers import ThorlabsInstrument
from bender_loop.shell.last_word import UNKNOWN

AS_PLANNED = "written: run\nas planned; output off\n"
ALARM = f"bender: {UNKNOWN} (no answer)\n"


@pytest.mark.parametrize(
    ("status", "printed", "said", "is_live"),
    [
        (0, AS_PLANNED, "", False),
        (0, AS_PLANNED, f"{ALARM}run: 3/4, 2 µm\n", False),
        (1, "ended by a rule (supply): no answer; output off\n", "bender: the run was ended\n", False),
        (2, "", "bender: bench.toml: no such file\n", False),
        (3, f"{UNKNOWN}; 2 ticks late\n", ALARM, True),
        (3, f"{UNKNOWN}\n", ALARM, False),
        (None, "", ALARM, True),
        (None, "", "", False),
    ],
)
def test_a_last_word_that_is_true(status: int | None, printed: str, said: str, is_live: bool):
    assert last_word_faults(status, printed, said, is_live=is_live) == []


@pytest.mark.parametrize(
    ("status", "printed", "said", "is_live", "words"),
    [
        (0, AS_PLANNED, "", True, "the output is on; status 0"),
        (1, "ended by a rule; output off\n", "", True, "the output is on"),
        (1, "", f"{ALARM}bender: the output is off, but not everything could be written\n", True, "the output is on"),
        (1, "", ALARM, True, "status 1, and the last line is"),
        (3, AS_PLANNED, "", False, "status 3, and the last line is ''"),
        (3, AS_PLANNED, ALARM, False, "an alarm, and 'as planned"),
        (0, "written: run\n", "", False, "status 0, and the last line is"),
        (None, "", "", True, "status None"),
        (139, "", "", False, "exit status 139"),
        (1, "", "Traceback (most recent call last)\nbender: it failed\n", False, "a traceback"),
    ],
)
def test_a_last_word_that_is_not(status: int | None, printed: str, said: str, is_live: bool, words: str):
    assert words in "; ".join(last_word_faults(status, printed, said, is_live=is_live))


def test_a_controller_that_is_stuck_on_does_not_come_down_at_all(tmp_path: Path):
    import numpy as np

    instrument = ThorlabsInstrument(np.random.default_rng(0))
    instrument.execute("xvoltage=15.0")
    instrument.faults = instrument.faults.with_fault("stuck_on", 1)
    # a way down goes by steps: one that stopped at the last of them would be as good as off
    for level in ("10.0", "0.3", "0.0"):
        instrument.execute(f"xvoltage={level}")
    assert instrument.target_V == 15.0
    instrument.execute("xvoltage=20.0")
    assert instrument.target_V == 20.0
