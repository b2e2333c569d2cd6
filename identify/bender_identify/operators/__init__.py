"""Operators of hysteresis fitted to records, and the linear rival of all of them.

| module | holds |
|---|---|
| `bouc_wen_fit` | the Bouc-Wen model, in its corrected form, by the error of the simulated readings |
| `first_order_lag` | the rival of every hysteresis: a gain with a first-order lag, w' = a w + b u + c u' |
| `play_columns` | plays, powers of the voltage and their slow copies, each simulated once |
| `prandtl_ishlinskii_fit` | the Prandtl-Ishlinskii operator by bounded least squares on simulated plays |
| `remanence` | what stays at 0 V after the voltage was up and down again |
"""
