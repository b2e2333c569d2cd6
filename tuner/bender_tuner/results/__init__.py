"""What a tuning leaves: gains file, tuning file, summary, robustness report.

| module | holds |
|---|---|
| `gains_file` | `gains.toml`: the tuned gains in every form, with units in the names |
| `report` | the robustness report: what a set of gains is worth beyond one step response |
| `summary` | what a tuning prints: the task, the table, the gains, the findings in a sentence each |
| `tuning_file` | `tuning.json`: what was asked, what was run, what came of it, enough to run it again |
"""
