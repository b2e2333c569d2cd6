"""Tables as people have them: text in any layout, binary files, names and units of columns.

| module | holds |
|---|---|
| `column_choice` | which columns of a table are meant |
| `containers` | records in binary files |
| `matlab_child` | MATLAB files read in a process of their own |
| `quantities` | quantities of other rigs, and their units |
| `table` | tables whose faults are told by file, line and column |
| `text_blocks` | rows kept as text and read a block at a time |
| `text_layout` | how a table stands in a text file |
| `units` | units that people write and the internal ones: V, um, s, A, degC |
"""
