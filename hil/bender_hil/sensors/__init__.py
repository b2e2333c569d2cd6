"""Sensors: whatever says where the tip is. The camera is one; the others are here.

| module | holds |
|---|---|
| `sensor` | what a sensor is: open, read with the instant of the reading, close |
| `kinds` | every kind of sensor that `kind` under `[sensor]` may name, ours and those of other packages |
| `table` | what the table `[sensor]` says beside the instrument: rate, calibration, range |
| `sensor_eyes` | a sensor as the loop wants it: newest reading in µm from rest, stalls and repeats counted |
| `multimeter` | a bench multimeter by SCPI, one reading per trigger |
| `daq_input` | an analogue input of a National Instruments DAQ device |
| `meter_dialect` | the words of multimeters: one table |
| `oscilloscope` | an oscilloscope or a Red Pitaya by SCPI, the mean of one record per trigger |
| `scope_dialect` | the words of oscilloscopes: one table |
| `text_line` | a line of text with a number in it, from a serial port or TCP |
| `triggered` | what sensors of one reading per trigger check alike |
| `pace` | when the next reading is due |
"""
