"""Catalogue, pages, blocks and contract say the same."""

import ast
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bender_discrepancy
import bender_inference
from bender_discrepancy.conclusion.sentences import heading_of, number_title, title_of
from bender_discrepancy.report.signature.drives import DRIVES, nominal_model
from bender_discrepancy.report.signature.views import VIEWS
from bender_effects.catalogue import EFFECTS, FULL_VOLTAGE_V, Effect, FULL_STROKE_um, forms
from bender_effects.documents import documents, shown_parameters, stale
from bender_effects.effect import CALIBRATION, Sizes, powers_of_unit
from bender_effects.form import Free
from bender_plant.blocks import BLOCKS
from bender_plant.kernels.bouc_wen import along
from bender_plant.model import load_model
from bender_report.wording import shown_in, unit_text

BEAM = load_model("beam")

ROOT = Path(__file__).parents[2]
CONTRACT = {
    "supply": "transport_delay slew_limit supply_fall_lag source_resistance supply_quantisation dead_zone",
    "material": "rate_independent_hysteresis creep charge_leakage saturation electrostriction",
    "structure": "second_mode tip_mass structural_damping stiffening backlash",
    "surroundings": "thermal_drift periodic_disturbance ageing",
    "sensor": "sensor_lag sensor_quantisation lens_distortion",
    "calibration": "gain_error offset",
}
STAGES = {effect_id: stage for stage, ids in CONTRACT.items() for effect_id in ids.split()}
HEADINGS = [
    "Equation", "Typical values", "What it leaves in the residual", "What it is confused with",
    "Which excitation shows it", "Parameters", "Sources",
]  # fmt: skip

every_effect = pytest.mark.parametrize("effect", EFFECTS.values(), ids=list(EFFECTS))


def page(effect: Effect) -> str:
    return (ROOT / effect.page).read_text(encoding="utf-8")


def table_under(text: str, heading: str) -> list[list[str]]:
    lines = text.partition(f"## {heading}\n")[2].partition("\n## ")[0].splitlines()
    rows = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines if line.startswith("|")]
    return rows[2:]


def limits(cell: str) -> tuple[float, float] | None:
    if cell == "–":
        return None
    low, high = map(float, cell.split(" … "))
    return low, high


def test_the_catalogue_is_that_of_the_contract_along_the_chain():
    assert {effect.id: effect.stage for effect in EFFECTS.values()}.items() >= STAGES.items()
    assert all(effect_id == effect.id for effect_id, effect in EFFECTS.items())
    along = [block_id for block_id in BLOCKS if block_id in EFFECTS]
    assert list(EFFECTS) == [*along, "gain_error", "offset"]


@every_effect
def test_every_effect_has_a_block_or_a_parameter_of_the_calibration(effect: Effect):
    if effect.stage == "calibration":
        assert effect.block is BLOCKS["calibration"]
        assert len(effect.parameters) == 1
    else:
        assert (effect.block.id, effect.block.stage, effect.block.title) == (effect.id, effect.stage, effect.title)
        assert effect.parameters
    assert set(effect.example) <= set(effect.defaults)
    nominal_model().with_block(effect.block.id, **effect.example)


@every_effect
def test_covered_and_typical_ranges_lie_inside_the_enforced_bounds(effect: Effect):
    assert effect.typical
    assert effect.covered
    for name, (low, high, *_) in [*effect.typical.items(), *effect.covered.items()]:
        enforced = effect.parameters[name]
        assert enforced.low <= low < high <= enforced.high
        if enforced.low < 0.0:
            assert enforced.low <= -high


@every_effect
def test_what_resembles_what_is_known_and_not_itself(effect: Effect):
    assert effect.confusables
    assert len(set(effect.confusables)) == len(effect.confusables)
    assert set(effect.confusables) <= set(EFFECTS) - {effect.id}
    assert effect.drive in DRIVES
    assert effect.view in VIEWS


@every_effect
def test_the_parameter_table_of_the_page_is_the_metadata(effect: Effect):
    rows = {row[0].strip("`"): row[1:] for row in table_under(page(effect), "Parameters")}
    assert list(rows) == shown_parameters(effect)
    assert set(effect.defaults) - set(rows) <= {
        "straight_below_V",
        "straight_above_V",
        "straight_below_um",
        "straight_above_um",
    }
    for name, (unit, covered, typical, text) in rows.items():
        known = effect.parameters.get(name)
        if known is None:
            assert re.findall("`(.+?)`", text) == list(effect.block.module.FORMS)
            continue
        assert (unit, text) == (unit_text(known.unit) or "1", known.text.replace("|", "&#124;"))
        assert limits(covered) == effect.covered.get(name)
        assert limits(typical) == (effect.typical[name][:2] if name in effect.typical else None)


@every_effect
def test_a_page_has_every_section_and_its_confusables(effect: Effect):
    text = page(effect)
    assert text.startswith(f"# {effect.title}\n\n`{effect.id}` · stage *{effect.stage}*")
    assert re.findall("^## (.+)$", text, re.MULTILINE) == HEADINGS
    assert [row[0] for row in table_under(text, "What it is confused with")] == [
        f"[`{other}`]({other}.md)" for other in effect.confusables
    ]
    assert ("unusual for this actuator" in text.lower()) == (effect.unusual is not None)
    assert text.partition("## Sources\n")[2].strip().startswith("- ")


@every_effect
def test_nothing_of_the_skeleton_is_left_to_do(effect: Effect):
    files = [
        Path(effect.page),
        Path(f"plant_src/bender_plant/blocks/{effect.block.id}.py"),
        Path(f"effects/bender_effects/library/{effect.id}.py"),
        Path(f"tests/effect_examples/{effect.id}.py"),
        Path("plant_src/bender_plant/blocks/__init__.py"),
    ]
    texts = {str(x): (ROOT / x).read_text(encoding="utf-8") for x in files if (ROOT / x).is_file()}
    assert not [f"{name}: {line}" for name, text in texts.items() for line in text.splitlines() if "TODO" in line]


def test_no_document_is_stale():
    """`bender effects --write-docs` writes them."""
    assert stale(EFFECTS, ROOT) == []


def test_what_is_stale_is_named(tmp_path: Path):
    for name in [*documents(EFFECTS, ROOT), Path("docs/effects/of_no_effect.md")]:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        text = (ROOT / name).read_text(encoding="utf-8") if (ROOT / name).is_file() else "# Of no effect\n"
        (tmp_path / name).write_text(text, encoding="utf-8")
    creep = tmp_path / "docs/effects/creep.md"
    creep.write_text(creep.read_text(encoding="utf-8").replace("0.01 … 0.4", "0.01 … 0.5"), encoding="utf-8")
    assert stale(EFFECTS, tmp_path) == ["docs/effects/creep.md", "docs/effects/of_no_effect.md"]
    other = {**EFFECTS, "dead_zone": replace(EFFECTS["dead_zone"], summary="another one")}
    assert "docs/effects/index.md" in stale(other, tmp_path)


@pytest.mark.parametrize(
    ("unit", "powers"), [("V", (1, 0)), ("um/V2", (-2, 1)), ("1/um3", (0, -3)), ("um/(V.s)", (-1, 1)), ("s", (0, 0))]
)
def test_powers_of_a_unit(unit: str, powers: tuple[int, int]):
    assert powers_of_unit(unit) == powers


def test_relative_ranges_cover_the_shares_that_the_contract_asks_for():
    """The contract states shares at full drive; here they are worked out again from the numbers."""
    full = FULL_VOLTAGE_V, FULL_STROKE_um
    shares = {
        ("electrostriction", "coefficient_um_per_V2"): (lambda c: c * full[0] ** 2 / full[1], 0.005, 0.60),
        ("lens_distortion", "quadratic_1_per_um"): (lambda c: c * full[1], 0.005, 0.40),
        ("stiffening", "cubic_1_per_um2"): (lambda k: k * full[1] ** 2, 0.005, 0.50),
    }
    for (effect_id, name), (share, low, high) in shares.items():
        covered = EFFECTS[effect_id].covered[name]
        assert share(covered[0]) == pytest.approx(low, rel=0.02)
        assert share(covered[1]) == pytest.approx(high, rel=0.02)
    strong, weak = EFFECTS["saturation"].covered["scale_V"]
    assert 1.0 - math.tanh(full[0] / strong) * strong / full[0] == pytest.approx(0.60, rel=0.02)
    assert 1.0 - 1.0 / (1.0 + full[0] / weak) == pytest.approx(0.01, rel=0.02)
    covered = EFFECTS["rate_independent_hysteresis"].covered
    opening = [2.0 * r * p / full[1] for r, p in zip(covered["thresholds_V"], covered["weights_um_per_V"], strict=True)]
    assert opening[0] <= 0.005
    assert opening[1] >= 0.40


@given(st.floats(1e-2, 1e3), st.floats(1e-3, 1e4))
def test_relative_ranges_are_the_same_shares_on_any_bench(full_voltage_V: float, full_stroke_um: float):
    bench = full_voltage_V, full_stroke_um
    low, high = EFFECTS["electrostriction"].covered_range("coefficient_um_per_V2", *bench) or (0.0, 0.0)
    assert low * full_voltage_V**2 / full_stroke_um == pytest.approx(0.005, rel=0.02)
    assert high * full_voltage_V**2 / full_stroke_um == pytest.approx(0.60, rel=0.02)
    _, high = EFFECTS["lens_distortion"].typical_range("cubic_1_per_um2", *bench) or (0.0, 0.0)
    assert high * full_stroke_um**2 == pytest.approx(0.0001 * FULL_STROKE_um**2)
    low, _ = EFFECTS["saturation"].typical_range("scale_V", *bench) or (0.0, 0.0)
    assert low / full_voltage_V == pytest.approx(10.0)


def test_absolute_ranges_stay_and_unknown_ones_are_none():
    assert EFFECTS["backlash"].covered_range("half_width_um", 1.0, 1000.0) == (0.1, 5.0)
    assert EFFECTS["second_mode"].covered_range("damping_ratio", 50.0, 23.1) is None


def test_a_range_of_what_is_no_parameter_is_refused():
    with pytest.raises(ValueError, match=r"creep: found a range of 'gain', expected one of gains"):
        replace(EFFECTS["creep"], covered={"gain": (0.1, 0.2)})


@pytest.mark.parametrize("covered", [(0.2, 0.1), (-0.1, 0.1), (math.nan, 0.1)])
def test_an_empty_or_negative_range_is_refused(covered: tuple[float, float]):
    with pytest.raises(ValueError, match=r"creep\.gains: .* expected 0 <= low < high"):
        replace(EFFECTS["creep"], covered={"gains": covered})


@given(st.floats(1e-3, 1e4))
def test_no_relaxation_of_a_spectrum_is_quicker_than_a_row_and_decades_are_left(rate_Hz: float) -> None:
    sizes = Sizes(50.0, 20.0, 170.0, 100.0, highest_Hz=0.5 * rate_Hz)
    spectra = [x for x in EFFECTS["creep"].forms(sizes) if x.name.startswith("spectrum")]
    assert len(spectra) == 3
    for form in spectra:
        model = form.apply(BEAM, (0.02,) * len(form.free))
        times_s = next(x for x in model.blocks if x.id == "creep").parameters.time_constants_s
        assert sorted(times_s) == list(times_s)
        assert times_s[0] >= 0.999 * min(1.0 / rate_Hz, 4.0)
        assert times_s[-1] >= 99.0 * times_s[0]


WORDS_OF_A_PIEZO = ("bending", "supply", "source", "electro", "charge")


def test_a_device_of_other_quantities_has_no_word_of_a_piezo() -> None:
    with shown_in("mm", "N"):
        titles = [heading_of(x) for x in EFFECTS if EFFECTS[x].rigs != "piezo benders"]
    assert not [x for x in titles if any(y in x.lower() for y in WORDS_OF_A_PIEZO)]


def test_the_mode_of_another_device_does_not_bend() -> None:
    with shown_in("mm", "N"):
        assert number_title("bending_modes.damping_ratio") == "mode.damping_ratio"
    with shown_in("V", "um"):
        assert number_title("bending_modes.damping_ratio") == "bending_modes.damping_ratio"


def test_a_voltage_and_a_displacement_have_the_titles_of_the_catalogue() -> None:
    with shown_in("V", "um"):
        assert all(heading_of(x) == EFFECTS[x].title for x in EFFECTS)
    assert title_of("second_mode") == "a second mode"


PACKAGES = [Path(x.__path__[0]) for x in (bender_discrepancy, bender_inference)]
IDS = {name for name, x in EFFECTS.items() if x.stage != CALIBRATION}
OF_A_MODEL = {
    "candidates.py",
    "fitting/own_numbers.py",
    "foreign/container_stages.py",
    "foreign/relaxation_model.py",
    "foreign/slow_copy.py",
}
"""They take models apart that may have such blocks of their own, and import these."""


def with_ids(path: Path) -> set[str]:
    """Return the ids that stand in a file, as words or as the blocks that it imports."""
    found: set[str] = set()
    for x in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(x, ast.Constant) and isinstance(x.value, str):
            found.add(x.value)
        elif isinstance(x, ast.ImportFrom) and (x.module or "").startswith("bender_plant.blocks"):
            found |= {(x.module or "").rpartition(".")[2], *(y.name for y in x.names)}
    return found & IDS


def test_no_other_file_knows_an_effect_by_its_id() -> None:
    paths = [(x, package) for package in PACKAGES for x in package.rglob("*.py")]
    assert len(paths) > 50
    assert {x.relative_to(package).as_posix() for x, package in paths if with_ids(x)} == OF_A_MODEL


OTHER_DEVICE = Sizes(10.0, 5.0, 600.0, 0.5, piezo_bender=False, highest_Hz=10.0)


@given(
    st.floats(1e-3, 1.0), st.floats(2.0, 1e3), st.floats(0.0, 1.0), st.sampled_from(["", "low", "high", "both"])
)  # fmt: skip
def test_only_the_ends_that_say_nothing_are_no_answer(low, high, place, ends):
    free = Free("tau_s", low, high, True, (), no_answer_at=ends)
    assert free.ends_without_answer(low) == (ends in ("low", "both"))
    assert free.ends_without_answer(high) == (ends in ("high", "both"))
    inside = math.exp(math.log(1.05 * low) + place * math.log(high / (1.05 * low) / 1.05))
    assert not free.ends_without_answer(inside)


def test_a_mode_that_does_not_ring_or_for_ever_and_a_leak_within_a_row_are_no_answers():
    found = {(form.effect, free.name): free for form in forms(OTHER_DEVICE) for free in form.free}
    damping, leak = found["second_mode", "damping_ratio"], found["charge_leakage", "time_constant_s"]
    assert damping.ends_without_answer(damping.high)
    assert damping.ends_without_answer(damping.low)
    frequency = found["second_mode", "frequency_Hz"]
    assert frequency.ends_without_answer(frequency.low)
    assert frequency.ends_without_answer(frequency.high)
    assert leak.ends_without_answer(leak.low)
    assert not damping.ends_without_answer(0.5)
    assert leak.high > OTHER_DEVICE.duration_s


LOOPS = [form for form in forms(OTHER_DEVICE) if form.name in ("Bouc-Wen", "Bouc-Wen beside a curve")]


@given(st.sampled_from(LOOPS), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_a_loop_saturates_within_the_voltages_that_showed_it(form, knee, share):
    """Whatever its numbers are, beyond the span it is at most 1 / (1 - 1/e) of what it is at its end."""
    _, *free = form.free[:3]
    ends = [(x.inward(x.low), x.inward(x.high)) for x in free]
    values = [x.outward(a + p * (b - a)) for x, (a, b), p in zip(free, ends, (knee, share), strict=True)]
    numbers = form.apply(load_model("beam"), (1.0, *values, *(0.0 for _ in form.free[3:]))).values()
    loop = [numbers[f"{form.effect}.{x}"] for x in ("alpha", "beta", "gamma")] + [1.0]
    span_V = OTHER_DEVICE.span_V
    assert along(0.0, 100.0 * span_V, *loop) <= 1.6 * along(0.0, span_V, *loop)


(LEANING,) = (form for form in forms(OTHER_DEVICE) if "lean" in form.name)


@given(st.lists(st.floats(0.0, 1.0), min_size=12, max_size=12), st.floats(-1.0, 1.0))
def test_plays_that_lean_have_no_weight_below_nought_within_the_commands(weights: list[float], place: float):
    """The slope of what a play adds, p + 2 q F, is not negative where the play may stand."""
    block = LEANING.apply(load_model("beam"), (*weights, 0.0, 0.0, 0.0)).blocks
    (plays,) = (x.parameters for x in block if x.id == LEANING.effect)
    at_V = place * OTHER_DEVICE.span_V
    slopes = np.array(plays.weights_um_per_V) + 2.0 * at_V * np.array(plays.quadratic_um_per_V2)
    expected = 0.5 * (1.0 - place) * np.array(weights[:6]) + 0.5 * (1.0 + place) * np.array(weights[6:])
    assert slopes == pytest.approx(expected, abs=1e-12)
    assert np.all(slopes >= -1e-12)
    assert plays.reached_V == OTHER_DEVICE.span_V


def test_a_loop_that_is_lost_where_the_voltage_turns_is_no_answer():
    for form in LOOPS:
        (share,) = (x for x in form.free if x.name == "gamma_over_beta")
        assert share.ends_without_answer(share.low)
        assert not share.ends_without_answer(share.high)


def test_what_comes_back_once_in_the_record_is_no_periodic_disturbance():
    """A swing as long as the record is any slow curve."""
    (frequency,) = [
        x
        for form in forms(OTHER_DEVICE)
        for x in form.free
        if form.effect == "periodic_disturbance" and x.name == "frequency_Hz"
    ]
    once_Hz = 1.0 / OTHER_DEVICE.duration_s
    assert frequency.ends_without_answer(once_Hz)
    assert not frequency.ends_without_answer(1.5 * once_Hz)
    assert not frequency.ends_without_answer(frequency.high)


def test_lags_of_another_device_reach_as_far_as_its_record():
    found = {form.effect: form.free[0] for form in forms(OTHER_DEVICE) if form.effect in ("sensor_lag", "creep")}
    day = Sizes(10.0, 5.0, 86_400.0, 0.5, piezo_bender=False, highest_Hz=0.1)
    slow = {form.effect: form.free[0] for form in forms(day) if form.effect == "sensor_lag"}
    assert slow["sensor_lag"].high > 100.0 * found["sensor_lag"].high
    assert slow["sensor_lag"].high > 0.3 * 86_400.0
