"""A first linear model from records alone: a gain with a delay, lags or modes, chosen by what it simulates unseen.

structures      what a first model may consist of, and the plant that it makes
start_values    where the fits of a structure begin
frequency_start the same, by way of the frequency response
fit             one structure by the error of the simulated readings, gain and offsets solved for inside
loop_rival      a loop without time, the rival of every structure
choice          which structure the records support

| module | holds |
|---|---|
| `choice` | which structure the records support: by what it simulates of blocks that its fit has not seen |
| `command` | `bender model fit RECORD...`: a first model from records alone, as a model file and an FMU |
| `course` | what the input does between the rows, told by the records |
| `direction` | whether a record runs the other way: its input follows its reading |
| `excerpt` | a part of a long record that is enough to choose a structure |
| `fit` | one structure fitted by the error of the simulated readings; gain and offsets are solved for inside |
| `frequency_start` | starts by way of the frequency response: a rational function through it, for every delay |
| `learned` | records in, the first model and its plant out |
| `linear_structures` | the linear candidates as plain models, best first, where a search for effects may set out from |
| `loop_rival` | a loop that does not depend on time, as the rival of every linear structure |
| `misread` | isolated readings that are set aside, as no simple structure leads to them |
| `rivals` | one nonlinear part beside a simple structure, as the rival of a further order |
| `start_values` | where the fits of a structure begin |
| `structures` | what a first model may consist of: lags and modes in series with a gain and a delay |
| `report` | a first model as numbers for a program and as rows of tables |
"""
