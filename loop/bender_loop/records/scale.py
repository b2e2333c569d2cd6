"""Answers that are tenfold, a thousandfold or a millionfold off: more often a unit than a plant."""

import math

TENFOLD = 8.0
"""From this many times on, either way, a unit is asked about."""
_LIKELY = {
    1: "an amplifier of 10 that is not in the record, or cm for mm",
    2: "cm for m",
    3: "mm for µm, µm for nm, V for mV, or an FMU without units that is in another one",
    6: "m for µm, nm for mm, or an FMU without units that is in m",
    9: "m for nm",
}


def scale_question(times: float) -> str | None:
    """Return what to ask where a measurement is so many times what was expected; None where it is of that size.

    Args:
        times: the gain from the expected to the measured signal, of either sign.
    """
    size = abs(times)
    if not (math.isfinite(size) and size > 0.0) or 1.0 / TENFOLD < size < TENFOLD:
        return None
    power = abs(round(math.log10(size)))
    larger, amount = ("more", size) if size > 1.0 else ("less", 1.0 / size)
    likely = _LIKELY.get(power)
    as_by = f", as by {likely}" if likely else ""
    return f"{amount:.3g} times {larger} than expected: is a unit another than it was taken for{as_by}? Say --units"
