"""Child process: drive one FMU with the voltages of records and leave its readings beside them."""

import sys
import time
from pathlib import Path

import numpy as np

from bender_loop.fmu.plant import FmuPlant
from bender_loop.records.drive import InputHold, drive_record, steps_of_drive
from bender_loop.records.record import Record

STEPS = "steps: "
EVERY_S = 1.0


class _Told:
    """A plant that says once a second how many of its steps are done."""

    def __init__(self, plant: FmuPlant, steps: int) -> None:
        self._plant, self._steps, self._done, self._next_s = plant, steps, 0, time.monotonic() + EVERY_S
        self.reset, self.read, self.close = plant.reset, plant.read, plant.close

    def step(self, voltage_V: float, step_s: float) -> float:
        """Advance the plant."""
        self._done += 1
        if not self._done % 1000 and time.monotonic() >= self._next_s:
            self._next_s = time.monotonic() + EVERY_S
            sys.stdout.write(f"{STEPS}{self._done}/{self._steps}\n")
            sys.stdout.flush()
        return self._plant.step(voltage_V, step_s)


def main(words: list[str]) -> int:
    """Drive the FMU `words[0]`, input hold `words[1]`, so many steps to a ramp, with every record named after that."""
    fmu, hold, ramp_steps, *records = words
    known: InputHold = "linear" if hold == "linear" else "hold"
    for name in records:
        with np.load(name) as columns:
            record = Record(**columns)
        steps = steps_of_drive(record.time_s, record.voltage_V, record.command_time_s, known, int(ramp_steps))
        with FmuPlant(Path(fmu), start_s=float(record.time_s[0])) as plant:
            told = _Told(plant, steps)
            readings = drive_record(told, record, input_hold=known, ramp_steps=int(ramp_steps))
        np.save(Path(name).with_suffix(".npy"), readings)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
