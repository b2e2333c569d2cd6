"""Physics of effects that no catalogue should have: energy exchange, random jumps between two states.

| module | holds |
|---|---|
| `exchange` | two modes that exchange energy: an autoparametric pair near the resonance 2 : 1 |
| `telegraph` | two small memories that only the effects outside the catalogue have |
"""
