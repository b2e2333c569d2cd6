"""Emulated sources beside the supply and the Agilent generator.

| module | holds |
|---|---|
| `siglent` | the emulated function generator of Siglent's SDG series |
| `controllers` | emulated sources without a switch: Thorlabs MDT693B, PI's General Command Set, an output of a DAQ |
| `daq_stand_in` | a stand-in for the part of `nidaqmx` that the bench uses, over the emulated plant |
"""
