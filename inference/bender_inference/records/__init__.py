"""Records made ready for a diagnosis.

| module | holds |
|---|---|
| `checks` | records and model read, and refused where nothing can be learned from them |
| `first_look` | one rough simulation before anything is fitted: is this the device of the model? |
| `digits` | the digits of a record that mean something, the steps of its sensor |
| `observations` | readings, which of them count, which are held out |
| `roles` | what each block of a record is for: fitted, chosen on, reported on |
| `excitation` | what a command excites |
| `command_lines` | the lines of a command that is a few sines |
| `excerpt` | the rows of a long record that are searched |
| `initial_motion` | the start of a record in the middle of a motion |
| `spectrum` | the spectrum of a residual over its instants |
| `ringing` | what rings from before a record |
| `stand_in` | what is known of an FMU that another model stands in for |
| `record_names` | names of records that are distinguished as they are told |
| `noise` | the noise floor of a residual |
"""
