"""Effects are called in the words of the device."""

from bender_discrepancy.conclusion.sentences import heading_of, title_of
from bender_discrepancy.effects.catalogue import EFFECTS
from bender_report.wording import shown_in

WORDS_OF_A_PIEZO = ("bending", "supply", "source", "electro", "charge")


def test_a_device_of_other_quantities_has_no_word_of_a_piezo() -> None:
    with shown_in("mm", "N"):
        titles = [heading_of(x) for x in EFFECTS if EFFECTS[x].rigs != "piezo benders"]
    assert not [x for x in titles if any(y in x.lower() for y in WORDS_OF_A_PIEZO)]


def test_a_voltage_and_a_displacement_have_the_titles_of_the_catalogue() -> None:
    with shown_in("V", "um"):
        assert all(heading_of(x) == EFFECTS[x].title for x in EFFECTS)
    assert title_of("second_mode") == "a second bending mode"
