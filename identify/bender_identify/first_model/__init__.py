"""A first linear model from records alone: a gain with a delay, lags or modes, its order chosen by evidence.

structures      what a first model may consist of, and the plant that it makes
start_values    where the fits of a structure begin
frequency_start the same, by way of the frequency response
fit             one structure by the error of the simulated readings, gain and offsets solved for inside
loop_rival      a loop without time, the rival of every structure
choice          which structure the records support

| module | holds |
|---|---|
| `choice` | which structure the records support: by a criterion on all rows, and by held-out rows |
| `command` | `bender model fit RECORD...`: a first model from records alone, as a model file and an FMU |
| `fit` | one structure fitted by the error of the simulated readings; gain and offsets are solved for inside |
| `frequency_start` | starts by way of the frequency response: a rational function through it, for every delay |
| `loop_rival` | a loop that does not depend on time, as the rival of every linear structure |
| `start_values` | where the fits of a structure begin |
| `structures` | what a first model may consist of: lags and modes in series with a gain and a delay |
| `told` | a first model as numbers for a program and as rows of tables |
"""
