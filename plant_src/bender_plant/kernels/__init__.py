"""Steps that several blocks share. A block never imports another block's step: it imports it from here.

first_order_lag   tau v' = u - v
play              the play of half-width r, and where it engages
bouc_wen          the hysteretic part of Bouc-Wen along its input
curve             a smooth curve with slope 1 at the origin
vibration_mode    a mode of vibration, and one with a nonlinear spring
loaded_mode       a mode with friction, drag or hysteresis in its restoring force
rounding          the steps of a converter
state             states whose length follows from the parameters
"""
