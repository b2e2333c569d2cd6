"""Where the tip of the wire is in a picture, how sure that is, and when it cannot be said.

| module | holds |
|---|---|
| `darkness` | what is dark against its surroundings, however uneven the light |
| `extreme` | the paper's way to the tip |
| `fine` | the wire to a fraction of a pixel |
| `lines` | a straight line through points of which some are wrong |
| `rough` | finding the wire |
| `scale` | what a pixel is worth |
| `settings` | how the tip is looked for |
| `stillness` | whether the picture around the wire is new: a sensor's noise never repeats, tile by tile |
| `strip` | the wire's surroundings, unrolled |
| `tip` | what a look at a picture yields, and the failure that has a reason |
| `tracker` | from a picture to the displacement of the tip in micrometres |
"""

from bender_vision.settings import TrackerSettings
from bender_vision.tip import Tip
from bender_vision.tracker import Tracker

__all__ = ["Tip", "Tracker", "TrackerSettings"]
