"""Published rigs of other fields, simulated from their published equations, each with an effect that its model lacks.

Nothing here is shared with the blocks or the catalogue: scipy integrates the equations as their authors state them.

| module | holds |
|---|---|
| `damper` | a friction damper whose band has clearance |
| `duffing` | an oscillator whose spring stiffens |
| `played` | what a rig is driven with, and a reading with noise |
| `rig` | what a rig of the gallery tells of itself |
| `rigs` | the rigs by name |
| `servo` | a position servo whose guide rubs |
| `tanks` | two tanks in a row, of which the upper one overflows |
| `thermocouple` | an oven and the thermocouple in it, which lags |
| `valve` | a proportional valve with overlap |
"""

from bender_proving.gallery.rig import PublishedRig, RigRecord
from bender_proving.gallery.rigs import RIGS

__all__ = ["RIGS", "PublishedRig", "RigRecord"]
