"""The reproduction: what it is made of, quickly; the whole of it in small."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_loop.control.metrics import StepMetrics
from bender_report.page import render
from bender_studies.reproduction import printed
from bender_studies.reproduction.document import cells, counted, to_json
from bender_studies.reproduction.exhibit import Exhibit, Printed, Row, finite
from bender_studies.reproduction.exhibits.figure_5 import Cycle
from bender_studies.reproduction.exhibits.figure_8 import Stairs
from bender_studies.reproduction.registry import EXHIBITS
from bender_studies.reproduction.searches import Beetle
from bender_studies.reproduction.steps import Target
from bender_studies.reproduction.story import tell

PAPER = Path(__file__).parents[3] / "shared" / "paper"
SMALL = """
import sys
from pathlib import Path
from bender_studies.reproduction import bench, shared_work
from bender_studies.reproduction.run import reproduce
bench.why_not = lambda: "left out of the test"
shared_work.measured_record = lambda: None
scale = shared_work.Scale(seeds=1, evaluations=16, nearest=8, sine_s=16.0, dwell_frames=2, noisy_s=8.0, exact_s=4.0)
_, failed = reproduce(Path(sys.argv[1]), 3, scale)
raise SystemExit(len(failed))
"""


@pytest.mark.parametrize(
    ("text", "found", "met"),
    [
        ("0.473", 0.4734, True),
        ("0.473", 0.4736, False),
        ("2.74e-6", 2.7427e-6, True),
        ("2.74e-6", 2.8e-6, False),
        ("23e-12", 23.4e-12, True),
        ("no", 0.0, None),
        ("30", "never", None),
        ("30", None, None),
        ("1.74", float("inf"), False),
    ],
)
def test_a_number_meets_the_print_where_it_rounds_to_its_digits(
    text: str, found: float | str | None, met: bool | None
) -> None:
    assert Printed(text, "somewhere").is_met_by(found) is met


@given(st.decimals(min_value=-1000, max_value=1000, places=3))
def test_every_printed_number_meets_itself(number: object) -> None:
    assert Printed(str(number), "somewhere").is_met_by(float(str(number)))


def test_what_is_said_to_be_printed_is_in_the_paper() -> None:
    if not PAPER.is_dir():
        pytest.skip("the paper (../shared/paper) is not here")
    text = "".join(path.read_text(encoding="utf-8") for path in PAPER.glob("*.txt")).replace("$", "")
    text = re.sub(r"- (\d)", r"-\1", text)
    plain = re.sub(r"(\d) *(?:\\cdot|\\times) *10\^\{?(-?\d+)\}?", r"\1e\2", text)
    tables = [value for value in vars(printed).values() if isinstance(value, dict)]
    found = [value for value in vars(printed).values() if isinstance(value, Printed)]
    found += [value for table in tables for value in table.values() if isinstance(value, Printed)]
    assert len(found) > 30
    for number in found:
        assert number.text in plain, number


def test_counted_once_whatever_the_readings() -> None:
    one, other = Printed("1.0", "here"), Printed("2.0", "here")
    rows = [
        Row("a", "", one, 1.4, 1.0),
        Row("a, another reading", "", one, 1.02, None),
        Row("b", "", other, "never", 2.0),
        Row("c", "", other, 2.4, None),
        Row("given", "", Printed("3", "here"), 3.0, 3.0, given=True),
        Row("nothing printed", "", None, 1.0, 1.0),
    ]
    assert counted([Exhibit("X", "x", "p", "o", rows)]) == (1, 2)
    assert cells(rows[0]) == ["a", "", "1.0", "1.4", "1 ✓"]


def test_page_and_data_hold_every_row_and_run_nothing() -> None:
    nasty = "<script>alert(1)</script>"
    exhibit = Exhibit("Figure 0", nasty, nasty, nasty, [Row(nasty, "µm", Printed("1.0", nasty), 1.0, "never", nasty)])
    page = render(tell([exhibit], "no bench", 1.0))
    assert "<script" not in page
    assert "1 of 1" in page
    data = json.loads(to_json([exhibit], 7, "no bench", False))
    assert data["seed"] == 7
    row = data["exhibits"][0]["rows"][0]
    assert row["paper"] == {"printed": "1.0", "value": 1.0, "place": nasty}
    assert (row["paper_mode"], row["ours"], row["paper_mode_meets_paper"]) == (1.0, "never", True)


@given(st.floats(0.1, 2.0), st.floats(-3.0, 3.0))
def test_a_straight_staircase_gives_its_line_back(slope: float, offset: float) -> None:
    volts = np.array([*range(51), *range(49, -1, -1)], dtype=float)
    stairs = Stairs(volts, slope * volts + offset)
    for way in ("up", "down"):
        assert stairs.line(way) == pytest.approx((slope, offset, 1.0), abs=1e-9)
        assert stairs.r_squared_through_zero(way) <= 1.0 + 1e-9
    assert Stairs(volts, slope * volts).sensitivity_um_per_V == pytest.approx(slope)


def test_a_sine_is_measured_as_it_is() -> None:
    time = np.arange(600) / 30.0
    cycle = Cycle.of(time, 1.5 + 8.0 * np.sin(np.pi * time + 0.5 - np.radians(9.0)))
    assert cycle.span_um == pytest.approx(16.0, rel=1e-5)
    assert cycle.mean_um == pytest.approx(1.5)
    assert cycle.gain_um_per_V == pytest.approx(0.8)
    assert cycle.phase_deg == pytest.approx(-9.0)
    assert cycle.noise_um < 1e-9


def test_gains_that_stop_moving_stand_still_from_there_on() -> None:
    places = np.ones((11, 3))
    places[:4, 1] = [5.0, 4.0, 3.0, 2.0]
    assert Beetle(places, None, 1.0).still_after == 4
    assert Beetle(np.ones((11, 3)), None, 1.0).still_after == 0


def test_a_step_that_is_the_printed_one_misses_nothing() -> None:
    met = StepMetrics(1.0, 1.0, 5.7, 0.96, 3.82, 0.0, 1.0, 1.0)
    never = StepMetrics(1.0, 1.0, 5.7, 0.96, float("nan"), 0.0, 1.0, 1.0)
    target = Target(0.96, 3.82, 5.7)
    assert target.miss(met) == pytest.approx(0.0)
    assert target.miss(never) == pytest.approx(10.0)
    assert finite(never.settling_time_s, "never") == "never"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, subprocess.CompletedProcess[str]]:
    out = tmp_path_factory.mktemp("reproduce") / "out"
    done = subprocess.run(
        [sys.executable, "-c", SMALL, str(out)], capture_output=True, encoding="utf-8", check=False, cwd=out.parent,
        env={**os.environ, "PYTHONIOENCODING": "utf-8"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return out, done


@pytest.mark.slow
def test_everything_is_computed_and_written(whole: tuple[Path, subprocess.CompletedProcess[str]]) -> None:
    out, done = whole
    assert {path.name for path in out.iterdir()} == {"index.html", "reproduction.json", "records"}
    assert {path.name for path in (out / "records").iterdir()} >= {"sine.csv", "staircase.csv", "step-ours.csv"}
    data = json.loads((out / "reproduction.json").read_text(encoding="utf-8"))
    rows = {(exhibit["name"], row["quantity"]): row for exhibit in data["exhibits"] for row in exhibit["rows"]}
    assert [exhibit["name"] for exhibit in data["exhibits"]] == list(EXHIBITS)
    assert rows["Figure 4", "relative error, mean squares"]["paper_mode_meets_paper"]
    assert rows["Figure 4", "polynomials to degree 3, two tones"]["paper_mode"] == pytest.approx(151.0, abs=1.0)
    assert rows["Table 1", "static tip displacement"]["ours"] == pytest.approx(1.14878, abs=1e-5)
    assert rows["Table 1", "first frequency, λ = 1.875/L"]["ours"] == pytest.approx(104.37, abs=0.01)
    assert rows["Table 1", "first mode (10) at the clamp, over L"]["paper_mode"] == pytest.approx(0.700, abs=1e-3)
    assert rows["Equation (30)", "at rest under 50 V"]["paper_mode"] == pytest.approx(23.141, abs=1e-3)
    assert rows["Equation (30)", "loop at ± 50 V and 0.5 Hz, signed"]["paper_mode"] < 0.0
    absent = rows["Figure 8", "the published points"]
    assert (absent["paper_mode"], absent["ours"]) == (None, None)
    assert "not in ../shared/data" in absent["remark"]
    assert all(f"[{k}/9] {name}: " in done.stderr for k, name in enumerate(EXHIBITS, 1))
    assert "left out of the test" in data["experiments"]


@pytest.mark.slow
def test_the_page_needs_nothing_beside_it(whole: tuple[Path, subprocess.CompletedProcess[str]]) -> None:
    page = (whole[0] / "index.html").read_text(encoding="utf-8")
    assert not re.search(r"https?:|@import|url\(|<script|<link", page)
    assert "data:image/png;base64," in page
    assert not re.search(r">\s*(?:nan|inf|None)\b", page)
