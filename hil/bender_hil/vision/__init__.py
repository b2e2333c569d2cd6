"""Where the tip of the wire is in a picture, how sure that is, and when it cannot be said."""

from .settings import TrackerSettings
from .tip import Tip
from .tracker import Tracker

__all__ = ["Tip", "Tracker", "TrackerSettings"]
