"""The instrument of a run: what it said of itself on opening holds until the end."""

from bender_hil.supply.failures import WrongInstrumentError
from bender_hil.supply.parse import Identity


class SameInstrument:
    """Remembers the first identity that it is shown and refuses every other one.

    Two units of one model differ in their serial number alone. Without this, the second one answers for the first
    after a link was lost, and its "off" is taken for the first one's.

    Args:
        first: known from an earlier link, as to a spare guard; None where nothing was opened yet.
    """

    def __init__(self, first: Identity | None = None) -> None:
        self._first = first

    def check(self, found: Identity) -> Identity:
        """Return what was found.

        Raises:
            WrongInstrumentError: it is not the instrument that the run was opened with.
        """
        if self._first is None:
            self._first = found
        if found != self._first:
            raise WrongInstrumentError(
                f"another instrument answers there ({_words(found)}), the run was opened with {_words(self._first)}"
            )
        return found


def _words(identity: Identity) -> str:
    return f"{identity.model}, serial number {identity.serial}, firmware {identity.firmware}"
