"""Supplies: capabilities and dialects as tables, one driver over them, links over PyVISA.

| module | holds |
|---|---|
| `capability` | what each model can do: one table |
| `dialect` | dialects: the words for each thing that is asked of a supply |
| `driver` | the driver of every supply in the table |
| `failures` | what can go wrong between the computer and the output terminals |
| `link` | the wire to an instrument, over PyVISA |
| `parse` | answers, read strictly: a wrong or damaged one is an error and never a number |
| `patience` | how long whoever talks to an instrument may wait, and who is told while it waits |
| `played_source` | a source with a buffer of its own |
| `port_lock` | one controller per serial line: a lock that is taken before the port is touched |
| `same_instrument` | the instrument of a run: what it said of itself on opening holds until the end |
| `select` | from the table `[supply]` of a bench file to the instrument |
| `source` | what the guard asks of whatever feeds the actuator |
| `stream` | bytes out, bytes in, below PyVISA's messages |
"""
