"""Slow fall of the supply: a one-quadrant supply: up at once, down only as fast as its output capacitor empties."""

from bender_effects.effect import Effect, Sizes
from bender_effects.form import Form, simple, time_constant
from bender_effects.witnessed import Witnessed

COVERED = {"time_constant_s": (0.001, 2.0)}


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    return (simple("supply_fall_lag", time_constant(*sizes.lasting(COVERED["time_constant_s"]), 2.1), memory=True),)


EFFECT = Effect(
    id="supply_fall_lag",
    summary="a one-quadrant supply: up at once, down only as fast as its output capacitor empties",
    in_general="the input rises at once and falls with a lag: a source that can only push",
    signature=(
        "Steps up leave nothing, every step down leaves an exponential with the sign of a reading that "
        "comes down too late. Over the voltage only the falling branch is off."
    ),
    resembles={
        "source_resistance": "Steps up lag as well.",
        "slew_limit": "The fall is straight, and longer for higher steps; steps up are slow too.",
        "rate_independent_hysteresis": "Hold after the fall: a lag is gone after a few τ, hysteresis stays.",
        "creep": "Creep follows steps up too and has no single time constant.",
    },
    separation="Compare steps up with steps down: the lag of a source is in both, hysteresis stays during a hold.",
    excitation="steps down of several heights, with holds longer than the fall",
    typical={
        "time_constant_s": (0.005, 0.5, "linear supplies 10 to 30 ms, high-voltage ones up to seconds"),
    },
    covered=COVERED,
    elsewhere="Slow fall of the input",
    drive="steps",
    view="since_step",
    example={"time_constant_s": 0.15},
    forms=_forms,
    witnessed=Witnessed(True, True, excludes="above", bound="a fall slower than"),
)
