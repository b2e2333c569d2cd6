"""A terminal that shows no micro sign: text stays readable, and nothing ends for it."""

import io
import os
import subprocess
import sys
from pathlib import Path

import pytest
from few import few_rows

from bender_loop.shell.readable import in_ascii, make_readable

RECORD = Path(__file__).parents[2] / "examples" / "record.csv"


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("0.5 µm → 2 × 10⁻⁵ V²", "0.5 um -> 2 x 10^-5 V2"),
        ("−3 ± 0.1 µm/V², …", "-3 +- 0.1 um/V2, ..."),
        ("nothing to change", "nothing to change"),
        ("voltage 電圧", "voltage ??"),
    ],
)
@pytest.mark.parametrize("encoding", ["ascii", "utf-8"])
def test_a_stream_shows_what_it_can_and_the_rest_in_ascii(encoding: str, text: str, shown: str) -> None:
    data = io.BytesIO()
    stream = io.TextIOWrapper(data, encoding=encoding)
    make_readable(stream)
    stream.write(text)
    stream.flush()
    assert data.getvalue().decode(encoding) == (shown if encoding == "ascii" else text)
    assert in_ascii(text) == shown


def test_a_code_page_keeps_the_signs_that_it_has() -> None:
    stream = io.TextIOWrapper(io.BytesIO(), encoding="cp1252")
    make_readable(stream)
    stream.write("3 µm² → −2")
    stream.flush()
    assert stream.buffer.getvalue().decode("cp1252") == "3 µm² -> -2"  # pyright: ignore[reportAttributeAccessIssue]


@pytest.mark.slow
@pytest.mark.parametrize(("encoding", "unit"), few_rows([("ascii", " um, "), ("utf-8", " µm, ")], 0))
def test_a_command_says_micrometres_as_its_terminal_can(encoding: str, unit: str, tmp_path: Path) -> None:
    words = [sys.executable, "-m", "bender_cli", "compare", str(RECORD), "--out", str(tmp_path / "out")]
    ended = subprocess.run(
        words, capture_output=True, env=os.environ | {"PYTHONIOENCODING": encoding}, cwd=tmp_path, check=False
    )
    assert ended.returncode == 0, ended.stderr
    assert unit in ended.stdout.decode(encoding)
