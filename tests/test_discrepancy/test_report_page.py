"""The report: one file that asks for nothing, the facts of diagnosis.json, many numbers in few figures."""

import re
import xml.etree.ElementTree as ElementTree
from collections import Counter
from html.parser import HTMLParser
from importlib.resources import files
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure
from reported_diagnosis import hypothesis, record_of, told
from scipy.integrate import solve_ivp

from bender_discrepancy.conclusion.diagnosis_json import outcome
from bender_discrepancy.conclusion.findings import find
from bender_discrepancy.conclusion.measurement.corrected_model import Gap
from bender_discrepancy.conclusion.measurement.gap import Measured, measure
from bender_discrepancy.report.effect_sections import ranking_bars
from bender_discrepancy.report.loop_and_creep import (
    creep_per_decade,
    figures_of,
)
from bender_discrepancy.report.loop_figures import ROWS_OF_A_BRANCH, loop_of
from bender_discrepancy.report.page import gap_bars, report_page
from bender_discrepancy.report.residual_pictures import banded_density
from bender_effects.catalogue import EFFECTS
from bender_inference.experiment.proposal import Proposal
from bender_inference.fitting.criterion import very_strong
from bender_plant.model import Model, load_model, model_from_table
from bender_report.chart import plain_logarithmic
from bender_report.number import Number
from bender_report.palette import TOKENS
from bender_report.wording import figure, listed, plain, quantity, uncertain, with_interval

VOID = {"meta", "link", "br", "img", "hr", "input"}


class Reader(HTMLParser):
    """Collects the text and every attribute, and checks that tags are closed in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.text: list[str] = []
        self.attributes: list[tuple[str, str, str]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.attributes += [(tag, name, value or "") for name, value in attrs]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.attributes += [(tag, name, value or "") for name, value in attrs]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, dict]:
    record = record_of(effects={"creep": {"gains": (0.2,), "time_constants_s": (3.0,)}})
    base = load_model("paper")
    best, rival = (hypothesis(base, [record], x) for x in (("1 relaxation", (0.1, 2.0)), ("source_resistance", (0.1,))))
    findings = find(told([record], best, [rival]))
    fmu = tmp_path_factory.mktemp("report") / "model.fmu"
    measured = measure(findings.search, findings.model, findings.calibration, fmu)
    following = Proposal("steps of two sizes would tell", np.array([0.0, 1.0]), np.array([0.0, 9.0]), True)
    result = outcome(findings, measured, ["<b>&name.csv"], following)
    return report_page(findings, measured, result), result


def test_a_proposed_profile_says_its_unit():
    plan = Proposal("", np.array([0.0, 1.0]), np.array([0.0, 9.0]), True)
    assert plan.to_csv().splitlines()[0] == "time_s,voltage_V"
    assert plan.to_csv("W").splitlines()[0] == "time_s,command [W]"


def read(html: str) -> Reader:
    reader = Reader()
    reader.feed(html)
    assert not reader.open
    return reader


def test_it_asks_for_nothing_outside_itself(page: tuple[str, dict]):
    reader = read(page[0])
    assert "script" not in {tag for tag, _, _ in reader.attributes}
    for tag, name, value in reader.attributes:
        # a link is followed when somebody asks for it
        if name == "src" or (name == "href" and tag != "a"):
            assert value.startswith(("data:", "#"))
    assert "http://" not in page[0]
    assert "https://" not in page[0]
    assert len(page[0]) < 2_000_000


def test_it_says_what_the_diagnosis_says(page: tuple[str, dict]):
    html, result = page
    text = " ".join(" ".join(read(html).text).split())
    assert result["sentence"] in text
    (effect,) = result["effects"]
    assert effect["evidence"] in text
    for stage in ("before", "recalibrated", "after"):
        assert quantity(result["gap"][stage]["rms_um"], "um") in text
    assert "docs/effects/creep.md" in text
    links = [value for tag, name, value in read(html).attributes if (tag, name) == ("a", "href")]
    assert any(link.startswith("file:") and link.endswith("/docs/effects/creep.md") for link in links)
    assert "stand-in for the FMU" not in text
    assert "unusual" in text
    assert "Steps of two sizes would tell." in text
    assert "bender hil --profile profile.csv" in text
    assert "<b>&name.csv" in text
    assert "<b>&name.csv" not in html


def test_the_map_has_a_colour_bar_with_its_unit(page: tuple[str, dict]):
    maps = re.findall(r'<svg role="img" aria-label="rms of the residual.*?</svg>', page[0], flags=re.DOTALL)
    assert len(maps) == 2
    assert all("rms of the residual (µm)" in x for x in maps)


def test_an_effect_is_drawn_with_the_readings_that_show_it(page: tuple[str, dict]):
    html, result = page
    drawn = re.findall(r"what ([^\"]+) adds in this record", html)
    assert {EFFECTS[x["id"]].title for x in result["effects"] if not x.get("rival_of")} == set(drawn)


def test_its_pictures_follow_the_colours_of_the_page(page: tuple[str, dict]):
    html = page[0]
    pictures = re.findall(r"<svg.*?</svg>", html, flags=re.DOTALL)
    assert pictures
    for picture in pictures:
        root = ElementTree.fromstring(picture)
        assert root.get("aria-label")
        assert "width" not in root.attrib
        assert not [name for name, (light, _) in TOKENS.items() if light in picture]
    used = set(re.findall(r"var\(--(\w+)\)", html)) - {"c", "line"}
    assert used <= set(TOKENS)
    assert {"measured", "without", "with"} <= used
    counts = Counter(re.findall(r' id="([^"]+)"', html))
    assert not [name for name, count in counts.items() if count > 1]


def test_colours_are_told_apart_in_light_and_dark():
    for shade in (0, 1):
        colours = [pair[shade] for pair in TOKENS.values()]
        assert len(set(colours)) == len(colours)
        for name in ("ink", "muted", "with", "without", "caution", "good"):
            assert contrast(TOKENS[name][shade], TOKENS["page"][shade]) >= (4.0 if name != "ink" else 12.0)


def contrast(a: str, b: str) -> float:
    """Contrast ratio of two colours (WCAG 2.1)."""
    high, low = sorted((luminance(a), luminance(b)), reverse=True)
    return (high + 0.05) / (low + 0.05)


def luminance(colour: str) -> float:
    parts = [int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5)]
    linear = [x / 12.92 if x <= 0.03928 else ((x + 0.055) / 1.055) ** 2.4 for x in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def measured_with(before: float, alone: float, after: float, floor: float) -> Measured:
    return Measured(Gap(before, 1.0), Gap(alone, 1.0), Gap(after, 1.0), floor, [], [], [])


def test_a_bar_that_would_flatten_the_others_is_torn():
    plain_bars = gap_bars(measured_with(2.0, 1.5, 0.07, 0.06), "corrected")
    assert [bar["torn"] for bar in plain_bars] == [False] * 4
    assert [bar["width"] for bar in plain_bars] == pytest.approx([100.0, 75.0, 3.5, 3.0])
    torn = gap_bars(measured_with(300.0, 1.5, 0.07, 0.06), "corrected")
    assert [bar["torn"] for bar in torn] == [True, False, False, False]
    assert torn[1]["width"] == pytest.approx(80.0)


def test_no_noise_and_no_gap_still_make_bars():
    assert [bar["width"] for bar in gap_bars(measured_with(0.0, 0.0, 0.0, 0.0), "corrected")] == [0.0] * 4


@given(st.lists(st.floats(0.0, 1e6), min_size=1, max_size=8))
def test_bars_of_rivals_grow_with_what_they_are_worse_by(differences: list[float]):
    rivals = [("creep", x) for x in sorted(differences)]
    bars, line = ranking_bars("Backlash", rivals, very_strong())
    widths = [bar["width"] for bar in bars[1:]]
    assert widths == sorted(widths)
    assert 0.0 < line < 100.0
    for (_, difference), width in zip(rivals, widths, strict=True):
        assert (width >= line - 0.02) == (difference >= very_strong()) or abs(difference - very_strong()) < 0.05


def test_density_of_white_noise_is_flat_and_its_size_known():
    noise = 0.06 * np.random.default_rng(2).standard_normal(20_000)
    frequency, density = banded_density(np.arange(20_000) / 30.0, noise)
    assert np.all(np.diff(frequency) > 0.0)
    assert np.median(density[frequency > 0.5]) == pytest.approx(0.06 * np.sqrt(2.0 / 30.0), rel=0.05)


@pytest.mark.parametrize(
    ("value", "half_width", "expected"),
    [
        (0.0601, 0.00042, "0.06010 ± 0.00042"),
        (5.89, 0.19, "5.89 ± 0.19"),
        (123.4, 7.0, "123.4 ± 7.0"),
        (-9.42e-5, 5e-7, "(−9.420 ± 0.050) × 10⁻⁵"),
        (0.7, 0.0, "0.7"),
        (2.0, float("inf"), "2 ± ?"),
        (0.01, 3.0, "0.01 ± 3"),
    ],
)
def test_half_widths_set_the_digits(value: float, half_width: float, expected: str):
    assert uncertain(value, half_width) == expected


@pytest.mark.parametrize(
    ("value", "std", "interval", "expected"),
    [
        (788.9, 3.2, (767.3, 810.9), "789 ± 22 V"),
        (788.9, 3.2, (782.6, 795.2), "788.9 ± 6.3 V"),
        (14.2, 0.3, (13.7, 16.0), "14.2 (13.7 to 16) V"),
        (-14.2, 0.3, (-16.0, -13.7), "−14.2 (−16 to −13.7) V"),
        (2.0, 0.0, None, "2 V"),
        (2.0, float("inf"), None, "2 ± ? V"),
    ],
)
def test_a_number_is_told_with_its_interval_of_95_percent(value, std, interval, expected):
    """Not with the standard deviation of the linearised fit, which may be seven times as narrow."""
    assert with_interval(Number("scale_V", value, "V", std, interval=interval)) == expected


@given(st.floats(1e-12, 1e12) | st.floats(-1e12, -1e-12))
def test_a_figure_is_the_number_to_three_digits(value: float):
    assert float(plain(figure(value))) == pytest.approx(value, rel=5.1e-3)


def test_words_of_a_list():
    assert (listed([]), listed(["a"]), listed(["a", "b", "c"], "or")) == ("", "a", "a, b or c")
    assert plain("−3 µm → 2 × 10⁻⁵ V²") == "-3 um -> 2e-5 V2"


@pytest.mark.parametrize("low", [1e-3, 0.0098, 0.11])
@pytest.mark.parametrize("ratio", [20.0, 51.0, 250.0, 2e3, 1e6])
def test_a_logarithmic_axis_has_three_labels_and_no_more_than_eight(low: float, ratio: float) -> None:
    axes = Figure().subplots()
    axes.loglog([low, low * ratio], [1.0, 2e4])
    plain_logarithmic(axes)
    first, last = axes.get_xlim()
    assert 3 <= sum(first <= x <= last for x in axes.get_xticks()) <= 8


def _model(gain: float = 1.0, sensitivity_um_per_V: float = 0.5, **hysteresis: Any) -> Model:
    """A linear transducer with hysteresis beside it, and a calibration."""
    return model_from_table(
        {
            "format": 1,
            "name": "loop",
            "block": [
                {"id": "linear_transduction", "sensitivity_um_per_V": sensitivity_um_per_V},
                {"id": "calibration", "gain": gain},
            ],
        }
    ).with_block("rate_independent_hysteresis", **hysteresis)


@settings(max_examples=20)
@given(
    plays=st.lists(st.tuples(st.floats(0.5, 9.0), st.floats(0.01, 0.2)), min_size=1, max_size=6),
    linear=st.floats(-0.5, 0.5),
    gain=st.floats(0.2, 3.0),
)
def test_plays_have_the_width_and_the_remanence_of_the_textbook(
    plays: list[tuple[float, float]], linear: float, gain: float
) -> None:
    thresholds, weights = zip(*plays, strict=True)
    # the part that returns the way it came widens nothing
    known = _model(gain, thresholds_V=thresholds, weights_um_per_V=weights, reversible_linear_um_per_V=linear)
    loop = loop_of(known, 0.0, 40.0)
    one_sided = gain * sum(r * p for r, p in plays)
    assert loop.width_um == pytest.approx(2.0 * one_sided, rel=1e-6)
    assert loop.remanence_um == pytest.approx(one_sided, rel=1e-6)


def test_bouc_wen_agrees_with_its_equation() -> None:
    alpha, beta, gamma, top_V = 0.1, 0.2, 0.05, 30.0
    known = _model(form="bouc_wen", alpha_um_per_V=alpha, beta_1_per_V=beta, gamma_1_per_V=gamma)

    def branch(z: float, sign: float) -> float:
        def slope(_: float, z: np.ndarray) -> np.ndarray:
            return sign * alpha - beta * z - gamma * sign * np.abs(z)

        return float(solve_ivp(slope, (0.0, top_V), [z], rtol=1e-9, atol=1e-12).y[0, -1])

    assert loop_of(known, 0.0, top_V).remanence_um == pytest.approx(abs(branch(branch(0.0, 1.0), -1.0)), rel=1e-3)


@pytest.mark.slow
@settings(max_examples=20)
@given(
    half_width=st.floats(1.0, 6.0), part=st.floats(0.2, 0.8), gain=st.floats(-20.0, 20.0).filter(lambda x: abs(x) > 0.1)
)
def test_a_slider_behind_a_gap_has_a_free_stretch_as_wide_as_the_gap(
    half_width: float, part: float, gain: float
) -> None:
    # what the slider passes on is v less its play; the gap is taken out of it
    slipping = {"thresholds_V": (half_width,), "weights_um_per_V": (-1.0,), "reversible_linear_um_per_V": -1.0}
    gap = 2.0 * part * half_width
    known = _model(gain, 1.0, **slipping).with_block("output_dead_zone", width_um=gap)
    free = loop_of(known, -20.0, 20.0).free
    assert free is not None
    row_V = 40.0 / (ROWS_OF_A_BRANCH - 1)
    assert free.length_V == pytest.approx(gap, abs=2.0 * row_V)
    assert free.after_V == pytest.approx(half_width - 0.5 * gap, abs=2.0 * row_V)


@pytest.mark.slow
@settings(max_examples=20)
@given(st.lists(st.tuples(st.floats(0.5, 9.0), st.floats(0.01, 0.2)), min_size=1, max_size=6))
def test_what_follows_ever_more_closely_after_a_reversal_has_no_free_stretch(plays: list[tuple[float, float]]) -> None:
    thresholds, weights = zip(*plays, strict=True)
    assert loop_of(_model(thresholds_V=thresholds, weights_um_per_V=weights), -40.0, 40.0).free is None


def _numbers(plays: list[tuple[float, float]]) -> tuple[Number, ...]:
    return (
        *(Number(f"thresholds_V[{k + 1}]", r, "V") for k, (r, _) in enumerate(plays)),
        *(Number(f"weights_um_per_V[{k + 1}]", p, "um/V", p) for k, (_, p) in enumerate(plays)),
    )


def test_programs_get_the_figures_that_people_get() -> None:
    plays = _numbers([(1.0, 0.05), (2.0, 0.05), (4.0, 0.05), (8.0, 0.05)])
    told = figures_of("rate_independent_hysteresis", "plays", plays, (0.0, 50.0), _model())
    assert [(x["name"], x["unit"]) for x in told] == [("loop_width", "um"), ("remanence", "um")]
    assert [x["value"] for x in told] == pytest.approx([1.5, 0.75])
    assert all(x["between"] == [0.0, 50.0] and x["between_unit"] == "V" for x in told)
    slipping = (*_numbers([(5.0, -1.0)]), Number("reversible_linear_um_per_V", -1.0, "um/V", 0.1))
    behind = _model(2.0, 1.0).with_block("output_dead_zone", width_um=4.0)
    free = figures_of("rate_independent_hysteresis", "plays", slipping, (-20.0, 20.0), behind)[2:]
    assert [x["name"] for x in free] == ["follows_for", "stands_still_for"]
    assert [x["value"] for x in free] == pytest.approx([3.0, 4.0], abs=0.1)
    pairs = [(0.04, 3.0), (0.01, 0.2), (0.03, 5.0)]
    creep = (
        *(Number(f"gains[{k + 1}]", g, "1", 0.001) for k, (g, _) in enumerate(pairs)),
        *(Number(f"time_constants_s[{k + 1}]", t, "s") for k, (_, t) in enumerate(pairs)),
    )
    decades = figures_of("creep", None, creep, (0.0, 50.0), _model())
    assert [(x["name"], x["between"]) for x in decades] == [
        ("creep_of_decade", [pytest.approx(0.1), pytest.approx(1.0)]),
        ("creep_of_decade", [1.0, 10.0]),
        ("creep_in_all", [pytest.approx(0.1), 10.0]),
    ]
    assert [x["value"] for x in decades] == pytest.approx([0.01, 0.07, 0.08])
    assert figures_of("tip_mass", None, plays, (0.0, 50.0), _model()) == []


def test_creep_is_summed_per_decade_of_its_time_constants() -> None:
    found = creep_per_decade([0.01, 0.02, 0.03, 0.05], [0.1, 0.4, 1.0, 30.0])
    assert [(low, high) for low, high, _ in found] == [(0.1, 1.0), (1.0, 10.0), (10.0, 100.0)]
    assert [total for *_, total in found] == pytest.approx([0.03, 0.03, 0.05])


@given(st.lists(st.tuples(st.floats(-0.2, 0.4), st.floats(1e-3, 1e6)), min_size=1, max_size=12))
def test_no_relaxation_is_lost_in_the_decades(pairs: list[tuple[float, float]]) -> None:
    found = creep_per_decade([x for x, _ in pairs], [x for _, x in pairs])
    assert sum(x for *_, x in found) == pytest.approx(sum(x for x, _ in pairs), abs=1e-12)
    assert all(np.isclose(high, 10.0 * low) for low, high, _ in found)


def test_sentences_that_may_follow_each_other_are_apart() -> None:
    template = (files("bender_discrepancy.report") / "page.html.j2").read_text(encoding="utf-8")
    assert "not how large it is. {% endif %}" in template
    assert not re.findall(r"[a-z]\.{% endif %}\n *{% if \w+ %}[A-Z]", template)
