"""The demonstration, small: its page stands alone and says what the files say."""

import base64
import json
import os
import re
import signal
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

from bender_report.page import Card, Page, Picture, Section, Table, render

SMALL = """
import sys
from pathlib import Path
from bender_studies.demonstration import steps
from bender_studies.demonstration.run import Scale, demonstrate
steps.measured_record = lambda: None
demonstrate(Path(sys.argv[1]), Scale(evaluations=31, plants=3, seeds=1))
"""
OVERLAY = """
import sys
from pathlib import Path
from bender_studies.demonstration import steps
from bender_studies.demonstration.story import overlay_section
sys.stdout.reconfigure(encoding="utf-8")
print(*overlay_section(steps.overlay(steps.build_fmus(), Path(sys.argv[1]), seed=0)).paragraphs)
"""
MEASURED = Path(__file__).parents[3] / "shared" / "data" / "paper_fig8.csv"


class Reader(HTMLParser):
    """Collects what a page shows and what it points to."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.images: list[bytes] = []
        self.cells: list[str] = []
        self.text, self.open = "", []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.open.append(tag)
        for name, value in attrs:
            if name == "src" and value is not None and value.startswith("data:image/png;base64,"):
                self.images.append(base64.b64decode(value.partition(",")[2], validate=True))
            elif name in ("src", "href", "srcset", "action", "data") and not str(value).startswith("#"):
                self.links.append(str(value))

    def handle_endtag(self, tag: str) -> None:
        while self.open and self.open.pop() != tag:
            pass

    def handle_data(self, data: str) -> None:
        if self.open[-1:] == ["td"]:
            self.cells.append(data)
        if "style" not in self.open:
            self.text += data


def child(code: str, out: Path) -> subprocess.CompletedProcess[str]:
    words = [sys.executable, "-c", code, str(out)]
    return subprocess.run(words, capture_output=True, encoding="utf-8", check=False, cwd=out.parent)


@pytest.fixture(scope="session")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, subprocess.CompletedProcess[str]]:
    out = tmp_path_factory.mktemp("demo") / "out"
    done = child(SMALL, out)
    assert done.returncode == 0, done.stderr
    return out, done


@pytest.mark.slow
def test_the_page_stands_alone(demo: tuple[Path, subprocess.CompletedProcess[str]]) -> None:
    page = (demo[0] / "index.html").read_text(encoding="utf-8")
    reader = Reader(page)
    assert reader.links == ["diagnosis/report.html"]
    assert (demo[0] / reader.links[0]).is_file()
    assert not re.search(r"https?:|@import|url\((?!#)", page)
    assert not reader.images
    charts = re.findall(r'<svg role="img" aria-label="([^"]+)"', page)
    assert charts
    assert all(charts.count(x) == 2 for x in charts), "one for a desk and one for a phone"
    assert "prefers-color-scheme" in page
    assert "nan" not in reader.text.lower().split()


@pytest.mark.slow
def test_the_page_says_what_the_files_say(demo: tuple[Path, subprocess.CompletedProcess[str]]) -> None:
    out, done = demo
    reader = Reader((out / "index.html").read_text(encoding="utf-8"))
    best = json.loads((out / "tune" / "tuning.json").read_text(encoding="utf-8"))["best"]
    row = reader.cells.index("reliable_bas")
    assert float(reader.cells[row + 1]) == pytest.approx(best["step"]["rise_time_s"], rel=0.01)
    assert float(reader.cells[row + 2]) == pytest.approx(best["step"]["settling_time_s"], rel=0.01)
    assert reader.cells[row + 5] == f"{best['monte_carlo']['unstable']} of 3"
    paper = reader.cells.index("paper, BAS-PID")
    assert reader.cells[paper + 1 : paper + 4] == ["0.88", "1.74", "0"]
    assert (out / "tune" / "step.png").is_file()
    assert all(f"[{step}/6]" in done.stderr for step in range(1, 7))
    assert "ours beside the paper's" in done.stdout


@pytest.mark.slow
def test_the_bench_is_better_with_the_corrected_model(demo: tuple[Path, subprocess.CompletedProcess[str]]) -> None:
    out, done = demo
    told = json.loads((out / "diagnosis" / "diagnosis.json").read_text(encoding="utf-8"))
    assert told["verdict"] == "named"
    assert [effect["id"] for effect in told["effects"]] == ["transport_delay"]
    assert told["effects"][0]["parameters"]["delay_s"]["value"] == pytest.approx(0.12, abs=0.005)
    assert told["gap"]["after"]["rms_um"] < 1.2 * told["gap"]["noise_floor_um"]
    assert told["gap"]["after"]["rms_um"] < 0.2 * told["gap"]["recalibrated"]["rms_um"]
    table = done.stdout.partition("before and after")[2].splitlines()
    overshoots = [line.split()[-3:] for line in table if "overshoot (%)" in line]
    assert len(overshoots) == 3
    assert all(float(after) < 0.5 * float(before) for before, after, _ in overshoots)
    assert [told for *_, told in overshoots] == ["better"] * 3
    assert (out / "retuned" / "gains.toml").is_file()


@pytest.mark.slow
def test_the_emulated_record_gives_its_gain_and_offset_back(
    demo: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    text = Reader((demo[0] / "index.html").read_text(encoding="utf-8")).text
    found = re.search(r"gain × ([\d.]+), offset \+([\d.]+) µm", text)
    assert found is not None
    assert float(found[1]) == pytest.approx(0.93, abs=0.01)
    assert float(found[2]) == pytest.approx(0.4, abs=0.1)
    assert (demo[0] / "record.csv").read_text(encoding="utf-8").startswith("time_s,voltage_V,displacement_um")


@pytest.mark.slow
@pytest.mark.skipif(not MEASURED.is_file(), reason="the measured record is not beside this checkout")
def test_the_measured_record_is_taken_where_it_lies(tmp_path: Path) -> None:
    done = child(OVERLAY, tmp_path)
    assert done.returncode == 0, done.stderr
    assert "steps of 0.70 µm, which accounts for 0.20 µm" in done.stdout
    assert [path.name for path in tmp_path.iterdir()] == ["overlay.png"]


@pytest.mark.skipif(os.name == "nt", reason="a console interrupt cannot be sent to one child process there")
def test_an_interrupt_ends_the_demonstration(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "bender_cli", "demo", "--out", "out"]
    with subprocess.Popen(words, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        while not process.stderr.readline().startswith("tuning with"):
            assert process.poll() is None
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=120)
    assert process.returncode == 130
    assert errors.splitlines()[-1] == "bender: interrupted; what is complete is in out"
    assert (tmp_path / "out" / "tune" / "gains.toml").is_file()
    assert not (tmp_path / "out" / "index.html").exists()


def test_what_a_page_is_given_is_shown_and_never_run() -> None:
    nasty = '<script>alert("x")</script>'
    table = Table(("a", nasty), [["b", 1.23456], [None, nasty]], stressed=frozenset({0}))
    section = Section(nasty, [nasty], table, Picture(b"png", nasty), [nasty], nasty)
    text = render(Page(nasty, nasty, [Card(nasty, nasty, nasty)], [section]))
    reader = Reader(text)
    assert "<script" not in text
    assert reader.text.count(nasty) == 12
    assert reader.images == [b"png"]
    assert reader.cells == ["b", "1.23", "–", nasty]
