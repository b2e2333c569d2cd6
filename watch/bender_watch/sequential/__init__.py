"""Sequential tests on whitened residuals, and thresholds from a stated mean time between false alarms.

| module | holds |
|---|---|
| `detector` | the tests side by side over any number of rows, in memory that does not grow |
| `kernel` | one row through whitening, CUSUM and GLR, compiled |
| `run_length` | from a mean time between false alarms to thresholds |
"""
