"""The bench against its emulator: cadence, reaction times, and every command on benches of five kinds.

| module | holds |
|---|---|
| `as_hardware` | the bench file that drives an emulated bench as hardware is |
| `cadence` | a run of some length on the emulated bench, timed from outside |
| `end_to_end` | a bench of any kind from its first check to the diagnosis |
| `kilohertz` | a loop at 1 kHz on the emulated DAQ |
| `reactions` | reaction times of a real run |
"""
