"""Pictures of a tuning.

| module | holds |
|---|---|
| `convergence` | the paper's Fig |
| `loop` | the tuned loop over frequency: Bode, Nyquist and the four sensitivity functions |
| `plant` | the linear plant by itself: Bode diagram and step |
| `robustness` | Monte Carlo as a picture: the share of plants that have settled, over time |
| `steps` | the paper's Fig |
"""
