"""Source resistance: the electrode follows the command with a first-order lag, resistance times capacitance."""

from bender_effects.effect import Effect, Sizes
from bender_effects.form import Form, lag_of_two, simple, time_constant
from bender_effects.witnessed import Witnessed

COVERED = {"time_constant_s": (0.0005, 1.0)}


def _forms(sizes: Sizes) -> tuple[Form, ...]:
    plain = simple("source_resistance", time_constant(*sizes.lasting(COVERED["time_constant_s"])), memory=True)
    return plain, lag_of_two(plain)


EFFECT = Effect(
    id="source_resistance",
    summary="the electrode follows the command with a first-order lag, resistance times capacitance",
    in_general="what acts follows the command with a first-order lag: a filter, a coil, a volume that fills",
    signature=(
        "After each step an exponential of one time constant, up and down alike, scaled by the step; the "
        "mode is hit more softly and rings less. On a sine amplitude and phase fall together."
    ),
    resembles={
        "sensor_lag": (
            "Acts behind the hysteresis and the modes. In a linear chain the two cannot be told apart; in fast "
            "records the residuals differ by a factor of 2 to 3."
        ),
        "transport_delay": "Its gain does not fall.",
        "slew_limit": "Its time grows with the step.",
        "creep": "Creep has no single time constant and goes on for decades of time.",
        "rate_independent_hysteresis": "Its loop keeps its width when the drive is slowed.",
    },
    separation=(
        "A sensor lag also smooths the ringing that it sees; a delay keeps the amplitude. The voltage read "
        "at the electrode settles it."
    ),
    excitation="steps read at some kHz, or a chirp past 1 / (2 pi tau)",
    typical={
        "time_constant_s": (0.0005, 0.1, "0.9 ms for 1 Mohm on 0.88 nF, 20 to 100 ms for a programmable supply"),
    },
    covered=COVERED,
    elsewhere="Lag of the input",
    drive="slow_chirp",
    view="frequency",
    example={"time_constant_s": 0.02},
    forms=_forms,
    same_on_other_side="sensor_lag",
    superposes=True,
    witnessed=Witnessed(False, True, excludes="above", bound="a lag before the electrodes above"),
)
