"""The signature of an effect: the drive that shows it best, and the view of the residual in which it is seen.

| module | holds |
|---|---|
| `drives` | the drives that show effects best |
| `picture` | the picture of an effect's signature |
| `views` | the views of a residual that distinguish effects |
"""
