"""What `bender demo` does: steps that return results, sections that tell them, one page that shows them.

| module | holds |
|---|---|
| `command` | `bender demo` |
| `run` | the steps in their order |
| `steps` | each takes what it needs and returns a frozen result |
| `bench` | run, diagnose, tune again, run again on the emulated bench |
| `story`, `bench_story` | results as sections of a page |
| `pictures` | the pictures |
"""
