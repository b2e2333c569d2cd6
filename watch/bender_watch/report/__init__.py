"""The page about a watch: what was seen, what was raised, what it means.

| module | holds |
|---|---|
| `page` | the page |
"""
