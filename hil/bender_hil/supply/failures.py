"""What can go wrong between the computer and the output terminals."""


class SupplyError(Exception):
    """The supply did not do what it was asked for; the message says what was sent and what came back."""


class NoReplyError(SupplyError):
    """A query found no complete answer in time."""


class LinkLostError(SupplyError):
    """The link cannot be written or read, or cannot be opened."""


class BadReplyError(SupplyError):
    """An answer is not what the question calls for."""


class ComplaintError(SupplyError):
    """The instrument's own error queue is not empty."""


class MismatchError(SupplyError):
    """A setting that was read back is not the one that was sent."""


class WrongInstrumentError(SupplyError):
    """Something else answers at this address."""
