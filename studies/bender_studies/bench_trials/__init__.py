"""Trials of the bench against its emulator: reaction times, cadence, STOP in a browser.

| module | holds |
|---|---|
| `browser_clients` | real browsers on the page of a run, in a process of their own |
| `cadence` | cadence: a run of some length on the emulated bench, timed from outside |
| `reactions` | reaction times of a real run |
| `watched_runs` | `bender benchmark live`: from STOP on the page to an output that is off, while it is watched |
"""
