"""The gallery: published rigs of other fields, each diagnosed with a linear model that lacks its effect.

| module | holds |
|---|---|
| `command` | `bender gallery`: play the rigs, diagnose them, and put all of it on one page |
| `nominal` | the linear model that is given with a rig |
| `rig_diagnosis` | what the workflow says of a rig, and whether that is what the rig has |
| `story` | the page of the gallery |
"""
