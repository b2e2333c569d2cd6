"""Machines of other fields drawn at random, each with two records, for a diagnosis without a model.

Nothing here is a form of the catalogue: equations are integrated, friction is a chain of pieces, a loop is the motion
of magnetic walls.

| module | holds |
|---|---|
| `machine` | what a kind of machine is, and steps of its equations |
| `moving` | a motor, a servo with a gear, a tendon, a proportional valve, a hydraulic drive |
| `springs` | a loudspeaker, a pendulum, an elastomer, a damper of magnetic fluid |
| `slow` | two tanks, an oven, a ferrite core |
| `recorded` | a machine of a seed and its two records |
"""

from bender_proving.machines.machine import Machine
from bender_proving.machines.recorded import MACHINES, Recorded, draw

__all__ = ["MACHINES", "Machine", "Recorded", "draw"]
