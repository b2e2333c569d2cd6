"""What the report of another device says of an effect has no word of a piezo bender before a camera."""

import re

import pytest

from bender_discrepancy.conclusion.sentences import share_of_stroke
from bender_discrepancy.report.device_words import for_device
from bender_effects.catalogue import EFFECTS
from bender_effects.effect import PIEZO_BENDERS, Effect
from bender_inference.settings import Settings
from bender_report.wording import shown_in

OF_A_BENDER = re.compile(
    r"\b(volts?|voltages?|tip|beam|film|piezo\w*|camera|lens|micromet\w*|electrode|displacements?|pixels?|frames?|PVDF|"
    r"field|domain walls?|bending|vibrometer|strokes?)\b",
    re.IGNORECASE,
)
OTHERS = [x for x in EFFECTS.values() if x.rigs != PIEZO_BENDERS]


@pytest.mark.parametrize("effect", OTHERS, ids=[x.id for x in OTHERS])
def test_other_devices_have_no_words_of_a_bender(effect: Effect) -> None:
    with shown_in("bar", "N"):
        texts = [effect.in_general or effect.summary, effect.signature, effect.separation, effect.excitation]
        texts += [x.text for x in effect.parameters.values()]
        told = [for_device(x, bender=False) for x in texts]
    assert [x for x in told if OF_A_BENDER.search(x)] == []


@pytest.mark.parametrize("effect", EFFECTS.values(), ids=list(EFFECTS))
def test_a_bender_keeps_the_words_of_the_catalogue(effect: Effect) -> None:
    texts = (effect.summary, effect.signature, effect.separation, effect.excitation)
    assert tuple(for_device(x, bender=True) for x in texts) == texts


def test_a_command_in_volts_stays_a_voltage() -> None:
    with shown_in("V", "N"):
        assert for_device("over the voltage, at zero volts", bender=False) == "over the voltage, at zero voltage"


def test_the_share_that_does_not_matter_is_of_the_readings_of_another_rig() -> None:
    assert "stroke" in share_of_stroke(Settings())
    with shown_in("V", "rpm"):
        assert "stroke" not in share_of_stroke(Settings())
