"""The log of a run: lines of JSON that survive a kill, the record made from them, the replay that checks them.

| module | holds |
|---|---|
| `ending` | the last line of a run: how it ended, and what a person should know before using it |
| `expectation` | what a run should have looked like, and missing frames |
| `figures` | what a run says about the actuator |
| `journal` | append-only lines of JSON, each written to the file in one unbuffered write |
| `nexus` | a run as one HDF5 file in the layout of NeXus |
| `page` | `summary.html` |
| `read_run` | a run's directory, read back: ticks of the controller beside what the guard did with them |
| `replay` | the replay: from what the log says was measured to the commands |
| `results` | what a run leaves beside its journals |
| `summary` | figures of a run, from its journals: deadlines, delays, what was refused, how it ended |
| `to_record` | from the journals of a run to its record |
"""
