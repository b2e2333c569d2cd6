"""The page of a fleet.

| module | holds |
|---|---|
| `page` | what the page shows, from the tables of a fleet |
| `charts` | small charts as inline SVG |
"""
