"""Child process: drive one FMU with the voltages of records and leave its readings beside them."""

import sys
from pathlib import Path

import numpy as np

from bender_loop.fmu.plant import FmuPlant
from bender_loop.records.drive import InputHold, drive_record
from bender_loop.records.record import read_record


def main(words: list[str]) -> int:
    """Drive the FMU `words[0]`, input hold `words[1]`, so many steps to a ramp, with every record named after that."""
    fmu, hold, ramp_steps, *records = words
    for name in records:
        record = read_record(Path(name))
        with FmuPlant(Path(fmu), start_s=float(record.time_s[0])) as plant:
            known: InputHold = "linear" if hold == "linear" else "hold"
            readings = drive_record(plant, record, input_hold=known, ramp_steps=int(ramp_steps))
        np.save(Path(name).with_suffix(".npy"), readings)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
