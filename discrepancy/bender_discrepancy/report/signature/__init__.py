"""The signature of an effect: the drive that shows it best, and the view of the residual in which it is seen."""
