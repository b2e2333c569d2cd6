"""The model beside the running device: alarms that say what changed, since when and how large.

| module | holds |
|---|---|
| `alarm` | since when, which effect, how large, what it does to the loop, what to do |
| `baseline` | what is normal: expectation, noise, what each effect would add |
| `beside_run` | lines for the live page of a run |
| `command` | `bender watch` |
| `excursions` | where the commands leave what the training record has seen |
| `follow` | where rows come from |
| `held` | rows beside what is expected of them, an alarm that waits |
| `lane` | extremes of any number of rows, for pictures |
| `report` | the page |
| `sequential` | tests on the whitened residual, thresholds from run length |
| `session` | a watch from beginning to end, and on after a kill |
| `settings` | how a device is watched |
| `trend` | slow changes and their forecast |
| `watcher` | rows in, events out |
| `words` | events in words |
"""
