"""From the table `[supply]` of a bench file to the instrument."""

from dataclasses import dataclass

from bender_hil.supply.capability import MODELS, Capability
from bender_hil.supply.driver import Supply
from bender_hil.supply.link import LinkSettings, VisaLink
from bender_hil.supply.parse import Identity
from bender_loop.errors import InputError
from bender_loop.shell.plugins import A_CLASS_OF_YOURS, SUPPLIES, installed_plugins, load_plugin

GENERATOR = "33xxx"
"""`model` of a function generator."""
BACKENDS = ("py", "ivi")


@dataclass(frozen=True, slots=True)
class SupplySettings:
    """Which instrument, and where.

    Attributes:
        resource: VISA address.
        model: a key of `MODELS`, one that another package adds, or "33xxx" for a function generator.
        serial: its serial number; None for any.
        timeout_s: how long to wait for an answer.
        baud: of a serial line; None for what the model is delivered with.
        spacing_s: shortest time between two commands.
        gain: of an amplifier behind a function generator.
        backend: of PyVISA: "py", its pure Python one, or "ivi", an installed VISA library.

    Raises:
        ValueError: there is no such model or backend.
    """

    resource: str
    model: str = "9115"
    serial: str | None = None
    timeout_s: float = 0.25
    baud: int | None = None
    spacing_s: float = 0.0
    gain: float = 1.0
    backend: str = "py"

    def __post_init__(self) -> None:
        if self.model != GENERATOR and capability_of(self.model) is None:
            known = ", ".join([*MODELS, *installed_plugins(SUPPLIES), GENERATOR])
            raise ValueError(
                f"model must be one of {known}, found {self.model!r:.60}; add another as a row of words "
                f"(docs/how-to/add-your-own.md) or as {A_CLASS_OF_YOURS}"
            )
        if self.backend not in BACKENDS:
            raise ValueError(f"backend must be one of {', '.join(BACKENDS)}, found {self.backend!r}")
        if self.model != GENERATOR and self.gain != 1.0:
            raise ValueError(f"gain belongs to a function generator, found {self.gain!r} with a {self.model}")

    def make(self, identity: Identity | None = None) -> Supply:
        """Return the supply, not open yet; with an identity, only the one that said this of itself will do.

        Raises:
            ValueError: it is a function generator, which is none.
        """
        capability = capability_of(self.model)
        if capability is None:
            raise ValueError(f"a {self.model} is no supply")
        dialect = capability.dialect
        link = VisaLink(
            LinkSettings(
                self.resource,
                dialect.write_end,
                dialect.read_end,
                self.timeout_s,
                self.baud or capability.baud,
                self.spacing_s,
                self.backend,
            )
        )
        return Supply(link, capability, self.serial, identity)


def capability_of(model: str) -> Capability | None:
    """Return what a model can do, ours or that of another package; None where nobody knows it.

    Raises:
        InputError: the package cannot be imported, or gives something else.
    """
    if model in MODELS or model not in installed_plugins(SUPPLIES):
        return MODELS.get(model)
    found = load_plugin(SUPPLIES, model)
    if not isinstance(found, Capability):
        raise InputError(f"{SUPPLIES}: {model}: found a {type(found).__name__}, expected a Capability")
    return found
