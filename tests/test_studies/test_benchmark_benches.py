"""What counts against a bench that was tried from its check to the diagnosis."""

import pytest

from bender_studies.bench_trials.end_to_end import HIDDEN, KINDS, EndToEnd, hidden_model

DELAY, HYSTERESIS = HIDDEN
FOUND = ("named", {DELAY: "certain", HYSTERESIS: "likely"})
DONE: dict[str, int] = dict.fromkeys(("check", "step", "staircase", "investigate", "diagnose"), 0)


def test_five_benches_of_different_kinds_hide_a_delay_and_a_hysteresis():
    assert len({kind.source for kind in KINDS}) == len({kind.sensor for kind in KINDS}) == 5
    assert {block.id for block in hidden_model().blocks} >= set(HIDDEN)


def test_a_bench_that_names_what_is_hidden_is_as_it_should_be():
    assert EndToEnd("bench", DONE, 0.0, FOUND, FOUND).broken == []


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"statuses": DONE | {"investigate": 1}}, "investigate: status 1"),
        ({"live": {"step": 12.0}}, "12.00 V after step"),
        ({"investigated": ("", {})}, "investigate: transport_delay is not among the first 2"),
        ({"diagnosed": ("named", {"creep": "likely", **FOUND[1]})}, "rate_independent_hysteresis is not among"),
        (
            {"diagnosed": ("likely", {DELAY: "certain", HYSTERESIS: "possible"})},
            "rate_independent_hysteresis, possible",
        ),
        ({"diagnosed": ("named", {**FOUND[1], "creep": "certain"})}, "diagnose: creep is certain"),
    ],
)
def test_what_is_not_as_it_should_be_is_told(changed: dict[str, object], words: str):
    facts: dict[str, object] = {"statuses": DONE, "investigated": FOUND, "diagnosed": FOUND} | changed
    assert words in "; ".join(EndToEnd("bench", **facts).broken)  # pyright: ignore[reportArgumentType]
