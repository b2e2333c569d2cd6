"""Every kind of source that `kind` under `[source]` may name, and how the guard's process makes one from its orders."""

from collections.abc import Mapping
from typing import Any, Protocol

from bender_hil.sources.amplified import Amplified
from bender_hil.sources.amplifier import Amplifier
from bender_hil.sources.daq_output import DaqOutputSettings
from bender_hil.sources.line_source import LineSettings
from bender_hil.sources.simple import GuardedSimple, SimpleSource
from bender_hil.supply.capability import MODELS
from bender_hil.supply.parse import Identity
from bender_hil.supply.select import GENERATOR, SupplySettings, capability_of
from bender_hil.supply.source import Source
from bender_loop.shell.plugins import (
    SOURCES,
    SUPPLIES,
    check_complete,
    installed_plugins,
    known_kinds,
    load_plugin,
    package_of,
    settings_class,
)

OURS: Mapping[str, type] = {
    "supply": SupplySettings,
    "generator": LineSettings,
    "piezo_controller": LineSettings,
    "daq": DaqOutputSettings,
}
"""`make` of the first three gives what the guard owns; that of all others gives a `SimpleSource`."""


class SourceSettings(Protocol):
    """Settings of a kind of source: a frozen dataclass whose fields are the keys under `[source]`."""

    def make(self) -> Any:
        """Return the source, not open yet: ours a `Source`, another package's a `SimpleSource`."""
        ...


def source_kinds() -> list[str]:
    """Return every name, those of other packages last."""
    return known_kinds(SOURCES, OURS)


def source_class(kind: str) -> type[Any]:
    """Return the settings of a kind of source.

    Raises:
        InputError: there is no such kind, or its package is broken.
    """
    return settings_class(SOURCES, OURS, kind, "source")


def kind_of(settings: SourceSettings) -> str:
    """Return the name under which settings of that class can be made again.

    Raises:
        ValueError: no kind has such settings.
    """
    for kind, theirs in OURS.items():
        if type(settings) is theirs:
            return kind
    for kind in installed_plugins(SOURCES):
        if type(settings) is load_plugin(SOURCES, kind):
            return kind
    raise ValueError(f"found settings of the class {type(settings).__name__}, which is no kind of source")


def address_of(settings: object) -> str:
    """Return what tells this source or sensor from any other: its address, or everything that its settings say."""
    return str(getattr(settings, "resource", None) or settings)


def has_protection(settings: SourceSettings | None) -> bool:
    """Whether the source has an overvoltage protection that it can be told the level of."""
    capability = capability_of(settings.model) if isinstance(settings, SupplySettings) else None
    return capability is not None and capability.dialect.set_protection is not None


def where_to_mend(settings: SourceSettings | None) -> str:
    """Return what to look at where the program fails, and not the instrument: the package that adds this source."""
    is_supply = isinstance(settings, SupplySettings)
    group = SUPPLIES if is_supply else SOURCES
    name = settings.model if is_supply else "" if settings is None else kind_of(settings)
    if name in (*MODELS, *OURS) or name not in installed_plugins(group):
        return "this is a fault of piezo-bender, and not of a cable: please report it"
    return f"mend {name} of the package {package_of(group, name)} ({group}); this is not a fault of a cable"


def check_source(kind: str, settings: SourceSettings) -> None:
    """Check that what another package makes is a source; ours are.

    Raises:
        ValueError: something is missing.
    """
    if kind not in OURS:
        check_complete(settings.make(), SimpleSource)


def make_source(settings: SourceSettings, amplifier: Amplifier | None, identity: Identity | None = None) -> Source:
    """Return a source with its amplifier, not open yet; with an identity, only what said this of itself will do."""
    if isinstance(settings, SupplySettings) and settings.model == GENERATOR:
        gain, settings = settings.gain, _as_generator(settings)
        if amplifier is None and gain != 1.0:
            amplifier = Amplifier(abs(gain), "inverting" if gain < 0.0 else "positive")
    if isinstance(settings, SupplySettings | LineSettings):
        source: Source = settings.make(identity)
    else:
        source = GuardedSimple(settings.make, identity, has_switch=getattr(settings, "has_switch", True))
    return source if amplifier is None else Amplified(source, amplifier)


def _as_generator(settings: SupplySettings) -> LineSettings:
    """What a bench file says of a function generator under `[supply]`, as it would under `[source]`."""
    return LineSettings(
        settings.resource,
        "33500",
        serial=settings.serial,
        timeout_s=settings.timeout_s,
        baud=settings.baud,
        spacing_s=settings.spacing_s,
        backend=settings.backend,
    )
