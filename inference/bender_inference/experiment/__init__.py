"""The next experiment.

| module | holds |
|---|---|
| `proposal` | the experiment that is proposed after an ambiguous verdict |
| `design` | the profile under which rivals differ most |
| `profiles` | voltage profiles as building blocks |
"""
