"""Where the tip of the wire is in a picture, how sure that is, and when it cannot be said."""

from bender_hil.vision.settings import TrackerSettings
from bender_hil.vision.tip import Tip
from bender_hil.vision.tracker import Tracker

__all__ = ["Tip", "Tracker", "TrackerSettings"]
