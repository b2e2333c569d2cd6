"""Sources: whatever feeds the actuator. The programmable supply (`bender_hil.supply`) is one; the others are here.

| module | holds |
|---|---|
| `kinds` | every kind of source that `kind` under `[source]` may name, ours and those of other packages |
| `amplifier` | an amplifier between a source and the actuator: gain, offset, polarity, slew, limits of its own |
| `amplified` | a source with its amplifier, which the guard owns as one |
| `daq_output` | an analogue output of a National Instruments DAQ device |
| `line_dialect` | the words of function generators and piezo controllers: one table |
| `line_source` | the driver of everything in that table |
| `simple` | the small protocol that a source of another package is written against, and what the guard makes of it |
"""
