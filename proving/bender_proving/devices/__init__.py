"""Devices drawn at random and records of them: what a diagnosis must survive, and must not misname.

| module | holds |
|---|---|
| `device` | a device: elements in a random order between command and reading |
| `record` | what is played to it, and what a person might record of it |
"""
