"""Dry friction of what turns or slides: the drive has to exceed it before anything moves, and what moves rests."""

from dataclasses import replace

from bender_effects.effect import OTHER_RIGS, UNSEEN_OF_A_ROW, Effect, FULL_STROKE_um, Sizes
from bender_effects.form import Form, Values, scale
from bender_effects.lag_taken import without_a_lag
from bender_plant.model import Model

MOST_STROKES = 10.0
"""Of the readings, within the time constant of the speed: friction and load are sought up to there."""
COVERED = {"friction_um": (0.3, 11.5), "drag_1_per_um": (0.005, 0.5)}


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    # a fit that frees the lag goes no further down than that
    unseen_s = 0.99 * UNSEEN_OF_A_ROW * sizes.row_s

    def apply(model: Model, values: Values) -> Model:
        """Take over a lag of the plant, whose number stays free beside the friction and the drag."""
        rest, tau_s = without_a_lag(model, unseen_s, "bearing_friction")
        loads = dict(zip(COVERED, values, strict=False))
        return rest.with_block("bearing_friction", time_constant_s=tau_s, **loads)

    def of_a_place(model: Model, values: Values) -> Model:
        """Take over two lags: the shorter is that of the speed, which adds up to the place."""
        rest, one_s = without_a_lag(model, unseen_s, "bearing_friction")
        rest, other_s = without_a_lag(rest, unseen_s, "bearing_friction")
        loads = dict(zip(("friction_um", "load_um"), values, strict=False))
        return rest.with_block("bearing_friction", time_constant_s=min(one_s, other_s), **loads, form="place")

    force, drag = (
        sizes.sized(scale(name, *COVERED[name], count, 0.0), COVERED[name], unit)
        for name, count, unit in (("friction_um", 6, "um"), ("drag_1_per_um", 3, "1/um"))
    )
    plain = Form("bearing_friction", "dry friction of a speed", (force,), apply, memory=True)
    both = Form(
        "bearing_friction", "dry friction of a speed, with drag", (force, drag), apply, memory=True,
        refines=plain.name, beside="speed_drag", curve=("drag_1_per_um",),
    )  # fmt: skip
    # full drive may move a place by many strokes within the time constant
    way = scale("friction_um", COVERED["friction_um"][0], MOST_STROKES * FULL_STROKE_um, 8, 0.0)
    pull = replace(way, name="load_um", low=-way.high, log=False, starts=(-20.0, -2.0, 2.0, 20.0))
    forces = sizes.sized(way, COVERED["friction_um"], "um"), sizes.sized(pull, COVERED["friction_um"], "um")
    place = Form(
        "bearing_friction", "dry friction where the place is read", forces[:1], of_a_place, memory=True, adds_up=True
    )  # fmt: skip
    # beside a load the friction alone explains nothing: neither sets out from the other
    loaded = replace(place, name="dry friction and a load where the place is read", free=forces)
    return plain, both, place, loaded


EFFECT = Effect(
    id="bearing_friction",
    summary="dry friction of what turns or slides: motors, belts, axes, servos",
    signature=(
        "Nothing turns before the drive exceeds the friction; beyond that the speed grows with the drive. Without "
        "drive it falls along a curve that ends at rest, sooner than a lag would."
    ),
    resembles={
        "dead_zone": "The same steady speeds; but without drive the speed fades and never ends.",
        "asymmetric_dead_zone": "The same, with two sides; what turns is not braked.",
        "presliding_friction": "A force that is read, over a velocity that is commanded.",
        "coulomb_friction": "Friction on a place with a spring: it rests off its end.",
        "quadratic_drag": "Brakes fast motion, and leaves slow motion alone.",
    },
    separation="Cut the drive at speed: friction ends the motion along a straight stretch, a dead zone lets it fade.",
    excitation="steps of several heights both ways, each followed by none until it rests",
    typical={
        "friction_um": (0.0, 11.5, "up to half of the speed at full drive, in small motors"),
        "drag_1_per_um": (0.005, 0.5, "the drag of a fan beside it"),
    },
    covered=COVERED,
    relative=True,
    rigs=OTHER_RIGS,
    drive="bipolar_triangle",
    view="voltage",
    example={"time_constant_s": 0.2, "friction_um": 4.0},
    forms=_forms,
)
