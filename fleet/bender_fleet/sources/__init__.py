"""Which units there are, and what identifies the work on them.

| module | holds |
|---|---|
| `keys` | keys made of the content of records, model and settings |
| `manifest` | tables that name units and their records |
| `places` | records on local disks and behind URLs |
| `units` | units from directories, globs and manifests |
"""
