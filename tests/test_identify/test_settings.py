import pytest

from bender_identify.settings import LIBRARIES, Settings
from bender_plant.blocks.sparse_equation import powers_of


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"library": "fourier"}, "library: found 'fourier'"),
        ({"keep": "best"}, "keep: found 'best'"),
        ({"held_out_share": 0.99}, "held_out_share: found 0.99"),
        ({"ensemble": -1}, "ensemble: found -1"),
        ({"delay_s": -0.1}, "delay_s: found -0.1"),
        ({"set_aside_s": -1.0}, "set_aside_s: found -1.0"),
        ({"terms": ("w", "sin(u)")}, "sin"),
        ({"terms": ("w u", "u w")}, "each term once"),
    ],
)
def test_settings_that_cannot_be_are_refused(change: dict, says: str) -> None:
    with pytest.raises(ValueError, match=says.replace("(", "\\(").replace(")", "\\)")):
        Settings(**change)


def test_every_library_is_made_of_terms_that_the_block_carries() -> None:
    for terms in LIBRARIES.values():
        assert len({powers_of(term) for term in terms}) == len(terms)


def test_own_terms_replace_the_library() -> None:
    assert Settings(library="paper", terms=("u'", "w")).libraries() == {"own": ("u'", "w")}
    assert list(Settings().libraries()) == ["bouc_wen", "paper", "combined"]
