"""Emulated sources beside the supply and the Agilent generator.

| module | holds |
|---|---|
| `siglent` | the emulated function generator of Siglent's SDG series |
| `controllers` | emulated piezo controllers: Thorlabs MDT693B and one that speaks PI's General Command Set |
"""
