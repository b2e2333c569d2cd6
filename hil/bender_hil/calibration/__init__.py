"""What a pixel is worth, found from pictures of a stage micrometer.

| module | holds |
|---|---|
| `command` | `bender calibrate`: what a pixel is worth, from pictures of a stage micrometer |
| `fit` | scale and distortion from the phase of a ruler's lines in one or more pictures |
| `fringes` | the lines of a ruler as a wave: how often it repeats, and its phase all over the picture |
| `growth` | a first fit of the lines from how much the phase grows between neighbouring places |
| `pictures` | pictures of the ruler: from files, from a camera, or drawn |
| `sensor_command` | `bender calibrate --sensor`: what a sensor's unit is worth, from two points or a table |
| `sensor_picture` | the picture of a sensor's fit: points, curve, and what lies between them |
| `sensor_scale` | what a sensor's unit is worth: a polynomial with its uncertainty |
"""
