"""`bender bench check`: what is connected, what it answers, what is missing, and two dry runs.

| module | holds |
|---|---|
| `command` | `bender bench check`: its arguments, its table and its page |
| `dry_runs` | the two runs, at 0 V and at the smallest voltage that shows, and what they tell |
| `findings` | findings: what was looked at, how it stands, what to do |
| `connected` | what else is connected, for a source or a sensor that does not answer |
"""
