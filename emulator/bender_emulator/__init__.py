"""The emulated bench: a SCPI supply, the plant's FMU in real time, and a microscope, each in its own process.

| module | holds |
|---|---|
| `console` | the fault console: how a test or a benchmark reaches behind the emulated supply's wire |
| `conversation` | one client's conversation with the emulated supply, whatever carries it |
| `faults` | faults of the emulated bench, switched by script through its console while everything runs |
| `generator` | the emulated function generator: the words of the Agilent 33xxx family that a bench needs |
| `instrument` | the emulated supply as SCPI sees it: commands, questions, error queue, limits, protection |
| `physics` | the physics of the emulated bench in real time |
| `scpi_header` | SCPI headers: `[SOURce:]VOLTage[:LEVel]` stands for SOUR:VOLT, VOLT:LEV, voltage and so on |
| `servers` | the emulated supply's two sockets |
| `settings` | what the emulated supply's process is told when it starts |
| `start` | starting and ending the emulated supply's process |
| `terminals` | the output terminals of a one-quadrant supply, in steps of time |
| `tip_board` | the tip board: where the emulated physics says where the tip is, for whoever draws it |
| `microscope/` | a microscope over the wire's tip, drawn |
| `sensors/` | sensors that are no camera |
| `sources/` | generators and piezo controllers |
"""
