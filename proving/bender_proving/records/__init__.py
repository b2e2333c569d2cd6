"""What is played to a hidden bench and read from it.

| module | holds |
|---|---|
| `beside` | what instruments beside the sensor show of a bench: voltages on the way to the film, the temperature |
| `closed_loop` | records of a closed loop: a controller of its own follows set-points |
| `excitation` | what is played to a bench: when rows are read, what is commanded, when the command acts |
| `excitations` | the excitations of the records |
| `frames` | frames that went wrong |
| `meters` | instruments beside the sensor: the supply's voltmeter, a thermometer |
| `moved` | forms moved away from every equation, smooth in the state of the bench |
"""
