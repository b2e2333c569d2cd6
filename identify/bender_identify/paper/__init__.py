"""The paper's own identification: its recipe and its simulated model.

| module | holds |
|---|---|
| `paper_sindy` | what the paper's figures of its simulated identification are, and what they are not |
| `simulated_bouc_wen` | the paper's simulated Bouc-Wen model, learned back: the figure to reach |
"""
