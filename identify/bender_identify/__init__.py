"""Hysteresis models learned from records: sparse regression and operators, judged by re-simulated displacement.

| module | holds |
|---|---|
| `command` | `bender identify RECORD...` |
| `identification` | identification from records to a model |
| `identification_result` | what an identification comes to: its candidates, their scores, and the one that is written |
| `settings` | how an identification is done, checked when made |
| `first_model/` | a first linear model from records alone |
| `fitting/` | fits by simulation error, re-simulation, and how well the records determine the numbers |
| `operators/` | operators of hysteresis fitted to records, and the linear rival of all of them |
| `paper/` | the paper's own identification: its recipe and its simulated model |
| `records/` | records made ready for identification, what they excite, and voltages that nobody recorded |
| `regression/` | sparse regression: terms, rates, supports, the learned equation |
| `report/` | what an identification tells |
"""
