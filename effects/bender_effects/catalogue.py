"""The catalogue of effects: all files of `library/`, along the chain from the command to the reading.

The order is that of the plant's blocks; the two calibrations come last.
"""

import importlib
import pkgutil

from bender_effects import library
from bender_effects.effect import FULL_VOLTAGE_V, Effect, FULL_STROKE_um, Sizes
from bender_effects.form import Form
from bender_loop.errors import InputError
from bender_loop.shell import plugins
from bender_loop.shell.plugins import installed_plugins, load_plugin
from bender_plant.blocks import BLOCKS

__all__ = ["EFFECTS", "FULL_VOLTAGE_V", "READ_OFF", "Effect", "FULL_STROKE_um", "Sizes", "forms"]


def _read() -> dict[str, Effect]:
    found: dict[str, Effect] = {}
    for file in pkgutil.iter_modules(library.__path__):
        effect = importlib.import_module(f"{library.__name__}.{file.name}").EFFECT
        if effect.id != file.name:
            raise ValueError(f"{file.name}.py: found the effect {effect.id!r}, expected {file.name!r}")
        found[effect.id] = effect
    for name in installed_plugins(plugins.EFFECTS):
        effect = load_plugin(plugins.EFFECTS, name)
        if not isinstance(effect, Effect) or effect.id != name or name in found:
            raise InputError(f"{plugins.EFFECTS}: {name}: found {effect!r:.60}, expected an Effect of that id")
        found[name] = effect
    order = list(BLOCKS)
    places = {name: order.index(name) if name in order else len(order) for name in found}
    return dict(sorted(found.items(), key=lambda item: (places[item[0]], item[0])))


EFFECTS: dict[str, Effect] = _read()
READ_OFF = next(name for name, effect in EFFECTS.items() if effect.read_off)
"""The effect that is the step of the readings."""


def forms(sizes: Sizes) -> tuple[Form, ...]:
    """Return every form of every effect that is sought in models of this kind, sized to the records."""
    sought = [effect for effect in EFFECTS.values() if effect.is_sought_in(sizes.piezo_bender)]
    return tuple(form for effect in sought for form in effect.forms(sizes))
