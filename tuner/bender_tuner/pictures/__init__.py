"""Pictures of a tuning.

| module | holds |
|---|---|
| `convergence` | the paper's Fig |
| `loop` | the tuned loop over frequency: Bode, Nyquist and the four sensitivity functions |
| `robustness` | Monte Carlo as a picture: the share of plants that have settled, over time |
| `steps` | the paper's Fig |
"""
