"""Emulated sensors, each at the end of a real wire, with the truth behind its terminals.

| module | holds |
|---|---|
| `settings` | what an emulated sensor is told, and what a bench file would say of it |
| `transducer` | from the tip to what the sensor's electronics see: scale, offset, averaging, noise, faults |
| `scpi_sensor` | what emulated sensors that speak SCPI have in common |
| `meter` | the emulated multimeter as SCPI sees it |
| `scope` | the emulated oscilloscope and the emulated Red Pitaya as SCPI sees them |
| `text_stream` | an emulated controller that sends a line of text many times a second |
"""
