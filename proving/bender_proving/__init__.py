"""Benches with something hidden in them: records on which methods of diagnosis are judged.

Equations, integrator and forms of the effects are this room's own; it shares no code with the catalogue that is judged
by it. `cases` says what there is, `Bench` plays and records.

| module | holds |
|---|---|
| `bench` | a bench that plays voltages and reads displacements, with what a case hides in it |
| `chain` | the bench as a chain: command, supply, material, structure, surroundings, sensor |
| `machines/` | machines of other fields with numbers drawn at random, two records each |
| `devices/` | devices drawn at random and records of them, as a person might record them |
| `fleet` | records of many units of one design, with a bad batch, a drift and broken files |
| `cases/` | cases: what is hidden in which bench, drawn and selected |
| `gallery/` | published rigs of other fields, simulated from their published equations |
| `physics/` | the physics of the hidden benches, from command to reading, by an integrator of its own |
| `records/` | what is played to a hidden bench and read from it |
| `systems/` | linear systems drawn at random, with records of them: what a first model is judged on |
"""

from bender_proving.bench import Bench
from bender_proving.cases.case import Case, Weak, spoiled
from bender_proving.cases.draw import DrawError, make_case, strength
from bender_proving.cases.effects import INSIDE, OUTSIDE
from bender_proving.records.excitation import Excitation
from bender_proving.cases.hidden import NOISE_UM, Effect, Hidden
from bender_proving.cases.selections import SELECTIONS, cases

__all__ = [
    "INSIDE",
    "NOISE_UM",
    "OUTSIDE",
    "SELECTIONS",
    "Bench",
    "Case",
    "DrawError",
    "Effect",
    "Excitation",
    "Hidden",
    "Weak",
    "cases",
    "make_case",
    "spoiled",
    "strength",
]
