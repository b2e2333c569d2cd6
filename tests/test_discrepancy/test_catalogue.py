"""Catalogue, pages, blocks and contract say the same."""

import math
import re
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_discrepancy.effects.catalogue import EFFECTS, FULL_VOLTAGE_V, Effect, FULL_STROKE_um
from bender_discrepancy.effects.documents import documents, stale
from bender_discrepancy.effects.effect import Sizes, powers_of_unit
from bender_discrepancy.report.signature.drives import DRIVES, nominal_model
from bender_discrepancy.report.signature.views import VIEWS
from bender_plant.blocks import BLOCKS
from bender_plant.model import load_model
from bender_plant.parameter import WIDEST
from bender_report.wording import unit_text

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
    low, high = (float(x.replace("∞", repr(WIDEST))) for x in cell.split(" … "))
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
    assert list(rows) == list(effect.defaults)
    for name, (unit, bounds, default, covered, typical, text) in rows.items():
        known = effect.parameters.get(name)
        if known is None:
            assert re.findall("`(.+?)`", bounds) == list(effect.block.module.FORMS)
            assert default == f"`{effect.defaults[name]}`"
            continue
        assert (unit, text) == (unit_text(known.unit) or "1", known.text.replace("|", "&#124;"))
        assert limits(bounds) == (known.low, known.high)
        assert limits(covered) == effect.covered.get(name)
        assert limits(typical) == (effect.typical[name][:2] if name in effect.typical else None)
        value = effect.defaults[name]
        assert default == "none" if isinstance(value, tuple) else float(default) == value


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
