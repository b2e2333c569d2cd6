"""Records and what is done with them: reading, replay through a plant, comparison.

| module | holds |
|---|---|
| `acting_voltage` | the voltage that acts while a row of a record is read |
| `arguments` | the options of every command that reads records: names, units and layout of the columns |
| `between_rows` | a voltage that is band-limited between the rows; readings that integrate over an exposure |
| `columns` | which columns of a table a record is made of: named, of the usual names, or found |
| `common_units` | records that go together, with each other or with a model, in the same units |
| `compare` | how well a simulation agrees with a measurement |
| `distinct` | records that are given together are different ones |
| `drive` | a plant driven open loop with the voltage of a record |
| `end_of_range` | readings that stand at the end of a sensor's range |
| `further` | further inputs of a plant: what was measured beside the command and acts on the plant as well |
| `initial_motion` | the command before the first row of a record that starts in motion |
| `missing_rows` | rows that a logger has lost, put in between the others |
| `outliers` | isolated readings far from both neighbours |
| `raster` | a plant driven on an even raster, as a host drives it that knows one step only |
| `record` | records: what was commanded and what was read, row by row |
| `repeated_readings` | readings that a logger took twice |
| `replay` | a record played through a plant: the reading that the plant would have given at every row |
| `scale` | answers that are tenfold, a thousandfold or a millionfold off |
| `sizes` | whether the columns of a record can be in the units that they are taken for |
| `telling_rows` | rows of a long record that show what is quick and what is slow |
| `variables` | the input and the output of an FMU that a record goes with |
| `zero_move` | a sensor whose zero moved while it recorded |
"""
