"""The Dask cluster, and how units are handed to it.

| module | holds |
|---|---|
| `connect` | a cluster on this machine, or a connection to one that runs |
| `preload` | what a worker of this machine does first |
| `schedule` | units handed out, answers taken, workers that died |
| `settings` | which cluster, checked when it is made |
"""
