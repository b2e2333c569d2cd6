"""The words of the catalogue, which is written for a piezo bender before a camera, for other devices."""

import re

from bender_report.wording import input_word, is_other_rig

_OF_BENDERS = (
    ("read at the electrode", "read at the device"),
    ("the electrode", "the device"),
    ("the tip", "the output"),
    ("the beam", "the device"),
    ("second bending mode", "second mode"),
    ("stroke", "range of the readings"),
    ("of the bending modes", "of the modes"),
    ("lens", "curved reading"),
    ("the supply", "the source"),
    ("camera", "sensor"),
    ("frame rate", "rate of the readings"),
    ("frames", "readings"),
    ("frame", "reading"),
    ("the material", "the device"),
    ("a line at 6.27 times the first resonance, with a zero between the two", "a line at its own frequency"),
    ("past 7 times the first resonance", "through its frequency"),
    ("shift the picture", "shift the zero"),
    ("with the picture shifted", "with the zero shifted"),
)
_OF_UNITS = (
    ("in volts", "in the {}"),
    ("zero volts", "zero {}"),
    ("zero voltage", "zero {}"),
    ("full voltage", "full {}"),
    ("output voltage", "{}"),
    ("voltage", "{}"),
    ("in micrometres", "in the reading"),
    ("displacement", "output"),
)


def for_device(text: str, *, bender: bool) -> str:
    """Return a sentence of the catalogue in words that hold for the device.

    Args:
        text: of the catalogue.
        bender: whether the device is a piezo bender.
    """
    if not bender:
        text = _replaced(text, _OF_BENDERS)
    return _replaced(text, _OF_UNITS) if is_other_rig() else text


def _replaced(text: str, words: tuple[tuple[str, str], ...]) -> str:
    for old, new in words:
        told = new.format(input_word())
        text = re.sub(rf"\b{old}\b", told, text)
        text = re.sub(rf"\b{old[0].upper()}{old[1:]}\b", told[0].upper() + told[1:], text)
    return text
