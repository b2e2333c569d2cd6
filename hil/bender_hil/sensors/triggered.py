"""What sensors that take one reading per trigger check alike: who answers, and that a reading fits between two."""

from collections.abc import Callable

from bender_hil.supply import parse
from bender_hil.supply.failures import WrongInstrumentError
from bender_hil.supply.link import Link
from bender_hil.supply.parse import Identity


def identified(
    link: Link, name: str, makers: tuple[str, ...], serial: str | None, is_model: Callable[[str], bool]
) -> Identity:
    """Return who answers at a link.

    Args:
        link: open.
        name: of the expected instrument, for messages.
        makers: beginnings of its maker's name, in capitals.
        serial: its serial number; None for any.
        is_model: whether a model's name, in capitals, is the expected one.

    Raises:
        WrongInstrumentError: another one does.
    """
    found = parse.identity("*IDN?", link.query("*IDN?"))
    if not found.manufacturer.upper().startswith(makers) or not is_model(found.model.upper()):
        raise WrongInstrumentError(
            f"{found.manufacturer} {found.model} answers there, expected a {name}; correct the address or "
            "`model` under [sensor]"
        )
    if serial is not None and found.serial != serial:
        raise WrongInstrumentError(f"the {name} there has serial number {found.serial}, expected {serial}")
    return found


def check_pace(aperture_s: float, rate_Hz: float) -> None:
    """Refuse a reading that takes longer than the time between two.

    Raises:
        ValueError: it does.
    """
    if aperture_s * rate_Hz >= 1.0:
        raise ValueError(
            f"aperture_s: found {aperture_s:g}, expected less than the time between readings, "
            f"{1.0 / rate_Hz:.4g} s (rate_Hz)"
        )
