"""Slew limit of the supply: the supply's output moves no faster than its slew rate, up or down."""

import math

from bender_effects.effect import FULL_VOLTAGE_V, Effect, Sizes
from bender_effects.form import Form, scale, simple
from bender_effects.witnessed import Witnessed

COVERED = {"slew_rate_V_per_s": (5.0, 20000.0)}


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    rates = COVERED["slew_rate_V_per_s"]
    if not sizes.piezo_bender:
        # from one that takes a part of the record for the whole span to one that takes a part of a row
        shortest_s, longest_s = sizes.lasting((FULL_VOLTAGE_V / rates[1], FULL_VOLTAGE_V / rates[0]))
        rates = (sizes.span_V / longest_s, sizes.span_V / shortest_s)
    return (simple("slew_limit", scale("slew_rate_V_per_s", *rates, 9, math.inf), memory=True),)


EFFECT = Effect(
    id="slew_limit",
    summary="the supply's output moves no faster than its slew rate, up or down",
    in_general="what acts moves no faster than some rate, up or down, whatever the command does",
    signature=(
        "Only edges show: after a step the residual is a triangle that lasts as long as the step is high, "
        "step over rate. Slow ramps are followed exactly."
    ),
    resembles={
        "source_resistance": "Takes the same time for every step and has no corner at its end.",
        "supply_fall_lag": "Only down, and an exponential.",
        "transport_delay": "A delay starts late, a slew limit arrives late.",
    },
    separation="The time to arrive grows with the height of the step; for a lag it is the same for every step.",
    excitation="steps of several heights, read faster than they rise",
    typical={
        "slew_rate_V_per_s": (50.0, 30000.0, "a laboratory supply without load to a piezo amplifier"),
    },
    covered=COVERED,
    elsewhere="Rate limit of the input",
    drive="fast_steps",
    view="since_step",
    example={"slew_rate_V_per_s": 500.0},
    forms=_forms,
    witnessed=Witnessed(True, True, excludes="below", bound="a slew limit below", by_current=True),
)
