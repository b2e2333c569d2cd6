"""Steps that several blocks share. A block never imports another block's step: it imports it from here.

| module | holds |
|---|---|
| `bouc_wen` | the hysteretic part of the Bouc-Wen model along a monotone stretch of its input |
| `contact` | what a contact passes on of the way beyond it, at once or gradually |
| `curve` | a smooth curve through the origin with slope 1 there |
| `draining_lag` | a lag whose outflow is the square root of its level |
| `first_order_lag` | a first-order lag, tau v' = u - v, answered exactly under a parabola |
| `loaded_mode` | a mode of vibration with dry friction, quadratic drag or hysteresis in its restoring force |
| `play` | the play of half-width r, F -> max(u - r, min(u + r, F)), along monotone stretches of its input |
| `rounding` | rounding to the steps of a converter |
| `state` | a state whose length follows from the parameters of a block |
| `stop` | a lag between two stops: what moves rests there, and comes off as soon as the drive turns |
| `vibration_mode` | one mode of vibration under a parabola |
"""
